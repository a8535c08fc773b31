"""Force curves by name and by kind."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from coadjoint.errors import ArgumentError
from coadjoint_vehicles.parts.force_curves import CURVES, ForceCurve, Table
from coadjoint_vehicles.parts.supplied_curve import Supplied

KGF = 9.80665
"""N in a kilogram-force."""

_T200 = [
    (1100, -4.07),
    (1144, -3.59),
    (1208, -2.58),
    (1324, -1.16),
    (1444, -0.15),
    (1468, -0.04),
    (1472, 0.0),
    (1528, 0.0),
    (1532, 0.04),
    (1592, 0.51),
    (1692, 1.69),
    (1800, 3.42),
    (1868, 4.79),
    (1896, 5.22),
    (1900, 5.25),
]
T200 = Table([float(u) for u, _ in _T200], [KGF * F for _, F in _T200])
"""Blue Robotics T200 at 16 V, at bollard: pulse width, µs, to N.

15 of the 201 rows (µs, kgf) in uf-mil/mil2, subjugator_thruster_manager/lut.h, measured by Blue Robotics (*T200 Public
Performance Data 10–20 V*, September 2019); that they are those of 16 V is by ten of them, the ends 5.25 and −4.07 kgf
among them, which other public code names so. No licence is stated: they are numbers of a data sheet. Straight lines
between the 15 miss none of the others by more than 0.5 N.
"""

PUBLISHED = {"T200": T200}
"""Curves that may be given by name."""


def force_curve(given: Any, name: str) -> ForceCurve:
    """The curve of the part `name`: itself, the name of a published one, or a dictionary of one kind and its numbers.

    {"linear": s}, {"quadratic": k}, {"quadratic": (k₊, k₋)}, {"polynomial": (c_1, …)}, {"table": [(u, F), …]}, "T200",
    or {"published": "T200", "voltage": V₀, "resistance": R}, as `Supplied`. Raises ArgumentError.
    """
    if isinstance(given, ForceCurve):
        return given
    if isinstance(given, str) and given in PUBLISHED:
        return PUBLISHED[given]
    if isinstance(given, Mapping) and "published" in given:
        return _supplied(given, name)
    if not isinstance(given, Mapping) or len(given) != 1 or next(iter(given)) not in CURVES:
        raise ArgumentError(
            f"The force curve of `{name}` must be one of {', '.join(CURVES)}, as in {{'linear': 40.0}}, or of the "
            f"published {', '.join(PUBLISHED)}, or at a voltage, {{'published': 'T200', 'voltage': 14.8}}, but is "
            f"{given!r}."
        )
    ((kind, numbers),) = given.items()
    try:
        return CURVES[kind].of(numbers)
    except ArgumentError as error:
        raise ArgumentError(f"The force curve of `{name}`: {error}") from None
    except (TypeError, ValueError):
        raise ArgumentError(f"The {kind} force curve of `{name}` cannot be made of {numbers!r}.") from None


def _supplied(given: Mapping[str, Any], name: str) -> Supplied:
    """The curve of a data sheet at a voltage; raises ArgumentError."""
    try:
        return Supplied(**given)
    except TypeError:
        raise ArgumentError(
            f"The force curve of `{name}` by a data sheet must have `published`, `voltage` (V) and, if it sags, "
            f"`resistance` (Ω), but has {', '.join(map(str, given))}."
        ) from None
    except ArgumentError as error:
        raise ArgumentError(f"The force curve of `{name}`: {error}") from None
