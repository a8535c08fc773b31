"""The units of all files: a word such as "kg m^2", or the end of a name as in `speed_m_s`, as a number of SI units.

Revolutions and radians are separate dimensions: rpm is 1/60 rev/s, which is 2π/60 rad/s where an angular velocity is
expected.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from math import pi
from typing import TYPE_CHECKING, Any, NamedTuple

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError

if TYPE_CHECKING:
    import numpy as np

Powers = tuple[float, float, float, float, float, float]
"""Of mass, length, time, angle (rad), revolutions and electric current; halves are roots, as in rad/s/√Hz."""


class Dimension(NamedTuple):
    """The dimension of a number: its powers, its SI unit as files write it, and a word for it."""

    powers: Powers
    si: str
    word: str


NUMBER = Dimension((0, 0, 0, 0, 0, 0), "1", "number")
MASS = Dimension((1, 0, 0, 0, 0, 0), "kg", "mass")
LENGTH = Dimension((0, 1, 0, 0, 0, 0), "m", "length")
AREA = Dimension((0, 2, 0, 0, 0, 0), "m^2", "area")
VOLUME = Dimension((0, 3, 0, 0, 0, 0), "m^3", "volume")
VOLUME_RATE = Dimension((0, 3, -1, 0, 0, 0), "m^3/s", "volume flow")
TIME = Dimension((0, 0, 1, 0, 0, 0), "s", "time")
FREQUENCY = Dimension((0, 0, -1, 0, 0, 0), "1/s", "frequency")
SPEED = Dimension((0, 1, -1, 0, 0, 0), "m/s", "speed")
SLOWNESS = Dimension((0, -1, 1, 0, 0, 0), "s/m", "time per length")
ACCELERATION = Dimension((0, 1, -2, 0, 0, 0), "m/s^2", "acceleration")
DENSITY = Dimension((1, -3, 0, 0, 0, 0), "kg/m^3", "density")
FORCE = Dimension((1, 1, -2, 0, 0, 0), "N", "force")
TORQUE = Dimension((1, 2, -2, 0, 0, 0), "N m", "torque")
INERTIA = Dimension((1, 2, 0, 0, 0, 0), "kg m^2", "moment of inertia")
POWER = Dimension((1, 2, -3, 0, 0, 0), "W", "power")
ANGLE = Dimension((0, 0, 0, 1, 0, 0), "rad", "angle")
ANGULAR_VELOCITY = Dimension((0, 0, -1, 1, 0, 0), "rad/s", "angular velocity")
PER_ANGLE = Dimension((0, 0, 0, -1, 0, 0), "1/rad", "number per angle")
REVOLUTIONS = Dimension((0, 0, -1, 0, 1, 0), "1/s", "revolutions in a second")
VOLTAGE = Dimension((1, 2, -3, 0, 0, -1), "V", "voltage")
ELECTRIC_CURRENT = Dimension((0, 0, 0, 0, 0, 1), "A", "electric current")
RESISTANCE = Dimension((1, 2, -3, 0, 0, -2), "Ω", "electric resistance")

_DIMENSIONS = (
    NUMBER, MASS, LENGTH, AREA, VOLUME, VOLUME_RATE, TIME, FREQUENCY, SPEED, SLOWNESS, ACCELERATION, DENSITY, FORCE,
    TORQUE, INERTIA, POWER, ANGLE, ANGULAR_VELOCITY, PER_ANGLE, REVOLUTIONS, VOLTAGE, ELECTRIC_CURRENT,
    RESISTANCE,
)  # fmt: skip

_SYMBOLS: dict[str, tuple[float, Dimension]] = {
    "1": (1.0, NUMBER), "%": (0.01, NUMBER),
    "kg": (1.0, MASS), "g": (1e-3, MASS), "t": (1e3, MASS), "lb": (0.45359237, MASS),
    "m": (1.0, LENGTH), "mm": (1e-3, LENGTH), "µm": (1e-6, LENGTH), "cm": (1e-2, LENGTH), "km": (1e3, LENGTH),
    "nmi": (1852.0, LENGTH), "in": (0.0254, LENGTH), "ft": (0.3048, LENGTH),
    "L": (1e-3, VOLUME), "l": (1e-3, VOLUME), "mL": (1e-6, VOLUME), "ml": (1e-6, VOLUME),
    "s": (1.0, TIME), "ms": (1e-3, TIME), "µs": (1e-6, TIME), "us": (1e-6, TIME), "ns": (1e-9, TIME), "min": (60.0,
    TIME), "h": (3600.0, TIME), "days": (86400.0, TIME), "Hz": (1.0, FREQUENCY),
    "kn": (1852.0 / 3600.0, SPEED), "knots": (1852.0 / 3600.0, SPEED),
    "N": (1.0, FORCE), "kN": (1e3, FORCE), "kgf": (9.80665, FORCE), "lbf": (4.4482216152605, FORCE),
    "J": (1.0, TORQUE), "W": (1.0, POWER), "V": (1.0, VOLTAGE), "A": (1.0, ELECTRIC_CURRENT),
    "Ω": (1.0, RESISTANCE), "mΩ": (1e-3, RESISTANCE), "ohm": (1.0, RESISTANCE),
    "rad": (1.0, ANGLE), "deg": (pi / 180, ANGLE), "°": (pi / 180, ANGLE),
    "rev": (1.0, Dimension((0, 0, 0, 0, 1, 0), "rev", "revolutions")), "rpm": (1 / 60, REVOLUTIONS),
}  # fmt: skip
"""The SI value of each symbol, and its dimension."""

ENDINGS: dict[str, str] = {
    **{unit: unit for unit in ("s", "ms", "us", "ns", "min", "h", "days", "m", "mm", "cm", "km", "ft", "nmi")},
    **{unit.replace("/", joint): unit for joint in ("_", "_per_") for unit in ("m/s", "cm/s", "rad/s", "deg/s")},
    **{unit: unit for unit in ("rad", "deg", "rpm", "kg", "g", "t", "N", "kN", "W", "V", "A", "kn", "knots")},
    "km_per_h": "km/h", "per_s": "1/s", "1_s": "1/s", "m3": "m^3", "l": "L", "Nm": "N m", "J": "J", "percent": "%",
}  # fmt: skip
"""The ends of the names of keys and columns, and their units."""

_LONGEST_FIRST = sorted(ENDINGS, key=len, reverse=True)
_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻μ", "0123456789-µ")  # and the Greek letter as the sign of micro
_FACTOR = re.compile(r"^(√?)([A-Za-zµΩ°%]+|1)(?:\^?(-?\d))?$")
_ROOT = re.compile(r"sqrt\(([A-Za-zµΩ]+)\)")


def per_root(dimension: Dimension, unit: str) -> Dimension:
    """What a number of a dimension for each root of a frequency or a time measures: per_root(SPEED, "Hz") is m/s/√Hz.

    unit: "Hz", of the density of a noise, or "s", of a random walk.
    """
    powers, half = list(dimension.powers), 0.5 if unit == "Hz" else -0.5
    powers[2] += half
    word = "density of the noise of" if unit == "Hz" else "random walk of"
    return Dimension(tuple(powers), f"{dimension.si}/√{unit}", f"{word} {dimension.word}")  # pyright: ignore[reportArgumentType]


def unit_of(unit: str, what: str = "This") -> tuple[float, Powers]:
    """The SI value and the powers of a unit; raises ArgumentError, which begins with `what`."""
    plain = _ROOT.sub(r"√\1", unit.translate(_SUPERSCRIPTS))
    above, *below = plain.replace("·", " ").replace("*", " ").split("/")
    factor, powers = 1.0, NUMBER.powers
    for text, sign in [(above, 1), *((part, -1) for part in below)]:
        symbols = text.strip().strip("()").split()
        if not symbols:
            raise ArgumentError(f'{what} has the unit "{unit}", which is not complete; write it like "N s/m".')
        for symbol in symbols:
            found = _FACTOR.match(symbol)
            if found is None or found.group(2) not in _SYMBOLS:
                raise ArgumentError(
                    f'{what} has the unit "{unit}", in which `{symbol}` is not known: known are {", ".join(_SYMBOLS)}, '
                    'their products, quotients and powers, as in "kg m^2" or "N s/m".'
                )
            size, dimension = _SYMBOLS[found.group(2)]
            power = sign * int(found.group(3) or 1) * (0.5 if found.group(1) else 1)
            factor *= size**power
            powers = tuple(p + power * q for p, q in zip(powers, dimension.powers, strict=True))
    return factor, powers  # pyright: ignore[reportReturnType]


def same(one: str, other: str) -> bool:
    """Whether two words mean one unit, as "us" and "µs" do."""
    try:
        return one == other or unit_of(one) == unit_of(other)
    except ArgumentError:
        return False


def dimension_of(unit: str) -> Dimension:
    """The dimension of a unit, by name where it has one."""
    powers = unit_of(unit)[1]
    named = next((dimension for dimension in _DIMENSIONS if dimension.powers == powers), None)
    return named or Dimension(powers, unit, unit)


def factor_to(dimension: Dimension, unit: str, what: str) -> float:
    """How many SI units of a dimension a unit is; raises ArgumentError, which begins with `what`, for another kind.

    A revolution is 2π rad. Units per angle, and of revolutions, may leave the angle out: N m s for N m s/rad, and Hz or
    1/s for rev/s.
    """
    factor, given = unit_of(unit, what)
    wanted, turned, turns = dimension.powers, given[3] + given[4], dimension.powers[3] + dimension.powers[4]
    left_out = (turned == 0 and (wanted[4] != 0 or wanted[3] < 0)) or (turns == 0 and given[3] <= 0)
    if given[:3] + given[5:] != wanted[:3] + wanted[5:] or not (turned == turns or left_out):
        raise ArgumentError(
            f'{what} measures {dimension.si}, but its unit is "{unit}": give a unit of that kind, such as '
            f'"{dimension.si}".'
        )
    return factor if left_out else factor * (2 * pi) ** (given[4] - wanted[4])


def ending(unit: str) -> str:
    """The end of a name for a unit, as `_m_s`; angles are written in degrees; empty where none is known."""
    wanted = unit_of("deg" if unit == "rad" else unit)
    return next((f"_{end}" for end, word in ENDINGS.items() if unit_of(word) == wanted), "")


def in_si(value: object, unit: str, dimension: Dimension, what: str) -> PyTree:
    """Numbers in SI units; raises ArgumentError as `factor_to`. value: numbers, as lists of any depth."""
    return times(value, factor_to(dimension, unit, what))


def times(value: Any, factor: float) -> PyTree:
    """Numbers, as lists of any depth, by a factor."""
    if isinstance(value, list):
        return [times(inner, factor) for inner in value]
    return value * factor if factor != 1.0 else value


def jumps_by_degrees(angles: np.ndarray) -> bool:
    """Whether angles (n, …), which are given as rad, jump from one to the next by a turn of 360, within 30.

    Degrees do that where they are wrapped to one turn. Radians jump by 2π at most where they are wrapped to one, and by
    less than π where they count turns: only a count that is reset from 52 to 62 turns would be taken for degrees.
    Degrees that never cross the cut are not seen.
    """
    return bool((abs(abs(angles[1:] - angles[:-1]) - 360.0) < 30.0).any())


def split_name(name: str, known: Collection[str] | None = None) -> tuple[str, str]:
    """A name without the unit at its end, and that unit: ("speed", "m/s") of `speed_m_s`; "" where it has none.

    known: the existing names, if known; a name among them has no unit at its end.
    """
    if known is not None and name in known:
        return name, ""
    for ending in _LONGEST_FIRST:
        bare = name.removesuffix(f"_{ending}")
        if bare not in (name, "") and (known is None or bare in known):
            return bare, ENDINGS[ending]
    return name, ""
