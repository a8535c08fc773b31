"""Units in the key names of run files: `duration_min = 10` is `duration` in SI units."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from difflib import get_close_matches
from math import pi
from typing import Any

from coadjoint.errors import ArgumentError

REVOLUTIONS = "revolutions in a second"

UNITS: dict[str, tuple[str, float]] = {
    "s": ("time", 1.0), "ms": ("time", 1e-3), "min": ("time", 60.0), "h": ("time", 3600.0), "days": ("time", 86400.0),
    "m": ("length", 1.0), "mm": ("length", 1e-3), "cm": ("length", 1e-2), "km": ("length", 1e3),
    "nmi": ("length", 1852.0),
    "m_per_s": ("speed", 1.0), "m_s": ("speed", 1.0), "cm_per_s": ("speed", 1e-2), "km_per_h": ("speed", 1 / 3.6),
    "knots": ("speed", 1852.0 / 3600.0),
    "rad": ("angle", 1.0), "deg": ("angle", pi / 180),
    "rad_per_s": ("angular velocity", 1.0), "deg_per_s": ("angular velocity", pi / 180),
    "rad_s": ("angular velocity", 1.0), "deg_s": ("angular velocity", pi / 180),
    "rpm": ("angular velocity", pi / 30), "per_s": (REVOLUTIONS, 1.0),
    "kg": ("mass", 1.0), "g": ("mass", 1e-3), "t": ("mass", 1e3),
    "N": ("force", 1.0), "kN": ("force", 1e3),
}  # fmt: skip
"""The endings of key names, with what they measure and how many SI units they are."""

NO_UNIT = "what no unit here measures"
"""What a kind says of numbers that are in SI units only."""

_LONGEST_FIRST = sorted(UNITS, key=len, reverse=True)


def in_si(section: str, given: Mapping[str, Any], known: Collection[str], kinds: Mapping[str, str]) -> dict[str, Any]:
    """The values of a section under their known names, in SI units.

    `known`: the names of the section; `kinds`: what those measure of which it is known. Raises ArgumentError for an
    unknown key, naming the nearest known one, for a unit of another kind, and for a value given twice.
    """
    found: dict[str, Any] = {}
    for key, value in given.items():
        name, unit = _split(section, key, known)
        if name in found:
            raise ArgumentError(f"Section [{section}] gives `{name}` twice: once as `{key}`, once in another unit.")
        if unit is None:
            found[name] = value
            continue
        measures, factor = UNITS[unit]
        if unit == "rpm" and kinds.get(name) == REVOLUTIONS:
            measures, factor = REVOLUTIONS, 1 / 60
        if kinds.get(name, measures) != measures:
            raise ArgumentError(
                f"Key `{key}` of section [{section}] ends in a unit of {measures}, but `{name}` measures {kinds[name]}."
            )
        found[name] = _times(f"[{section}] {key}", value, factor)
    return found


def _split(section: str, key: str, known: Collection[str]) -> tuple[str, str | None]:
    """The known name in a key, and its unit."""
    if key in known:
        return key, None
    for unit in _LONGEST_FIRST:
        name = key.removesuffix(f"_{unit}")
        if name != key and name in known:
            return name, unit
    raise ArgumentError(unknown(f"key `{key}`", f"Section [{section}]", key, known))


def without_unit(key: str) -> str:
    """A key name without the unit that it ends in."""
    unit = next((unit for unit in _LONGEST_FIRST if key.endswith(f"_{unit}")), None)
    return key if unit is None else key.removesuffix(f"_{unit}")


def unknown(what: str, where: str, given: str, known: Collection[str]) -> str:
    """The sentence for a name that is not known, with the nearest one that is."""
    near = get_close_matches(given, list(known), n=1, cutoff=0.5)
    listed = ", ".join(sorted(known))
    if not listed:
        return f"{where} has no {what}: it has none."
    hint = f"did you mean `{near[0]}`? It knows {listed}." if near else f"it knows {listed}."
    return f"{where} has no {what}: {hint}"


def letters(name: str) -> str:
    """The letters and digits of a name in lower case, by which `left-rectangle` is `LeftRectangle`."""
    return "".join(letter for letter in name.lower() if letter.isalnum())


def _times(what: str, value: Any, factor: float) -> Any:
    if isinstance(value, list):
        return [_times(what, inner, factor) for inner in value]
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ArgumentError(f"{what} must hold numbers, because its name ends in a unit, but holds {value!r}.")
    return value * factor
