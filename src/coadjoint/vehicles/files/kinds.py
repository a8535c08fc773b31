"""The kinds of parts and pilots in a vehicle file: their classes, what each field measures, and how it turns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from coadjoint import units as u
from coadjoint.units import Dimension
from coadjoint.vehicles import axes as border

Turn = Callable[[Any, Any], Any]


@dataclass(frozen=True)
class Field:
    """What a field measures; None where its numbers measure several things. `turn`: from other body axes to FRD."""

    dimension: Dimension | None
    turn: Turn | None = None


def _six(value: Any, axes: Any) -> Any:
    """A diagonal keeps its signs in other axes; a matrix turns."""
    return value if np.ndim(value) == 1 else border.twist_matrix(value, axes)


_PLACE, _WAY = Field(u.LENGTH, border.body_vector), Field(u.NUMBER, border.body_vector)
_MATRIX = Field(None, _six)
_LAG = {"lag": Field(u.TIME)}

PARTS: dict[str, tuple[str, dict[str, Field]]] = {
    "damping": (
        "damping:Damping",
        {"linear": _MATRIX, "quadratic": _MATRIX, "forward": _MATRIX, "fading": Field(u.SLOWNESS)},
    ),
    "hull": (
        "hull:Hull",
        {
            "axial_drag": Field(u.NUMBER),
            "axial_area": Field(u.AREA),
            "crossflow_drag": Field(u.NUMBER),
            "width": Field(u.LENGTH),
            "height": Field(u.LENGTH),
            "length": Field(u.LENGTH),
            "center": Field(u.LENGTH),
        },
    ),
    "fin": (
        "fin:Fin",
        {
            "position": _PLACE,
            "normal": _WAY,
            "area": Field(u.AREA),
            "lift_slope": Field(u.PER_ANGLE),
            "stall": Field(u.ANGLE),
            "drag": Field(u.NUMBER),
            "limit": Field(u.ANGLE),
            "rate": Field(u.ANGULAR_VELOCITY),
            **_LAG,
        },
    ),
    "propeller": (
        "propeller:Propeller",
        {
            "position": _PLACE,
            "axis": _WAY,
            "diameter": Field(u.LENGTH),
            "thrust": Field(u.NUMBER),
            "torque": Field(u.NUMBER),
            "thrust_deduction": Field(u.NUMBER),
            "wake_fraction": Field(u.NUMBER),
            "torque_fraction": Field(u.NUMBER),
            "limit": Field(u.REVOLUTIONS),
            **_LAG,
        },
    ),
    "moving_mass": (
        "moving_mass:MovingMass",
        {
            "mass": Field(u.MASS),
            "position": _PLACE,
            "axis": _WAY,
            "low": Field(u.LENGTH),
            "high": Field(u.LENGTH),
            "rate": Field(u.SPEED),
            **_LAG,
        },
    ),
    "ballast": (
        "ballast:Ballast",
        {
            "position": _PLACE,
            "low": Field(u.VOLUME),
            "high": Field(u.VOLUME),
            "rate": Field(u.VOLUME_RATE),
            **_LAG,
        },
    ),
    "lifting_body": (
        "lifting_body:LiftingBody",
        {key: Field(None) for key in ("drag", "lift", "pitch", "side", "roll", "yaw")},
    ),
}
"""By kind: "module:class" in the room of parts, and its fields. Thrusters and derivatives have readers of their own."""


def kind_of(made: Any) -> str:
    """The kind of a part or a pilot: the word for it in vehicle files."""
    homes = {**{kind: home for kind, (home, _) in PARTS.items()}, **PILOTS}
    home = f"{type(made).__module__.rpartition('.')[2]}:{type(made).__name__}"
    return next((kind for kind, known in homes.items() if known == home), type(made).__name__.lower())


def part_class(kind: str) -> type:
    """The class of a kind of part."""
    module, _, name = PARTS[kind][0].partition(":")
    return getattr(import_module(f"coadjoint.vehicles.parts.{module}"), name)


PILOTS: dict[str, str] = {
    "cruise": "cruise:Cruise",
    "attitude": "attitude:Attitude",
    "hover": "hover:Hover",
    "manoeuvre": "hover:Manoeuvre",
    "pose": "hover:Pose",
    "sawtooth": "sawtooth:Sawtooth",
}
"""By kind: "module:class" in the room of pilots."""

PILOT_FIELDS: dict[str, Dimension] = {
    "period": u.TIME,
    "delay": u.TIME,
    "speed": u.SPEED,
    "bottom": u.LENGTH,
    **dict.fromkeys(("pitch_limit", "fin_limit", "roll_limit", "pitch_reach", "heading_reach"), u.ANGLE),
    **dict.fromkeys(("look_ahead", "acceptance", "reach", "middle", "shift"), u.LENGTH),
    **dict.fromkeys(("volume", "neutral"), u.VOLUME),
    "pitch": u.ANGLE,
}
"""What fields of pilots measure; the others, such as gains, measure several things and have the unit "SI"."""


PILOT_WORDS: dict[str, tuple[str, ...]] = {"vertical": ("depth", "altitude", "pitch")}
"""Fields of pilots that hold a word, and which."""


def pilot_class(kind: str) -> type:
    """The class of a kind of pilot."""
    module, _, name = PILOTS[kind].partition(":")
    return getattr(import_module(f"coadjoint.vehicles.controllers.{module}"), name)
