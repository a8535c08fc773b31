"""Rules and difference maps by the names that people write: `LeftRectangle`, `left-rectangle`, `left rectangle`."""

from __future__ import annotations

from inspect import signature
from typing import TYPE_CHECKING, Any

import coadjoint
from coadjoint.cli.sections import MethodSection
from coadjoint.cli.units import unknown
from coadjoint.errors import ArgumentError

if TYPE_CHECKING:
    from coadjoint.difference_maps import DifferenceMap
    from coadjoint.methods import Method

_CONTRACTS = ("Method", "DifferenceMap", "Squared")
"""Names that are no rule or map of their own."""


def method_name(written: str) -> str:
    """The class name of a rule; raises ArgumentError."""
    return _named(written, "coadjoint.methods", "method")


def map_name(written: str) -> str:
    """The class name of a difference map, after "squared" for squared maps; raises ArgumentError."""
    plain = _plain(written)
    if plain.startswith("squared"):
        return "squared " + map_name(plain.removeprefix("squared"))
    return _named(written, "coadjoint.difference_maps", "map")


def method(chosen: MethodSection) -> Method:
    """The rule of a [method] section."""
    return _rule(chosen, method_name(chosen.name), chosen.start)


def _rule(chosen: MethodSection, name: str, start: str) -> Method:
    kind: Any = getattr(coadjoint, name)
    if "base" in signature(kind).parameters:
        return kind(_rule(chosen, method_name(chosen.base or "Midpoint"), "momentum"), start=start)
    if chosen.base and name == method_name(chosen.name):
        raise ArgumentError(f"[method] base belongs to a composition such as Suzuki4, not to {name}: leave it out.")
    if "degree" in signature(kind).parameters:
        degree = {} if chosen.degree is None else {"degree": chosen.degree}
        return kind(_map(map_name(chosen.map)), start=start, **degree)
    if chosen.degree is not None and name == method_name(chosen.name):
        raise ArgumentError(f"[method] degree belongs to Galerkin, not to {name}: leave it out.")
    return kind(_map(map_name(chosen.map)), start=start)


def _map(name: str) -> DifferenceMap:
    if name.startswith("squared "):
        return coadjoint.Squared(_map(name.removeprefix("squared ")))
    return getattr(coadjoint, name)()


def _named(written: str, home: str, what: str) -> str:
    names = [name for name in coadjoint._HOMES[home] if name not in _CONTRACTS]
    plain = {_plain(name): name for name in names}
    if _plain(written) not in plain:
        raise ArgumentError(unknown(f"{what} `{written}`", "coadjoint", written, names))
    return plain[_plain(written)]


def _plain(name: str) -> str:
    return "".join(letter for letter in name.lower() if letter.isalnum())
