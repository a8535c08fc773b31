"""Euler angles, unit quaternions and rotation vectors of an attitude, to set up runs and to draw them.

R takes body components to space components, v_space = R v_body. Everything is in radians and float64, NumPy in and
NumPy out. Euler angles are separate arguments, in the order of the function's name, that broadcast against each other;
vectors (..., 3), quaternions (..., 4) and matrices (..., 3, 3) have their own axes last. So `zyx(*zyx_angles(R))` is R
for one matrix and for a trajectory of them. Quaternions are scalar first, (w, x, y, z), and compose like matrices.
Angular velocities are the body's: ω̂ = RᵀṘ. Every function raises ArgumentError for an argument that is not finite, has
other last axes than documented, or does not broadcast with the others.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from coadjoint import checks
from coadjoint.errors import ArgumentError

SINGULAR = 1e-12
"""Up to this |sin θ| (ZXZ) or |cos pitch| (ZYX) the outer two axes count as one."""
UNIT = 1e-6
"""How far RᵀR may be from I and |q| from 1: room for drift and single precision, not for a wrong argument."""

Angles = tuple[np.ndarray, np.ndarray, np.ndarray]


@checks.known_arguments("co.attitude.zxz")
def zxz(psi: ArrayLike, theta: ArrayLike, phi: ArrayLike) -> np.ndarray:
    """The rotation matrix of ZXZ Euler angles, the convention of the paper's Table 2.

    R = R_z(ψ) R_x(θ) R_z(φ): precession ψ, nutation θ, spin φ.

    psi, theta, phi: (...) rad. Returns R (..., 3, 3).
    Source: Ono, Fiori & Peng (2025), Table 2. Its run has ψ = φ and does not show which of them is the outer angle.
    """
    psi, theta, phi = _broadcast(psi=psi, theta=theta, phi=phi)
    return _about(2, psi) @ _about(0, theta) @ _about(2, phi)


@checks.known_arguments("co.attitude.zyx")
def zyx(yaw: ArrayLike, pitch: ArrayLike, roll: ArrayLike) -> np.ndarray:
    """The rotation matrix of yaw, pitch and roll, the convention of ships, aircraft and underwater vehicles.

    R = R_z(yaw) R_y(pitch) R_x(roll).

    yaw, pitch, roll: (...) rad, in this order. Returns R (..., 3, 3).
    Source: Fossen (2011), Handbook of Marine Craft Hydrodynamics and Motion Control, §2.2.
    """
    yaw, pitch, roll = _broadcast(yaw=yaw, pitch=pitch, roll=roll)
    return _about(2, yaw) @ _about(1, pitch) @ _about(0, roll)


def zxz_angles(R: ArrayLike) -> Angles:
    """The ZXZ Euler angles (ψ, θ, φ) of a rotation matrix, with θ in [0, π], ψ and φ in [−π, π].

    φ = atan2(R₃₁, R₃₂), θ = atan2(√(R₃₁² + R₃₂²), R₃₃), and ψ from R R_z(φ)⁻¹ = R_z(ψ) R_x(θ).
    Where sin θ ≤ 1e-12 only ψ ± φ is determined: φ is 0 there, and ψ takes the complete turn.

    R: (..., 3, 3). Returns ψ, θ, φ, (...) rad each, which reproduce R. Raises ArgumentError unless R is a rotation.
    """
    R = _rotation(R)
    sine = np.hypot(R[..., 2, 0], R[..., 2, 1])
    phi = np.where(sine > SINGULAR, np.arctan2(R[..., 2, 0], R[..., 2, 1]), 0.0)
    theta = np.arctan2(sine, R[..., 2, 2])
    # ψ is read after φ is turned back, not from R₁₃ and R₂₃: near θ = 0 the errors of ψ and φ then cancel in R.
    x, y = (np.cos(phi) * R[..., k, 0] - np.sin(phi) * R[..., k, 1] for k in (0, 1))
    return np.arctan2(y, x), theta, phi


def zyx_angles(R: ArrayLike) -> Angles:
    """Yaw, pitch and roll of a rotation matrix, with pitch in [−π/2, π/2], yaw and roll in [−π, π].

    roll = atan2(R₃₂, R₃₃), pitch = atan2(−R₃₁, √(R₃₂² + R₃₃²)), and yaw from R R_x(roll)⁻¹ = R_z(yaw) R_y(pitch).
    In gimbal lock, cos pitch ≤ 1e-12, only yaw ∓ roll is determined: roll is 0 there, and yaw takes the complete turn.

    R: (..., 3, 3). Returns (...) rad each, which reproduce R. Raises ArgumentError unless R is a rotation matrix.
    """
    R = _rotation(R)
    cosine = np.hypot(R[..., 2, 1], R[..., 2, 2])
    roll = np.where(cosine > SINGULAR, np.arctan2(R[..., 2, 1], R[..., 2, 2]), 0.0)
    pitch = np.arctan2(0.0 - R[..., 2, 0], cosine)
    # As in zxz_angles; and 0 − x, not −x, because a negative zero would make a heading of π read −π.
    x, y = (np.cos(roll) * R[..., k, 1] - np.sin(roll) * R[..., k, 2] for k in (0, 1))
    return np.arctan2(0.0 - x, y), pitch, roll


def zxz_angular_velocity(psi: ArrayLike, theta: ArrayLike, phi: ArrayLike, rates: ArrayLike) -> np.ndarray:
    """The body's angular velocity from ZXZ Euler angles and their rates.

    ω = (ψ̇ sin θ sin φ + θ̇ cos φ, ψ̇ sin θ cos φ − θ̇ sin φ, ψ̇ cos θ + φ̇).

    psi, theta, phi: (...) rad; rates: (ψ̇, θ̇, φ̇), (..., 3) rad/s. Returns ω (..., 3) rad/s.
    """
    psi, theta, phi, psi_rate, theta_rate, phi_rate = _with_vector("rates", rates, psi=psi, theta=theta, phi=phi)
    across = psi_rate * np.sin(theta)
    first = across * np.sin(phi) + theta_rate * np.cos(phi)
    second = across * np.cos(phi) - theta_rate * np.sin(phi)
    third = psi_rate * np.cos(theta) + phi_rate
    return np.stack([first, second, third], axis=-1)


def zyx_angular_velocity(yaw: ArrayLike, pitch: ArrayLike, roll: ArrayLike, rates: ArrayLike) -> np.ndarray:
    """The body's angular velocity from yaw, pitch and roll and their rates.

    With rates (ẏ, ṗ, ṙ): ω = (ṙ − ẏ sin pitch, ẏ cos pitch sin roll + ṗ cos roll, ẏ cos pitch cos roll − ṗ sin roll).

    yaw, pitch, roll: (...) rad; rates: (..., 3) rad/s, in the same order. Returns ω (..., 3) rad/s.
    Source: Fossen (2011), §2.2, T_Θ⁻¹.
    """
    yaw, pitch, roll, yaw_rate, pitch_rate, roll_rate = _with_vector("rates", rates, yaw=yaw, pitch=pitch, roll=roll)
    across = yaw_rate * np.cos(pitch)
    first = roll_rate - yaw_rate * np.sin(pitch)
    second = across * np.sin(roll) + pitch_rate * np.cos(roll)
    third = across * np.cos(roll) - pitch_rate * np.sin(roll)
    return np.stack([first, second, third], axis=-1)


def zxz_rates(psi: ArrayLike, theta: ArrayLike, phi: ArrayLike, omega: ArrayLike) -> np.ndarray:
    """The rates of ZXZ Euler angles from the body's angular velocity.

    ψ̇ = (ω₁ sin φ + ω₂ cos φ)/sin θ, θ̇ = ω₁ cos φ − ω₂ sin φ, φ̇ = ω₃ − ψ̇ cos θ.

    psi, theta, phi: (...) rad; omega, returned rates: (..., 3) rad/s. Raises ArgumentError where |sin θ| ≤ 1e-12.
    """
    psi, theta, phi, first, second, third = _with_vector("omega", omega, psi=psi, theta=theta, phi=phi)
    sine = np.sin(theta)
    _refuse_singular("theta", "0 and π", "sin θ", sine)
    psi_rate = (first * np.sin(phi) + second * np.cos(phi)) / sine
    theta_rate = first * np.cos(phi) - second * np.sin(phi)
    return np.stack([psi_rate, theta_rate, third - psi_rate * np.cos(theta)], axis=-1)


def zyx_rates(yaw: ArrayLike, pitch: ArrayLike, roll: ArrayLike, omega: ArrayLike) -> np.ndarray:
    """The rates of yaw, pitch and roll from the body's angular velocity.

    ẏ = (ω₂ sin roll + ω₃ cos roll)/cos pitch, ṗ = ω₂ cos roll − ω₃ sin roll, ṙ = ω₁ + ẏ sin pitch.

    yaw, pitch, roll: (...) rad; omega, returned rates: (..., 3) rad/s. Raises ArgumentError where |cos pitch| ≤ 1e-12.
    Source: Fossen (2011), §2.2, T_Θ.
    """
    yaw, pitch, roll, first, second, third = _with_vector("omega", omega, yaw=yaw, pitch=pitch, roll=roll)
    cosine = np.cos(pitch)
    _refuse_singular("pitch", "±π/2", "cos pitch", cosine)
    yaw_rate = (second * np.sin(roll) + third * np.cos(roll)) / cosine
    pitch_rate = second * np.cos(roll) - third * np.sin(roll)
    return np.stack([yaw_rate, pitch_rate, first + yaw_rate * np.sin(pitch)], axis=-1)


def from_quaternion(quaternion: ArrayLike) -> np.ndarray:
    """The rotation matrix of a unit quaternion q = (w, x, y, z), the same for q and −q.

    R = I + 2 (w v̂ + v̂²)/|q|², v = (x, y, z).

    quaternion: (..., 4), scalar first. Returns R (..., 3, 3). Raises ArgumentError unless |q| = 1 ± 1e-6.
    """
    w, x, y, z = np.moveaxis(_unit_quaternion(quaternion), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def to_quaternion(R: ArrayLike) -> np.ndarray:
    """The unit quaternion q = (w, x, y, z) of a rotation matrix, with w ≥ 0.

    4 q qᵀ is linear in R; q is its row with the largest diagonal entry, scaled to length 1, so no rotation
    loses digits. At w = 0, angle π, the largest of x, y, z is positive, the first among equals.

    R: (..., 3, 3). Returns q (..., 4), scalar first. Raises ArgumentError unless R is a rotation matrix.
    Source: Shepperd (1978), Quaternion from rotation matrix, J. Guidance and Control 1(3), 223–224.
    """
    R = _rotation(R)
    square = np.empty((*R.shape[:-2], 4, 4))
    square[..., 1:, 1:] = R + np.swapaxes(R, -1, -2)
    diagonal = np.moveaxis(np.diagonal(R, axis1=-2, axis2=-1), -1, 0)
    square[..., 0, 0] = 1 + diagonal[0] + diagonal[1] + diagonal[2]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        square[..., i + 1, i + 1] = 1 + diagonal[i] - diagonal[j] - diagonal[k]
        square[..., 0, i + 1] = square[..., i + 1, 0] = R[..., k, j] - R[..., j, k]
    largest = np.argmax(np.diagonal(square, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(square, largest[..., None, None], axis=-2)[..., 0, :]
    return np.where(q[..., :1] < 0, -q, q) / np.linalg.norm(q, axis=-1, keepdims=True)


def quaternion_rates(quaternion: ArrayLike, omega: ArrayLike) -> np.ndarray:
    """The rate of a unit quaternion from the body's angular velocity; it has no singular attitude.

    q̇ = ½ q ∘ (0, ω) = ½ (−v·ω, w ω + v × ω), v = (x, y, z).

    quaternion: (..., 4); omega: (..., 3) rad/s. Returns q̇ (..., 4) in 1/s. Raises ArgumentError unless |q| = 1 ± 1e-6.
    """
    q, omega = _unit_quaternion(quaternion), _finite("omega", omega, 3)
    _broadcast(quaternion=q[..., 0], omega=omega[..., 0])  # only to refuse what does not
    w, v = q[..., :1], q[..., 1:]
    scalar = -np.sum(v * omega, axis=-1, keepdims=True)
    return 0.5 * np.concatenate([scalar, w * omega + np.cross(v, omega)], axis=-1)


def quaternion_angular_velocity(quaternion: ArrayLike, rates: ArrayLike) -> np.ndarray:
    """The body's angular velocity from a unit quaternion and its rate.

    (0, ω) = 2 q̄ ∘ q̇, so ω = 2 (w v̇ − ẇ v − v × v̇); a part of q̇ along q, which changes |q| only, drops out.

    quaternion: (..., 4); rates: (..., 4) in 1/s. Returns ω (..., 3) rad/s. Raises ArgumentError unless |q| = 1 ± 1e-6.
    """
    q, rates = _unit_quaternion(quaternion), _finite("rates", rates, 4)
    _broadcast(quaternion=q[..., 0], rates=rates[..., 0])  # only to refuse what does not
    w, v, w_rate, v_rate = q[..., :1], q[..., 1:], rates[..., :1], rates[..., 1:]
    return 2 * (w * v_rate - w_rate * v - np.cross(v, v_rate))


def from_rotation_vector(vector: ArrayLike) -> np.ndarray:
    """The rotation by |u| about u, the exponential of û.

    R = exp(û), through q = (cos |u|/2, sin(|u|/2) u/|u|), without loss for small |u|.

    vector: u (..., 3) rad. Returns R (..., 3, 3).
    """
    u = _finite("vector", vector, 3)
    angle = np.linalg.norm(u, axis=-1, keepdims=True)
    return from_quaternion(np.concatenate([np.cos(angle / 2), 0.5 * np.sinc(angle / (2 * np.pi)) * u], axis=-1))


def rotation_vector(R: ArrayLike) -> np.ndarray:
    """The rotation vector u of a rotation matrix, R = exp(û), with |u| in [0, π].

    u = 2 atan2(|v|, w) v/|v|, (w, v) = to_quaternion(R), which also fixes the sign at |u| = π, where u and −u agree.

    R: (..., 3, 3). Returns u (..., 3) rad. Raises ArgumentError unless R is a rotation matrix.
    """
    w, v = np.split(to_quaternion(R), [1], axis=-1)
    sine = np.linalg.norm(v, axis=-1, keepdims=True)
    return 2 * v * np.where(sine > 0, np.arctan2(sine, w) / np.where(sine > 0, sine, 1.0), 1.0)


def _about(axis: int, angle: np.ndarray) -> np.ndarray:
    """The rotation matrix about a coordinate axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.zeros((*angle.shape, 3, 3))
    R[..., axis, axis] = 1.0
    R[..., i, i] = R[..., j, j] = np.cos(angle)
    R[..., j, i], R[..., i, j] = np.sin(angle), -np.sin(angle)
    return R


