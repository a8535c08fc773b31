"""Measured and simulated attitude as rotations: their difference along the body axes, and its derivatives.

δ = log(R_measuredᵀ R_simulated exp(b)), a vector of three in rad, for a bias b; where R_simulated turns by R ω dx, and
b by db, dδ = J_r(δ)⁻¹(exp(b)ᵀω dx + J_r(b) db) with the right Jacobian J_r of SO(3): Solà, Deray, Atchuthan (2018), A
micro Lie theory for state estimation in robotics, equations 143 and 144.
"""

from __future__ import annotations

import numpy as np

from coadjoint.groups import attitude

SMALL = 1e-4
"""Angles below which series are taken."""

REVERSED = -0.99
"""The cosine of angles from which on logarithms are taken by quaternions."""


def hat(v: np.ndarray) -> np.ndarray:
    """(…, 3) ↦ (…, 3, 3), the matrix of v ×."""
    x, y, z = np.moveaxis(v, -1, 0)
    zero = np.zeros_like(x)
    rows = [np.stack(row, axis=-1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))]
    return np.stack(rows, axis=-2)


def vee(M: np.ndarray) -> np.ndarray:
    """The vector of the antisymmetric part of M."""
    parts = M[..., 2, 1] - M[..., 1, 2], M[..., 0, 2] - M[..., 2, 0], M[..., 1, 0] - M[..., 0, 1]
    return 0.5 * np.stack(parts, axis=-1)


def log(R: np.ndarray) -> np.ndarray:
    """The rotation vectors of rotation matrices, of angles up to π; at π one of both.

    From half a turn on nearly, where the antisymmetric part of R loses digits, the axis is the row of the quaternion's
    4 q qᵀ with the largest diagonal entry: Shepperd (1978).
    """
    s = vee(R)
    sine, cosine = np.linalg.norm(s, axis=-1), 0.5 * (np.trace(R, axis1=-2, axis2=-1) - 1)
    angle = np.arctan2(sine, cosine)
    factor = np.where(sine > SMALL, angle / np.where(sine > SMALL, sine, 1.0), 1 + sine**2 / 6)
    found = factor[..., None] * s
    far = cosine < REVERSED
    if np.any(far):
        q = attitude.to_quaternion(R[far])
        length = np.linalg.norm(q[..., 1:], axis=-1)
        found[far] = (2 * np.arctan2(length, q[..., 0]) / length)[..., None] * q[..., 1:]
    return found


def right_jacobian(v: np.ndarray) -> np.ndarray:
    """J_r(v) = 1 − (1 − cos θ)/θ² v̂ + (θ − sin θ)/θ³ v̂², (3, 3) of one v."""
    angle, V = float(np.linalg.norm(v)), hat(v)
    if angle < SMALL:
        return np.eye(3) - 0.5 * V
    return np.eye(3) - (1 - np.cos(angle)) / angle**2 * V + (angle - np.sin(angle)) / angle**3 * V @ V


def right_jacobian_inverse(v: np.ndarray) -> np.ndarray:
    """J_r(v)⁻¹ = 1 + ½ v̂ + (1/θ² − (1 + cos θ)/(2θ sin θ)) v̂², (…, 3, 3)."""
    angle, V = np.linalg.norm(v, axis=-1)[..., None, None], hat(v)
    safe = np.where(angle > SMALL, angle, 1.0)
    factor = np.where(angle > SMALL, 1 / safe**2 - 0.5 / (safe * np.tan(safe / 2)), 1 / 12)
    return np.eye(3) + 0.5 * V + factor * V @ V


def exponential(v: np.ndarray) -> np.ndarray:
    """exp of one rotation vector."""
    angle, V = float(np.linalg.norm(v)), hat(v)
    if angle < SMALL:
        return np.eye(3) + V + 0.5 * V @ V
    return np.eye(3) + np.sin(angle) / angle * V + (1 - np.cos(angle)) / angle**2 * V @ V


def measured(roll: np.ndarray, pitch: np.ndarray, heading: np.ndarray) -> np.ndarray:
    """R of Euler angles ZYX, (…, 3, 3)."""
    flat = attitude.zyx(heading.reshape(-1), pitch.reshape(-1), roll.reshape(-1))
    return np.asarray(flat).reshape(*roll.shape, 3, 3)


def difference(measured: np.ndarray, simulated: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """δ, (…, 3), of matrices (…, 3, 3)."""
    return log(measured.swapaxes(-1, -2) @ simulated @ exponential(bias))


def slopes(off: np.ndarray, simulated: np.ndarray, along: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """dδ, (segments, samples, columns, 3): `off` δ, `simulated` R, `along` dR as (segments, samples, columns, 9)."""
    turned = along.reshape(*along.shape[:-1], 3, 3)
    omega = vee(simulated.swapaxes(-1, -2)[:, :, None] @ turned)
    return np.einsum("snij,jk,snck->snci", right_jacobian_inverse(off), exponential(bias).T, omega)


def slopes_of_bias(off: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """∂δ/∂b, (segments, samples, 3 of b, 3 of δ)."""
    return (right_jacobian_inverse(off) @ right_jacobian(bias)).swapaxes(-1, -2)
