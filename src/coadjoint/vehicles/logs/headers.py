"""Headers of a log's columns: a name and a unit, as in `roll_deg`, `u_m_s`, `heading [deg]`, `thrusters[1]_N`."""

from __future__ import annotations

import difflib
import re
from typing import NamedTuple

from coadjoint.errors import FileError
from coadjoint.vehicles.logs.columns import SUFFIXES

UNITS: dict[str, tuple[str, float]] = {
    **SUFFIXES,
    "ft": ("m", 0.3048), "kn": ("m/s", 1852 / 3600), "1_s": ("1/s", 1.0), "kN": ("N", 1e3), "us": ("us", 1.0),
    "A": ("A", 1.0), "W": ("W", 1.0), "percent": ("1", 1e-2), "1": ("1", 1.0),
}  # fmt: skip
"""The endings of headers: the unit inside, and how many of it they are."""

_LONGEST_FIRST = sorted((unit for unit in UNITS if unit != "1"), key=len, reverse=True)

NAMES: dict[str, str] = {
    "time": "s", "north": "m", "east": "m", "depth": "m", "up": "m", "down": "m", "x": "m", "y": "m", "z": "m",
    "roll": "rad", "pitch": "rad", "heading": "rad", "yaw": "rad",
    "qw": "1", "qx": "1", "qy": "1", "qz": "1",
    "u": "m/s", "v": "m/s", "w": "m/s", "p": "rad/s", "q": "rad/s", "r": "rad/s",
}  # fmt: skip
"""What columns of these names measure; all others are inputs."""

_TIMES = ("t", "timestamp", "stamp")


class Column(NamedTuple):
    """A header: the name, the unit inside, and the factor to it."""

    header: str
    name: str
    unit: str
    factor: float


def column(header: str, where: str) -> Column:
    """The column of a header; raises FileError, which begins with `where`, for units that are not known."""
    text = header.strip()
    match = re.fullmatch(r"(.+?)\s*[\[(]\s*([^\d\s\])][^\])]*)[\])]", text)
    if match:
        name, unit = match[1].strip(), match[2].strip().replace("/", "_").replace(" ", "_").replace("°", "deg")
    else:
        unit = next((unit for unit in _LONGEST_FIRST if text.endswith(f"_{unit}")), "")
        name = text[: -len(unit) - 1] if unit else text
    name = "time" if name.lower() in _TIMES else name.replace(" ", "_").replace("-", "_")
    quantity = name if name in NAMES else next((known for known in NAMES if name.startswith(f"{known}_")), None)
    if not unit and NAMES.get(name, "1") == "1":
        unit = "1" if quantity is None or name in NAMES else unit
    if unit not in UNITS:
        tail = unit or name.removeprefix(f"{quantity}_")
        kind = NAMES.get(quantity or "")
        likely = [unit for unit, (of, _) in UNITS.items() if kind in (None, of)]
        near = difflib.get_close_matches(tail, likely, 1, 0.4 if kind else 0.0) or likely
        raise FileError(
            f"{where} `{header}` has no known unit at its end: give one, as in `{quantity or name}_{near[0]}`."
        )
    kind, factor = UNITS[unit]
    if NAMES.get(name, kind) != kind:
        raise FileError(f"{where} `{header}` is in {kind}, but `{name}` is measured in {NAMES[name]}.")
    return Column(header, name, kind, factor)


def ending(unit: str) -> str:
    """The ending of a header for a unit inside: angles in degrees, all else as it is."""
    if unit == "rad":
        return "_deg"
    return next((f"_{end}" for end, (kind, factor) in UNITS.items() if kind == unit != "1" and factor == 1.0), "")
