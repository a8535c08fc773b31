"""The state of an inertial unit, as users give and receive it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.estimation.drifts import finite

SHAPES = {"t": (), "rotation": (3, 3)}
"""The shapes of the parts that are not (3,)."""


class InertialState(NamedTuple):
    """The state of an inertial unit; space axes north, east, down.

    t: s. rotation: R, (3, 3), from the axes of the body to space. velocity, position: v (3,) m/s and q (3,) m of the
    unit, in space. gyroscope_bias: b_g, (3,) rad/s, accelerometer_bias: b_a, (3,) m/s², in the axes of the unit.
    current: c, (3,) m/s, in space, the velocity of the water. By default 0 each, and R = 1.
    """

    t: Any = 0.0
    rotation: Any = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    velocity: Any = (0.0, 0.0, 0.0)
    position: PyTree = (0.0, 0.0, 0.0)
    gyroscope_bias: Any = (0.0, 0.0, 0.0)
    accelerometer_bias: Any = (0.0, 0.0, 0.0)
    current: Any = (0.0, 0.0, 0.0)


def parts_of(state: InertialState) -> dict[str, np.ndarray]:
    """The parts of one state by their names; raises ArgumentError unless they are finite numbers of their shapes."""
    parts = {name: vector(part, name, SHAPES.get(name, (3,)), "an InertialState") for name, part in _named(state)}
    R = parts["rotation"]
    if np.max(np.abs(R @ R.T - np.eye(3))) > 1e-6 or np.linalg.det(R) < 0:
        raise ArgumentError(f"`rotation` of an InertialState must be a rotation, but is {shown(R.tolist())}.")
    return parts


def one_by_one(states: InertialState) -> tuple[list[InertialState], tuple[int, ...]]:
    """States whose parts have axes of nodes, or are the same at all of them, each by itself, and these axes.

    Raises ArgumentError where the counts of nodes differ.
    """
    parts = {name: finite(part, name, "an InertialState") for name, part in _named(states)}
    inner = {name: part.shape[part.ndim - len(SHAPES.get(name, (3,))) :] for name, part in parts.items()}
    try:
        nodes = np.broadcast_shapes(*(part.shape[: part.ndim - len(inner[name])] for name, part in parts.items()))
        rows = [np.broadcast_to(part, nodes + inner[name]).reshape(-1, *inner[name]) for name, part in parts.items()]
    except ValueError:
        shapes = ", ".join(f"{name} {part.shape}" for name, part in parts.items())
        raise ArgumentError(f"The numbers of an InertialState have unlike counts of nodes: {shapes}.") from None
    return [InertialState(*one) for one in zip(*rows, strict=True)], nodes


def vector(value: object, name: str, shape: tuple[int, ...], whose: str) -> np.ndarray:
    """Finite numbers of a shape; raises ArgumentError with their name and owner for others."""
    found = finite(value, name, whose)
    checks.shape(found, f"`{name}` of {whose}", shape)
    return found


def _named(state: InertialState) -> list[tuple[str, PyTree]]:
    return list(zip(state._fields, state, strict=True))
