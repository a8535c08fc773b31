"""Numbers by which attitudes and directions are measured: quaternions of either order, Euler angles, bearings."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, Scalar
from coadjoint.groups.quaternions import UnitQuaternion
from coadjoint.groups.rotation_vector import quaternion


class Chart(NamedTuple):
    """Numbers of a rotation R (3, 3): their count, which are angles, and both ways; off: how wrong numbers (k, size)
    are, (k,)."""

    words: str
    size: int
    angles: np.ndarray
    element: Callable[[Array], Array]
    numbers: Callable[[Array], Array]
    off: Callable[[np.ndarray], np.ndarray]


def _of_quaternion(order: list[int]) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
    """R of a quaternion and back, whose numbers are w, x, y, z at these places."""
    back = np.argsort(order)

    def element(y: Array) -> Array:
        q = jnp.stack([y[i] for i in back])
        return UnitQuaternion().rotation(q / jnp.sqrt(q @ q))

    return element, lambda R: jnp.stack([quaternion(R)[i] for i in order])


def euler(roll: Scalar, pitch: Scalar, yaw: Scalar) -> Array:
    """R_z(yaw)R_y(pitch)R_x(roll), (3, 3), of angles in rad."""
    (a, b), (c, d), (e, f) = ((jnp.cos(angle), jnp.sin(angle)) for angle in (yaw, pitch, roll))
    rows = [
        [a * c, a * d * f - b * e, a * d * e + b * f],
        [b * c, b * d * f + a * e, b * d * e - a * f],
        [-d, c * f, c * e],
    ]
    return jnp.stack([jnp.stack(row) for row in rows])


def roll_pitch_yaw(R: Array) -> Array:
    """(roll, pitch, yaw), (3,) rad, of R (3, 3)."""
    across = jnp.sqrt(R[2, 1] ** 2 + R[2, 2] ** 2)
    return jnp.stack([jnp.arctan2(R[2, 1], R[2, 2]), jnp.arctan2(-R[2, 0], across), jnp.arctan2(R[1, 0], R[0, 0])])


def wrapped(angle: Array) -> Array:
    """The angle in [−π, π), of the shape given, rad."""
    return angle - 2 * np.pi * jnp.floor(angle / (2 * np.pi) + 0.5)


def _length(values: np.ndarray) -> np.ndarray:
    return np.abs(np.linalg.norm(values, axis=1) - 1)


def _nowhere(values: np.ndarray) -> np.ndarray:
    return np.zeros(len(values))


_FOUR, _THREE = np.zeros(4, bool), np.ones(3, bool)
CHARTS = {
    "wxyz": Chart("a unit quaternion (w, x, y, z)", 4, _FOUR, *_of_quaternion([0, 1, 2, 3]), _length),
    "xyzw": Chart("a unit quaternion (x, y, z, w)", 4, _FOUR, *_of_quaternion([1, 2, 3, 0]), _length),
    "zyx": Chart(
        "(yaw, pitch, roll)", 3, _THREE, lambda y: euler(y[2], y[1], y[0]), lambda R: roll_pitch_yaw(R)[::-1], _nowhere
    ),
    "rpy": Chart("(roll, pitch, yaw)", 3, _THREE, lambda y: euler(y[0], y[1], y[2]), roll_pitch_yaw, _nowhere),
}
"""By the words for `coordinates`."""


def along_bearing(y: Array) -> Array:
    """u = (cos ε cos b, cos ε sin b, −sin ε), (3,), of a bearing b from x to y and an elevation ε up, z down, rad."""
    c = jnp.cos(y[1])
    return jnp.stack([c * jnp.cos(y[0]), c * jnp.sin(y[0]), -jnp.sin(y[1])])


def bearing(u: Array) -> Array:
    """(b, ε), (2,) rad, of a direction u (3,)."""
    return jnp.stack([jnp.arctan2(u[1], u[0]), jnp.arctan2(-u[2], jnp.sqrt(u[0] ** 2 + u[1] ** 2))])


def bearing_frame(y: Array) -> Array:
    """Unit vectors along b and ε, (3, 2)."""
    (a, b), (c, d) = ((jnp.cos(angle), jnp.sin(angle)) for angle in (y[0], y[1]))
    return jnp.stack([jnp.stack([-b, a, jnp.zeros_like(a)]), jnp.stack([-d * a, -d * b, -c])], axis=1)
