"""The identity of the library in this process: a digest of its files, of those of packages above it, and of tracers.

There is none where the files may not be what runs, because one is younger than this process. What is replaced in memory
is not noticed.
"""

from __future__ import annotations

import hashlib
import os
import sys
import time
from functools import cache, lru_cache
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from coadjoint.extensions import extensions
from coadjoint.kernels import store
from coadjoint.postponed import load, loaded

NAME = __name__.partition(".")[0]
ROOT = Path(__file__).parents[2]
PACKAGES = ("jax", "jaxlib", "numpy", "scipy", "llvmlite")
"""The packages that trace, and those that emit machine code."""

_BEGAN = time.time()


@cache
def homes() -> dict[str, Path]:
    """The folder of the library, and those of the packages that add to it, by their names."""
    found = {NAME: ROOT}
    for module in extensions():
        name = module.partition(".")[0]
        spec = find_spec(name)
        if spec is not None and spec.submodule_search_locations:
            found[name] = Path(next(iter(spec.submodule_search_locations)))
    return found


def library() -> str | None:
    """The digest, or None."""
    files = _files()
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
        hasher.update(f"{_written(path)} {len(content)} ".encode() + content)
    return hasher.hexdigest()


def _written(path: str) -> str:
    """A file's path in its package, which says nothing of where the package is installed."""
    home = next(home for home in map(str, homes().values()) if path.startswith(home + os.sep))
    return path[len(home) + 1 :]


def edited() -> bool:
    """Whether a file of the library has been written since this process began; modules loaded later may differ."""
    try:
        return any(os.stat(path).st_mtime >= _BEGAN for path in _paths())
    except OSError:
        return True


def _paths(part: str = "") -> list[str]:
    """All files of the library, or of a folder in it, but not those that Python writes there."""
    found = []
    for home in [ROOT / part] if part else homes().values():
        for folder, folders, names in os.walk(home):
            folders[:] = sorted(name for name in folders if name != "__pycache__")
            found += [os.path.join(folder, name) for name in sorted(names)]
    return found


@lru_cache(maxsize=1)
def _versions() -> str:
    return " ".join([sys.version, *(f"{name} {metadata.version(name)}" for name in PACKAGES)])


_written_settings: list[tuple[dict[str, object], str]] = []
"""JAX's settings as they were last, and their text."""


def _settings() -> str:
    """JAX's settings, some of which change what is traced; before it is loaded those with which it will begin."""
    if not loaded("jax"):
        return _first_settings()
    import jax

    values = dict(jax.config.values)
    if not _written_settings or _written_settings[-1][0] != values:
        _written_settings[:] = [(values, repr(sorted((str(name), repr(value)) for name, value in values.items())))]
    return _written_settings[-1][1]


@lru_cache(maxsize=1)
def _first_settings() -> str:
    """The settings that JAX takes from variables of the environment, as an earlier process has kept them."""
    variables = sorted(f"{name}={value}" for name, value in os.environ.items() if "JAX" in name or "XLA" in name)
    name = store.key("settings", _versions(), *variables)
    kept = store.fetch(name)
    if kept is not None:
        return kept.decode()
    load("jax")
    found = _settings()
    store.keep(name, found.encode())
    return found
