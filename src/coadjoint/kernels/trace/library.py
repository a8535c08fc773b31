"""Which library runs here: a digest of its files, and of the packages that decide how a function is traced.

There is none where the files may not be what runs: a file is younger than this process, or a function, class or
constant of the library has been replaced in memory.
"""

from __future__ import annotations

import hashlib
import operator
import os
import sys
import sysconfig
import threading
import time
import types
from functools import lru_cache
from importlib import metadata
from pathlib import Path
from typing import Any

NAME = __name__.partition(".")[0]
ROOT = Path(__file__).parents[2]
PACKAGES = ("jax", "jaxlib", "numpy", "scipy", "llvmlite")
"""What traces, and what emits machine code."""

_IMPORTS = {NAME, *PACKAGES, *sys.stdlib_module_names}
_INSTALLED = tuple({path for name, path in sysconfig.get_paths().items() if name in ("stdlib", "purelib", "platlib")})
_CODE, _DEFAULTS = operator.attrgetter("__code__"), operator.attrgetter("__defaults__")
_BEGAN = time.time()
_lock = threading.Lock()
_first: dict[int, _Held] = {}
"""What every module and class of the library held when it was first seen, by its address."""


def library() -> str | None:
    """The digest, or None."""
    files = None if _changed() else _files()
    return None if files is None else hashlib.sha256(f"{files} {_versions()} {_settings()}".encode()).hexdigest()


@lru_cache(maxsize=1)
def _files() -> str | None:
    """The digest of all files of the library, read once; None where one is younger than this process."""
    try:
        found = digest_of_files()
    except OSError:
        return None
    return None if edited() else found


@lru_cache(maxsize=2)
def digest_of_files(part: str = "") -> str:
    """The SHA-256 of all files of the library, or of a folder in it, read once."""
    hasher = hashlib.sha256()
    for path in _paths(part):
        with open(path, "rb") as file:
            content = file.read()
        hasher.update(f"{os.path.relpath(path, ROOT)} {len(content)} ".encode() + content)
    return hasher.hexdigest()


def edited() -> bool:
    """Whether a file of the library has been written since this process began; modules loaded later may be others."""
    try:
        return any(os.stat(path).st_mtime >= _BEGAN for path in _paths())
    except OSError:
        return True


def _paths(part: str = "") -> list[str]:
    """All files of the library, or of a folder in it, but not those that Python writes there."""
    found = []
    for folder, folders, names in os.walk(ROOT / part):
        folders[:] = sorted(name for name in folders if name != "__pycache__")
        found += [os.path.join(folder, name) for name in sorted(names)]
    return found


@lru_cache(maxsize=1)
def _versions() -> str:
    return " ".join([sys.version, *(f"{name} {metadata.version(name)}" for name in PACKAGES)])


def _settings() -> str:
    """JAX's settings, some of which change what is traced."""
    import jax

    return repr(sorted((str(name), repr(value)) for name, value in jax.config.values.items()))


def _changed() -> bool:
    """Whether anything of the library is not in memory what it was when it was first seen, or is somebody else's."""
    with _lock:
        owners = [module for name, module in list(sys.modules.items()) if name.startswith(f"{NAME}.")]
        come = set(map(id, owners))
        for owner in owners:  # classes are added behind the modules that define them
            now, known = vars(owner), _first.get(id(owner))
            if known is None:
                known = _Held(owner)
                if known.foreign:
                    return True
                _first[id(owner)] = known
            if not known.unchanged():
                return True
            if isinstance(owner, type) and len(now) != known.size and known.grown():
                return True
            owners += [one for one in known.classes if id(one) not in come]
            come.update(map(id, known.classes))
    return False


class _Held:
    """What lasts of a module or class: values by name, what is inside functions, and the classes that it defines."""

    def __init__(self, owner: Any) -> None:
        self.owner, self.size = owner, len(vars(owner))
        lasting = {name: value for name, value in list(vars(owner).items()) if _lasting(name, value)}
        self.names, self.values = tuple(lasting), tuple(lasting.values())
        functions = [getattr(value, "__func__", value) for value in self.values]
        self.functions = [one for one in functions if isinstance(one, types.FunctionType)]
        self.codes, self.defaults = tuple(map(_CODE, self.functions)), tuple(map(_DEFAULTS, self.functions))
        self.foreign = any(map(_foreign, self.functions))
        module = owner.__name__ if isinstance(owner, types.ModuleType) else owner.__module__
        classes = [value for value in self.values if isinstance(value, type) and value.__module__ == module]
        self.classes = [one for one in classes if one is not owner]

    def unchanged(self) -> bool:
        """Whether every value is the same object with the same code; every set-up asks this of some 14 000 values."""
        if not all(map(operator.is_, map(vars(self.owner).get, self.names), self.values)):
            return False
        codes, defaults = map(_CODE, self.functions), map(_DEFAULTS, self.functions)
        return all(map(operator.is_, codes, self.codes)) and all(map(operator.is_, defaults, self.defaults))

    def grown(self) -> bool:
        """Whether a class has something new, which may stand before what it inherits."""
        before = set(self.names)
        return any(_lasting(name, value) and name not in before for name, value in list(vars(self.owner).items()))


def _lasting(name: str, value: Any) -> bool:
    """Whether this stays what it is, as functions, classes and constants do; others are set at their first use."""
    return callable(value) or isinstance(value, (staticmethod, classmethod, property)) or name.strip("_").isupper()


def _foreign(value: Any) -> bool:
    """Whether a function was written neither in the library nor in a package that is installed."""
    root = str(getattr(value, "__module__", "")).partition(".")[0]
    if root in _IMPORTS:
        return False
    module = sys.modules.get(root)
    home = str(getattr(module, "__file__", ""))
    return root == "__main__" or (module is not None and not home.startswith(_INSTALLED))
