"""Modules and classes under the names that they had in earlier versions, by which pickles and scripts know them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

from coadjoint.extensions import absent

_MODULES = {
    "mechanics.casimirs": "mechanics.casimir_functions",
    "mechanics.mechanical_connection": "mechanics.locked_inertia",
    "mechanics.trace_casimirs": "mechanics.trace_functions",
    "simulation.accuracy.accuracy": "simulation.accuracy.verdict",
    "simulation.recording": "simulation.result",
    "simulation.steppers.slave": "simulation.steppers.fmi_instance",
    "theory.discrete_mechanical_connection": "theory.discrete_connections",
    "theory.lagrange_poincare": "theory.principal_bundles",
}

NAMES = {
    **{f"coadjoint.{before}": f"coadjoint.{now}" for before, now in _MODULES.items()},
    "coadjoint.vehicles": "coadjoint_vehicles",
}
"""Modules and packages by their earlier names, and their names now."""

CLASSES = {"FmiInstance": "StepperSlave"}
"""Classes by their names now, and their earlier names in modules of earlier names."""


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
        """Give the module, which has run, its own spec again, and its classes the names that they had."""
        earlier = module.__spec__
        assert earlier is not None
        for now, before in CLASSES.items():
            if hasattr(module, now):
                setattr(module, before, getattr(module, now))
        parent, _, child = earlier.name.rpartition(".")
        if child in getattr(package := sys.modules[parent], "__all__", ()):
            package.__class__ = _Package
        module.__spec__ = earlier.loader_state


class _Package(ModuleType):
    """A package with a public name that was that of a module, too, which the import of the module must not replace."""

    def __setattr__(self, name: str, value: object) -> None:
        if not isinstance(value, ModuleType) or value.__name__ == f"{self.__name__}.{name}":
            super().__setattr__(name, value)


def _now(name: str) -> str:
    earlier = next((one for one in NAMES if f"{name}.".startswith(f"{one}.")), None)
    return "" if earlier is None else NAMES[earlier] + name.removeprefix(earlier)


def install() -> None:
    """Find modules by their earlier names."""
    if not any(isinstance(one, EarlierNames) for one in sys.meta_path):
        sys.meta_path.insert(0, EarlierNames())  # a package of today has a path, in which others would find its modules
