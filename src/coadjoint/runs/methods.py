"""Rules and difference maps by the names that people write: `LeftRectangle`, `left-rectangle`, `left rectangle`."""

from __future__ import annotations

from collections.abc import Sequence
from inspect import signature
from typing import TYPE_CHECKING, Any

from coadjoint.checks import letters, unknown
from coadjoint.errors import ArgumentError
from coadjoint.extensions import Registry, import_string
from coadjoint.lazy import homes
from coadjoint.runs.sections import MethodSection

if TYPE_CHECKING:
    from coadjoint.difference_maps import DifferenceMap
    from coadjoint.methods import Method

METHODS: Registry[str] = Registry("METHODS")
"""Methods of packages above, by the names of their classes: "module:Class"."""

_CONTRACTS = ("Claims", "DifferenceMap", "Method", "Squared", "Step")
"""Names of base classes and wrappers, which are not rules or maps themselves."""

_OPTIONS = {
    "base": "a method over another, such as Suzuki4",
    "degree": "Galerkin",
    "coefficients": "Composition",
    "negative_substeps": "a composition, such as Suzuki4",
    "points": "EnergyMomentum",
    "within": "VariableStep",
}
"""Keys of [method] that only some rules take."""

_BASES = {"VariableStep": "Simpson"}
"""The base of a method if [method] base is not given; Midpoint for all others."""


def method_name(written: str) -> str:
    """The class name of a rule; raises ArgumentError."""
    return _named(written, [*homes("coadjoint.methods"), *METHODS], "method")


def map_name(written: str) -> str:
    """The class name of a difference map, after "squared" for squared maps; raises ArgumentError."""
    plain = letters(written)
    if plain.startswith("squared"):
        return "squared " + map_name(plain.removeprefix("squared"))
    return _named(written, [*homes("coadjoint.difference_maps")], "map")


def method(chosen: MethodSection) -> Method:
    """The rule of a [method] section."""
    return _rule(chosen, method_name(chosen.name), chosen.start)


def _rule(chosen: MethodSection, name: str, start: str) -> Method:
    from coadjoint import methods

    kind: Any = import_string(METHODS[name]) if name in METHODS else getattr(methods, name)
    takes = signature(kind).parameters
    outermost = name == method_name(chosen.name)
    options = {key: getattr(chosen, key) for key in _OPTIONS if getattr(chosen, key) not in (None, "")}
    for key in options:
        if outermost and key not in takes and not ("base" in takes and key in ("degree", "points")):
            raise ArgumentError(f"[method] {key} belongs to {_OPTIONS[key]}, not to {name}: leave it out.")
    options = {key: value for key, value in options.items() if key in takes}
    if "coefficients" in takes and "coefficients" not in options:
        raise ArgumentError("[method] Composition needs coefficients, such as coefficients = [0.5, 0.5].")
    if "base" in takes:
        options["base"] = _rule(chosen, method_name(chosen.base or _BASES.get(name, "Midpoint")), "momentum")
    else:
        options["difference_map"] = _map(map_name(chosen.map))
    return kind(start=start, **options)


def _map(name: str) -> DifferenceMap:
    from coadjoint import difference_maps

    if name.startswith("squared "):
        return difference_maps.Squared(_map(name.removeprefix("squared ")))
    return getattr(difference_maps, name)()


def _named(written: str, there: Sequence[str], what: str) -> str:
    names = [name for name in there if name not in _CONTRACTS]
    plain = {letters(name): name for name in names}
    if letters(written) not in plain:
        raise ArgumentError(unknown(f"{what} `{written}`", "coadjoint", written, names))
    return plain[letters(written)]
