"""Headers of a log's columns: a name and a unit, as in `roll_deg`, `u_m_s`, `heading [deg]`."""

from __future__ import annotations

import difflib
import re
from math import pi
from typing import NamedTuple

from coadjoint.errors import FileError

UNITS: dict[str, tuple[str, float]] = {
    "s": ("s", 1.0), "ms": ("s", 1e-3), "min": ("s", 60.0),
    "m": ("m", 1.0), "cm": ("m", 1e-2), "mm": ("m", 1e-3), "km": ("m", 1e3), "ft": ("m", 0.3048),
    "rad": ("rad", 1.0), "deg": ("rad", pi / 180),
    "m_s": ("m/s", 1.0), "cm_s": ("m/s", 1e-2), "kn": ("m/s", 1852 / 3600),
    "rad_s": ("rad/s", 1.0), "deg_s": ("rad/s", pi / 180),
    "1_s": ("1/s", 1.0), "rpm": ("1/s", 1 / 60),
    "N": ("N", 1.0), "kN": ("N", 1e3), "N_m": ("N m", 1.0), "m3": ("m³", 1.0), "l": ("m³", 1e-3), "kg": ("kg", 1.0),
    "V": ("V", 1.0), "A": ("A", 1.0), "W": ("W", 1.0), "us": ("µs", 1.0), "1": ("1", 1.0), "percent": ("1", 1e-2),
}  # fmt: skip
"""The endings of headers: the unit inside, and how many of it they are."""

_LONGEST_FIRST = sorted(UNITS, key=len, reverse=True)

NAMES: dict[str, str] = {
    "time": "s", "north": "m", "east": "m", "depth": "m", "up": "m", "down": "m", "x": "m", "y": "m", "z": "m",
    "roll": "rad", "pitch": "rad", "heading": "rad", "yaw": "rad",
    "qw": "1", "qx": "1", "qy": "1", "qz": "1",
    "u": "m/s", "v": "m/s", "w": "m/s", "p": "rad/s", "q": "rad/s", "r": "rad/s",
}  # fmt: skip
"""What columns of these names measure; all others are inputs."""

_BARE = ("qw", "qx", "qy", "qz")
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
    match = re.fullmatch(r"(.+?)\s*[\[(](.*)[\])]", text)
    if match:
        name, unit = match[1].strip(), match[2].strip().replace("/", "_").replace(" ", "_").replace("°", "deg")
        unit = unit or "1"
    else:
        unit = next((unit for unit in _LONGEST_FIRST if text.endswith(f"_{unit}")), "")
        name = text[: -len(unit) - 1] if unit else text
    name = "time" if name.lower() in _TIMES else name
    if not unit and name in _BARE:
        unit = "1"
    if unit not in UNITS:
        tail = unit or text.rpartition("_")[2]
        near = difflib.get_close_matches(tail, UNITS, 1, 0.0)[0]
        of = f", as in `{name.rpartition('_')[0] or name}_{near}`" if not match else f", such as {near}"
        raise FileError(f"{where} `{header}` has no known unit at its end: give one{of}; `_1` is a pure number.")
    kind, factor = UNITS[unit]
    name = name.replace(" ", "_").replace("-", "_")
    if NAMES.get(name, kind) != kind:
        raise FileError(f"{where} `{header}` is in {kind}, but `{name}` is measured in {NAMES[name]}.")
    return Column(header, name, kind, factor)


def ending(unit: str) -> str:
    """The ending of a header for a unit inside."""
    return next((end for end, (kind, factor) in UNITS.items() if kind == unit and factor == 1.0), "1")