def _finite(name: str, value: ArrayLike, *axes: int) -> np.ndarray:
    """`value` as a finite float64 array whose last axes are `axes`."""
    try:
        array = np.asarray(value)
        real = array.dtype.kind in "fiu" and not np.ma.is_masked(value)
    except Exception:
        array, real = np.zeros(()), False
    checks.expect(real, value, name, "real numbers, an angle in radians or an array")
    array = array.astype(np.float64)
    if array.shape[array.ndim - len(axes) :] != axes:
        raise ArgumentError(f"Argument `{name}` must have last axes {axes}, but its shape is {array.shape}.")
    if not np.all(np.isfinite(array)):
        raise ArgumentError(f"Argument `{name}` must be finite, but holds {array[~np.isfinite(array)][0]}.")
    return array


def _broadcast(**named: ArrayLike) -> list[np.ndarray]:
    """The arguments as finite float64 arrays, broadcast against each other."""
    arrays = [_finite(name, value) for name, value in named.items()]
    try:
        return list(np.broadcast_arrays(*arrays))
    except ValueError:
        names = ", ".join(f"`{name}`" for name in named)
        shapes = ", ".join(str(array.shape) for array in arrays)
        raise ArgumentError(f"Arguments {names} must broadcast, but their leading shapes are {shapes}.") from None


