"""Imports of large packages that wait until a name of theirs is read.

After `postpone("jax")`, `import jax.numpy as jnp` gives a module whose file has not been run. The first name that is
read of any module of the package runs the files of all, by their own loaders and into the same objects, which are
ordinary modules from then on. A process that reads none never loads the package.

`coadjoint.cli.start` calls it, because a repeated command finds plan, machine code and checks in the cache. In a
process of a user `import` is as always.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import ModuleType

from coadjoint.arrays import PyTree
from coadjoint.errors import rephrased

_waiting: dict[str, dict[str, ModuleType]] = {}
"""The modules of each postponed package that have been imported and not run, by their names."""
_postponed: set[str] = set()
_running: dict[str, ModuleType] = {}
"""Those of a package that is being loaded."""
_stand_ins: dict[str, Mapping[str, object]] = {}
_calls: dict[str, list[Callable[[], object]]] = {}
"""What is called when a package has been loaded."""
_lock = threading.RLock()


def postpone(package: str, stand_ins: Mapping[str, Mapping[str, object]] | None = None) -> None:
    """Let imports of a package wait, unless it is loaded already.

    stand_ins: by names of modules, objects by names that can be read without loading; by default none.
    """
    if package in sys.modules:
        return
    _waiting[package] = {}
    _postponed.add(package)
    _stand_ins.update(stand_ins or {})
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Finder())


def loaded(package: str) -> bool:
    """Whether a package is loaded, so that values of its types may exist."""
    return package in sys.modules and package not in _waiting


def waited(package: str) -> bool:
    """Whether a package was postponed in this process, even if it has been loaded since."""
    return package in _postponed


def when_loaded(package: str, call: Callable[[], object]) -> None:
    """Call now or, where the package is postponed, when it has been loaded."""
    with _lock:
        if package in _waiting:
            _calls.setdefault(package, []).append(call)
            return
    call()


class _Postponed(ModuleType):
    """A module whose file has not been run, or not to its end."""

    def __getattr__(self, name: str) -> object:
        package, inner = self.__name__.partition(".")[0], f"{self.__name__}.{name}"
        with _lock:  # another thread may be loading
            if package in _waiting and name != "__path__":  # for which `import` asks
                stand_ins = _stand_ins.get(self.__name__, {})
                if name in stand_ins:
                    return stand_ins[name]
                if "__path__" in vars(self) and not name.startswith("__") and find_spec(inner) is not None:
                    return import_module(inner)
                load(package)
        return ModuleType.__getattribute__(self, name)

    def __dir__(self) -> list[str]:
        load(self.__name__.partition(".")[0])
        return [*ModuleType.__dir__(self)]


def load(package: str) -> None:
    """Run the files of all modules of a package that wait; does nothing for one that is loaded.

    Raises FileError where they fail, as jax does for an environment variable of its own that it cannot read.
    """
    with _lock:
        modules = _waiting.pop(package, None)
        if modules is None:
            return
        for name, module in modules.items():
            del sys.modules[name]
            above, _, last = name.rpartition(".")
            if above:
                vars(modules[above]).pop(last, None)
            _running[name] = module
        try:
            with rephrased(f"Package {package} cannot be loaded", Exception, then="correct this and start again"):
                for name in [package, *modules]:
                    import_module(name)
        finally:
            for name, module in modules.items():
                del _running[name]
                module.__class__ = ModuleType
        for call in _calls.pop(package, ()):
            call()


@cache
def object_of(place: str) -> PyTree:
    """The object of this name in a package, which is loaded for it, as `jax.tree.map`; found once."""
    module, _, name = place.rpartition(".")
    load(module.partition(".")[0])
    return getattr(import_module(module), name)


class _Finder(MetaPathFinder):
    """Finds modules by the other finders, and replaces their loaders."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        waits, module = fullname.partition(".")[0] in _waiting, _running.get(fullname)
        if not waits and module is None:
            return None
        others = (finder for finder in sys.meta_path if not isinstance(finder, _Finder))
        spec = next(filter(None, (finder.find_spec(fullname, path, target) for finder in others)), None)
        if spec is not None and spec.loader is not None:
            spec.loader = _Later(spec.loader, module)
        return spec


class _Later(Loader):
    """Leaves a module empty; or, given one that it has left empty, runs its file in it."""

    def __init__(self, loader: Loader, module: ModuleType | None):
        self._loader, self._module = loader, module

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        return self._module

    def exec_module(self, module: ModuleType) -> None:
        if self._module is None:
            _waiting[module.__name__.partition(".")[0]][module.__name__] = module
            module.__class__ = _Postponed
            return
        spec = module.__spec__
        if spec is not None:
            spec.loader = module.__loader__ = self._loader
        self._loader.exec_module(module)
