"""Modules under the names that they had in earlier versions, by which pickles know them: `coadjoint.vehicles`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

from coadjoint.extensions import absent

NAMES = {"coadjoint.vehicles": "coadjoint_vehicles"}
"""Packages that were in the library, and their names now."""


class EarlierNames(MetaPathFinder, Loader):
    """Imports the module of today where a module is asked for by its earlier name."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        """The spec of a module with an earlier name, else None."""
        return ModuleSpec(name, self) if _now(name) else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """The module of today, whose own spec is kept."""
        now = _now(spec.name)
        try:
            module = import_module(now)
        except ModuleNotFoundError as error:
            if error.name == now.partition(".")[0]:
                raise ModuleNotFoundError(absent(f"The module {spec.name}"), name=error.name) from None
            raise
        spec.loader_state = module.__spec__
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Nothing: the module has run, and its spec is its own again."""
        earlier = module.__spec__
        module.__spec__ = earlier.loader_state if earlier is not None else None


def _now(name: str) -> str:
    earlier = next((one for one in NAMES if f"{name}.".startswith(f"{one}.")), None)
    return "" if earlier is None else NAMES[earlier] + name.removeprefix(earlier)


def install() -> None:
    """Find modules by their earlier names."""
    if not any(isinstance(one, EarlierNames) for one in sys.meta_path):
        sys.meta_path.insert(0, EarlierNames())  # a package of today has a path, in which others would find its modules