def _with_vector(name: str, vector: ArrayLike, **angles: ArrayLike) -> list[np.ndarray]:
    """The angles, then the three components of the vector that goes with them."""
    first, second, third = np.moveaxis(_finite(name, vector, 3), -1, 0)
    return [*_broadcast(**angles, **{name: first}), second, third]


def _rotation(R: ArrayLike) -> np.ndarray:
    """`R` as rotation matrices, refused where it is none."""
    array = _finite("R", R, 3, 3)
    must = "Argument `R` must be a rotation matrix of shape (3, 3)"
    a, b, c = np.moveaxis(array, (-2, -1), (0, 1))  # entry by entry: NumPy is slow on many small matrices
    upper = [(i, j) for i in range(3) for j in range(i, 3)]
    entries = (a[i] * a[j] + b[i] * b[j] + c[i] * c[j] - (i == j) for i, j in upper)
    defect = max(np.max(np.abs(entry), initial=0.0) for entry in entries)
    if defect > UNIT:
        raise ArgumentError(f"{must}, but RᵀR − I reaches {defect:.2g}; project it first.")
    minors = b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]
    if np.any(a[0] * minors[0] + a[1] * minors[1] + a[2] * minors[2] < 0):
        raise ArgumentError(f"{must}, but its determinant is −1; turn one of its axes round.")
    return array


def _unit_quaternion(quaternion: ArrayLike) -> np.ndarray:
    """`quaternion` as float64, scaled to length 1, refused where it is far from it."""
    array = _finite("quaternion", quaternion, 4)
    length = np.linalg.norm(array, axis=-1, keepdims=True)
    worst = length.flat[np.argmax(np.abs(length - 1))] if length.size else 1.0
    if abs(worst - 1) > UNIT:
        raise ArgumentError(f"Argument `quaternion` must have length 1, but has {worst:.6g}; divide it by that first.")
    return array / length


def _refuse_singular(name: str, where: str, formula: str, value: np.ndarray) -> None:
    """Euler rates do not exist where the outer two axes coincide."""
    if np.any(np.abs(value) <= SINGULAR):
        raise ArgumentError(
            f"Argument `{name}` must keep away from {where}, where Euler-angle rates are not determined, "
            f"but |{formula}| is {np.min(np.abs(value)):.2g}; use `quaternion_rates`."
        )
