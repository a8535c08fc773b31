"""Axes at the border: inside, space is north, east, down and a body forward, starboard, down; others are turned here.

    NED/FRD  north, east, down; forward, starboard, down: ships, underwater vehicles, and this library
    ENU/FLU  east, north, up; forward, port, up: robotics (ROS REP 103), Gazebo

Both changes of axes are half turns, N about (1, 1, 0)/√2 in space and B about forward in the body, so each is its own
inverse: the functions below take from `axes` to NED/FRD, and from NED/FRD to `axes`, by the same formula.
"""

from __future__ import annotations

from typing import Any, Literal

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.extending import traced

Axes = Literal["NED/FRD", "ENU/FLU"]

_SPACE = {"NED/FRD": np.eye(3), "ENU/FLU": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])}
_BODY = {"NED/FRD": np.eye(3), "ENU/FLU": np.diag([1.0, -1.0, -1.0])}


def space_axes(axes: Axes) -> np.ndarray:
    """N, (3, 3), with v_NED = N v: (n, e, d) = (y, x, −z) for east, north, up; N = Nᵀ = N⁻¹, det N = 1."""
    return _known(axes, _SPACE)


def body_axes(axes: Axes) -> np.ndarray:
    """B, (3, 3), with v_FRD = B v: diag(1, −1, −1) for forward, port, up; B = Bᵀ = B⁻¹, det B = 1."""
    return _known(axes, _BODY)


def space_vector(vector: object, axes: Axes) -> Array:
    """N v of a position, velocity or current in space, (..., 3)."""
    return _array(vector, "vector", (3,)) @ space_axes(axes)


def body_vector(vector: object, axes: Axes) -> Array:
    """B v of a velocity, an angular velocity, a place, a force or a torque of the body, (..., 3).

    Angular velocities and torques turn like other vectors, because B is a rotation and no reflection.
    """
    return _array(vector, "vector", (3,)) @ body_axes(axes)


def body_tensor(tensor: object, axes: Axes) -> Array:
    """B J B of an inertia or of another matrix that takes body vectors to body vectors, (..., 3, 3)."""
    B = body_axes(axes)
    return B @ _array(tensor, "tensor", (3, 3)) @ B


def twist(both: object, axes: Axes) -> Array:
    """diag(B, B) (v, ω) of a velocity with an angular velocity, or of a force with a torque, (..., 6)."""
    return _array(both, "both", (6,)) @ np.kron(np.eye(2), body_axes(axes))


def twist_matrix(matrix: object, axes: Axes) -> Array:
    """T M T, T = diag(B, B), of an added mass or a damping matrix, (..., 6, 6), order surge ... yaw.

    An entry that couples one of surge and roll with one of the other four changes its sign, and no other does.
    """
    T = np.kron(np.eye(2), body_axes(axes))
    return T @ _array(matrix, "matrix", (6, 6)) @ T


def rotation(R: Array, axes: Axes) -> Array:
    """N R B of an attitude, (..., 3, 3), from the body to space."""
    return space_axes(axes) @ _array(R, "R", (3, 3)) @ body_axes(axes)


def euler_zyx(angles: object, axes: Axes) -> Array:
    """Yaw, pitch and roll, (..., 3) rad: (π/2 − yaw, −pitch, roll) between ENU/FLU and NED/FRD, yaw in (−π, π].

    N R_z(y)R_y(p)R_x(r) B = R_z(π/2 − y)R_y(−p)R_x(r), since N B = R_z(π/2) and B turns about x by π: a heading of
    north is a yaw of 0 in NED and of π/2 in ENU; nose up is a positive pitch in NED and a negative one in ENU.
    """
    given = _array(angles, "angles", (3,))
    if _known(axes, {"NED/FRD": True, "ENU/FLU": False}):
        return given
    xnp: object = jnp if traced(given) else np
    yaw = 0.5 * np.pi - given[..., 0]
    yaw = yaw - 2 * np.pi * xnp.ceil((yaw - np.pi) / (2 * np.pi))
    return xnp.stack([yaw, -given[..., 1], given[..., 2]], axis=-1)


def _known(axes: PyTree, table: dict[str, object]) -> Any:
    fits = isinstance(axes, str) and axes in table
    checks.expect(
        fits,
        axes,
        "axes",
        '"NED/FRD" (north, east, down; forward, starboard, down) or "ENU/FLU" (east, north, up; forward, port, up)',
    )
    return table[axes]


def _array(value: object, name: str, last: tuple[int, ...]) -> Array:
    return checks.array(value, name, f"(…, {', '.join(map(str, last))})")
