"""Units of vehicle files: a word such as "kg m^2" or "N s/m" as a number of SI units with its dimension."""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import pi
from typing import Any

from coadjoint.errors import ArgumentError

_BASE: dict[str, tuple[float, tuple[int, int, int, int]]] = {
    "1": (1.0, (0, 0, 0, 0)),
    "%": (0.01, (0, 0, 0, 0)),
    "kg": (1.0, (1, 0, 0, 0)),
    "g": (1e-3, (1, 0, 0, 0)),
    "t": (1e3, (1, 0, 0, 0)),
    "lb": (0.45359237, (1, 0, 0, 0)),
    "m": (1.0, (0, 1, 0, 0)),
    "mm": (1e-3, (0, 1, 0, 0)),
    "µm": (1e-6, (0, 1, 0, 0)),
    "cm": (1e-2, (0, 1, 0, 0)),
    "km": (1e3, (0, 1, 0, 0)),
    "in": (0.0254, (0, 1, 0, 0)),
    "ft": (0.3048, (0, 1, 0, 0)),
    "L": (1e-3, (0, 3, 0, 0)),
    "l": (1e-3, (0, 3, 0, 0)),
    "mL": (1e-6, (0, 3, 0, 0)),
    "ml": (1e-6, (0, 3, 0, 0)),
    "s": (1.0, (0, 0, 1, 0)),
    "ms": (1e-3, (0, 0, 1, 0)),
    "µs": (1e-6, (0, 0, 1, 0)),
    "us": (1e-6, (0, 0, 1, 0)),
    "min": (60.0, (0, 0, 1, 0)),
    "h": (3600.0, (0, 0, 1, 0)),
    "Hz": (1.0, (0, 0, -1, 0)),
    "N": (1.0, (1, 1, -2, 0)),
    "kN": (1e3, (1, 1, -2, 0)),
    "kgf": (9.80665, (1, 1, -2, 0)),
    "lbf": (4.4482216152605, (1, 1, -2, 0)),
    "kn": (1852.0 / 3600.0, (0, 1, -1, 0)),
    "knots": (1852.0 / 3600.0, (0, 1, -1, 0)),
    "rad": (1.0, (0, 0, 0, 1)),
    "deg": (pi / 180, (0, 0, 0, 1)),
    "°": (pi / 180, (0, 0, 0, 1)),
    "rev": (2 * pi, (0, 0, 0, 1)),
    "rpm": (2 * pi / 60, (0, 0, -1, 1)),
}
"""Symbols with their SI value and their powers of mass, length, time and angle."""

_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻μ", "0123456789-µ")  # and the Greek letter as the sign of micro
_FACTOR = re.compile(r"^([A-Za-zµ°%]+|1)(?:\^?(-?\d))?$")


@dataclass(frozen=True)
class Dimension:
    """What a number measures: its powers of mass, length, time and angle, and the SI unit in words.

    `turns`: a frequency of revolutions, for which rpm are 1/60 s and rad/s are 1/(2π s).
    """

    powers: tuple[int, int, int, int]
    si: str
    turns: bool = False


NUMBER = Dimension((0, 0, 0, 0), "1")
MASS = Dimension((1, 0, 0, 0), "kg")
LENGTH = Dimension((0, 1, 0, 0), "m")
AREA = Dimension((0, 2, 0, 0), "m^2")
VOLUME = Dimension((0, 3, 0, 0), "m^3")
VOLUME_RATE = Dimension((0, 3, -1, 0), "m^3/s")
TIME = Dimension((0, 0, 1, 0), "s")
SPEED = Dimension((0, 1, -1, 0), "m/s")
SLOWNESS = Dimension((0, -1, 1, 0), "s/m")
ACCELERATION = Dimension((0, 1, -2, 0), "m/s^2")
DENSITY = Dimension((1, -3, 0, 0), "kg/m^3")
FORCE = Dimension((1, 1, -2, 0), "N")
INERTIA = Dimension((1, 2, 0, 0), "kg m^2")
ANGLE = Dimension((0, 0, 0, 1), "rad")
ANGULAR_VELOCITY = Dimension((0, 0, -1, 1), "rad/s")
PER_ANGLE = Dimension((0, 0, 0, -1), "1/rad")
REVOLUTIONS = Dimension((0, 0, -1, 0), "1/s", turns=True)


def in_si(value: Any, unit: str, dimension: Dimension, what: str) -> Any:
    """Numbers in SI units; raises ArgumentError for a unit that is not known or measures something else.

    Units per angle may leave the angle out, as N m s for N m s/rad. value: numbers, as lists of any depth.
    """
    factor, powers = unit_of(unit, what)
    expected = dimension.powers
    if dimension.turns and powers[3] == 1:
        factor, powers = factor / (2 * pi), (*powers[:3], 0)
    angle_left_out = powers[3] == 0 and expected[3] < 0
    angle_in_denominator = powers[3] < 0 and expected[3] == 0
    if powers[:3] != expected[:3] or not (powers[3] == expected[3] or angle_left_out or angle_in_denominator):
        raise ArgumentError(
            f'{what} measures {dimension.si}, but its unit is "{unit}": give a unit of that kind, such as '
            f'"{dimension.si}".'
        )
    return _times(value, factor)


def unit_of(unit: str, what: str) -> tuple[float, tuple[int, int, int, int]]:
    """The SI value and the powers of mass, length, time and angle of a unit; raises ArgumentError."""
    words = unit.translate(_SUPERSCRIPTS).replace("·", " ").replace("*", " ")
    above, *below = words.split("/")
    factor, powers = 1.0, [0, 0, 0, 0]
    parts = [(above, 1)] + [(part, -1) for part in below]
    for text, sign in parts:
        symbols = text.strip().strip("()").split()
        if not symbols:
            raise ArgumentError(f'{what} has the unit "{unit}", which is not complete; write it like "N s/m".')
        for symbol in symbols:
            size, inner = _symbol(symbol, unit, what)
            factor *= size**sign
            powers = [p + sign * q for p, q in zip(powers, inner, strict=True)]
    return factor, (powers[0], powers[1], powers[2], powers[3])


def _symbol(symbol: str, unit: str, what: str) -> tuple[float, list[int]]:
    found = _FACTOR.match(symbol)
    if found is None or found.group(1) not in _BASE:
        raise ArgumentError(
            f'{what} has the unit "{unit}", in which `{symbol}` is not known: known are {", ".join(_BASE)}, their '
            'products, quotients and powers, as in "kg m^2" or "N s/m".'
        )
    size, powers = _BASE[found.group(1)]
    power = int(found.group(2) or 1)
    return size**power, [power * p for p in powers]


def _times(value: Any, factor: float) -> Any:
    if isinstance(value, list):
        return [_times(inner, factor) for inner in value]
    return value * factor if factor != 1.0 else value
