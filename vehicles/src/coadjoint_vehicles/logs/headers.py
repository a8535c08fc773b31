"""Headers of a log's columns: a name and a unit, as in `roll_deg`, `u_m_s`, `heading [deg]`, `thrusters[1]_N`."""

from __future__ import annotations

import re
from typing import NamedTuple

from coadjoint import units as u
from coadjoint.errors import ArgumentError, FileError, nearest
from coadjoint.units import ENDINGS, Dimension, dimension_of, same, split_name, unit_of

NAMES: dict[str, Dimension] = {
    **dict.fromkeys(("north", "east", "depth", "up", "down", "x", "y", "z"), u.LENGTH), "time": u.TIME,
    **dict.fromkeys(("roll", "pitch", "heading", "yaw"), u.ANGLE), **dict.fromkeys(("qw", "qx", "qy", "qz"), u.NUMBER),
    **dict.fromkeys(("u", "v", "w"), u.SPEED), **dict.fromkeys(("p", "q", "r"), u.ANGULAR_VELOCITY),
}  # fmt: skip
"""The dimensions of columns by name; all other columns are inputs."""

PULSES = "us"
"""The unit of a command by the width of a pulse, which is not converted."""
_TIMES = ("t", "timestamp", "stamp")


class Column(NamedTuple):
    """A header: the name, the SI unit inside ("" if the header has none), and the factor to it."""

    header: str
    name: str
    unit: str
    factor: float


def inside(unit: str, name: str = "") -> tuple[str, float]:
    """The SI unit that numbers in a unit have inside, and the factor to it: ("m³", 0.001) of "L".

    Microseconds are those of the width of a pulse, except of the column `name` "time".
    """
    if same(unit, PULSES):
        return ("s", 1e-6) if name == "time" else (PULSES, 1.0)
    return dimension_of(unit).si.replace("^2", "²").replace("^3", "³"), unit_of(unit)[0]


def loose(header: str) -> Column:
    """The column of a header that may have no unit."""
    name, unit = split_name(header)
    return Column(header, name, *(inside(unit, name) if unit else ("", 1.0)))


def column(header: str, where: str) -> Column:
    """The column of a header; raises FileError, which begins with `where`, for units that are not known."""
    text = header.strip()
    match = re.fullmatch(r"(.+?)\s*[\[(]\s*([^\d\s\])][^\])]*)[\])]", text)
    name, unit = (match[1].strip(), match[2].strip()) if match else split_name(text)
    name = "time" if name.lower() in _TIMES else name.replace(" ", "_").replace("-", "_")
    quantity = name if name in NAMES else next((known for known in NAMES if name.startswith(f"{known}_")), None)
    measured = NAMES.get(quantity or "")
    if not unit and NAMES.get(name, u.NUMBER) == u.NUMBER and (quantity is None or name in NAMES):
        unit = "1"
    try:
        kind, factor = inside(ENDINGS.get(unit, unit), name)
    except ArgumentError:
        tail = unit or name.removeprefix(f"{quantity}_")
        likely = [end for end, word in ENDINGS.items() if measured in (None, dimension_of(word))]
        near = nearest(tail, likely, 0.4 if measured else 0.0) or likely[0]
        raise FileError(
            f"{where} `{header}` has no known unit at its end: give one, as in `{quantity or name}_{near}`."
        ) from None
    if name in NAMES and NAMES[name].si != kind:
        raise FileError(f"{where} `{header}` is in {kind}, but `{name}` is measured in {NAMES[name].si}.")
    return Column(header, name, kind, factor)
