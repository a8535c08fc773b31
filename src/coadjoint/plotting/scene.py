"""The scene of a player: bodies that move in space, with moving parts and their surroundings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.groups.attitude import to_quaternion
from coadjoint.texts import Table

POINTS = 8000
"""The most nodes of a scene, of all members together."""

Shape = Mapping[str, Any]
"""The shape of a body or a part, in the axes of the body, m: `kind` and its sizes.

box (size), ellipsoid (axes: its semi-axes), rod (from, to, radius), torpedo (length, diameter), mesh (vertices, faces),
plate (chord, span), blades, duct and jet (diameter). `at`: where its middle is; `axis`: where its x axis points, and
`span_axis` its y axis; `dim`: in grey.
"""


@dataclass(frozen=True)
class Moving:
    """A part that moves on its body.

    shape: that at rest. at, axis, span_axis: (3,), its place, and the directions of its x axis and y axis. motion:
    "hinge", by the angle `values` about the y axis; "spin", about the x axis; "slide", by m along the x axis; "push",
    a jet against the x axis of `reach` m times `values`. values: (nodes,).
    """

    shape: Shape
    at: Sequence[float]
    axis: Sequence[float]
    motion: str
    values: np.ndarray
    span_axis: Sequence[float] | None = None
    reach: float = 1.0


@dataclass(frozen=True)
class DrawnBody:
    """A body: its shapes, its place (nodes, 3) m, and its attitude as quaternions (nodes, 4), x, y, z, w.

    size: how long it is, m. track: whether its path is drawn.
    """

    shapes: Sequence[Shape]
    place: np.ndarray
    turn: np.ndarray
    size: float
    moving: Sequence[Moving] = ()
    track: bool = True


@dataclass(frozen=True)
class Readout:
    """A displayed quantity, (nodes,); one that wraps, as a heading does, is not averaged."""

    name: str
    unit: str
    values: np.ndarray
    digits: int = 2
    wraps: bool = False


@dataclass(frozen=True)
class Member:
    """A run, or a member of an ensemble: its label, colour, times (nodes,) s, bodies and readings.

    current: the velocity of the water where its first body is, (nodes, 3) m/s, None where there is none.
    """

    label: str
    colour: str
    time: np.ndarray
    bodies: Sequence[DrawnBody]
    readings: Sequence[Readout] = ()
    current: np.ndarray | None = None


@dataclass(frozen=True)
class Scene:
    """The complete scene. down: whether the third axis of space points down. surface: whether z = 0 is that of water.

    bottom: its depth, m. way_points: (k, 3) m. follow: the number of the member that the camera follows at first, −1
    for all. enlarge: whether bodies are drawn larger where they would be dots. pivot: (3,) m, the point about which the
    first body turns, None where it moves. frames: whether the axes of space and of the bodies are drawn at first.
    description: the text for readers who cannot see it.
    """

    title: str
    description: str
    members: Sequence[Member]
    down: bool = False
    surface: bool = False
    bottom: float | None = None
    way_points: np.ndarray | None = None
    follow: int = -1
    enlarge: bool = False
    pivot: Sequence[float] | None = None
    frames: bool = False


_DIGITS = {"time": 4, "turn": 5, "values": 4}


def plain(scene: Scene) -> Table:
    """The scene as numbers, texts and lists, under the names that the page reads."""
    found = {name: _plain(name, value) for name, value in asdict(scene).items()}
    points = found.pop("way_points")
    return {**found, "wayPoints": [] if points is None else points}


def _plain(name: str, value: object) -> PyTree:
    if isinstance(value, np.ndarray):
        full = name in ("vertices", "faces", "current")
        digits = _DIGITS.get(name, _digits(value))
        return np.round(value.T if name == "current" else value, 6 if full else digits).tolist()
    if isinstance(value, Mapping):
        return {key: _plain(key, inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(name, inner) for inner in value]
    return value.item() if isinstance(value, np.generic) else value


def _digits(values: np.ndarray) -> int:
    """Decimals for a part in 10⁵ of the range of values."""
    span = float(np.ptp(values)) if values.size else 0.0
    return int(np.clip(np.ceil(5 - np.log10(span)), 0, 12)) if span > 0 else 6


def quaternions(rotations: np.ndarray) -> np.ndarray:
    """Unit quaternions x, y, z, w, (nodes, 4), of rotation matrices (nodes, 3, 3), without jumps of sign."""
    found = np.roll(to_quaternion(rotations), -1, axis=-1)
    turns = np.sum(found[1:] * found[:-1], axis=1) < 0
    found[1:] *= np.where(np.cumsum(turns) % 2, -1.0, 1.0)[:, None]
    return found
