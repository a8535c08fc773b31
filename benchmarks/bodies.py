"""The rigid body of all problems here by itself: its equations for library integrators, hand-written RK4, its energy.

ℓ = ½ ν·Mν + ½ ω·Jω + w n·a + b·a with diagonal M, J and a = R⁻¹e_z holds the paper's vehicle, a body in an ideal fluid
and, with ν = 0, the heavy top. y = (R by rows, q, ω, ν), 18 numbers:
Ṙ = Rω̂, q̇ = Rν, Jω̇ = Jω × ω + Mν × ν + b × a, Mν̇ = Mν × ω + w a.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np
from scipy.integrate import solve_ivp


@dataclass(frozen=True)
class Body:
    """The diagonals of M, kg, and J, kg m²; w, N; b, N m."""

    mass: tuple[float, float, float]
    inertia: tuple[float, float, float]
    weight: float
    moment: tuple[float, float, float]

    @property
    def numbers(self) -> tuple[float, ...]:
        return (*self.mass, *self.inertia, self.weight, *self.moment)

    def momentum(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """e_z·(R Jω + q × R Mν) of rows y, the Kelvin–Noether quantity, and |Jω| + |q||Mν|, its scale."""
        R, q = y[..., :9].reshape(*y.shape[:-1], 3, 3), y[..., 9:12]
        spin, impulse = y[..., 12:15] * np.array(self.inertia), y[..., 15:18] * np.array(self.mass)
        spatial = np.einsum("...ij,...j->...i", R, spin) + np.cross(q, np.einsum("...ij,...j->...i", R, impulse))
        norm = np.linalg.norm
        return spatial[..., 2], norm(spin, axis=-1) + norm(q, axis=-1) * norm(impulse, axis=-1)

    def energy(self, y: np.ndarray) -> np.ndarray:
        """½ ν·Mν + ½ ω·Jω − w q_z − b·a of rows y (…, 18)."""
        omega, nu = y[..., 12:15], y[..., 15:18]
        kinetic = 0.5 * (nu**2 @ np.array(self.mass) + omega**2 @ np.array(self.inertia))
        return kinetic - self.weight * y[..., 11] - y[..., 6:9] @ np.array(self.moment)


def plain_rate(body: Body) -> Callable[[float, np.ndarray], np.ndarray]:
    """ẏ in NumPy, as one would write it for scipy."""
    M, J, b, w = np.diag(body.mass), np.diag(body.inertia), np.array(body.moment), body.weight
    M_inverse, J_inverse = np.linalg.inv(M), np.linalg.inv(J)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        R, omega, nu = y[:9].reshape(3, 3), y[12:15], y[15:18]
        a = R.T @ np.array([0.0, 0.0, 1.0])
        hat = np.array([[0.0, -omega[2], omega[1]], [omega[2], 0.0, -omega[0]], [-omega[1], omega[0], 0.0]])
        omega_dot = J_inverse @ (np.cross(J @ omega, omega) + np.cross(M @ nu, nu) + np.cross(b, a))
        nu_dot = M_inverse @ (np.cross(M @ nu, omega) + w * a)
        return np.concatenate([(R @ hat).ravel(), R @ nu, omega_dot, nu_dot])

    return rate


@numba.njit(fastmath={"contract", "nsz"}, error_model="numpy", inline="always")
def _rate(y, p, out):
    m1, m2, m3, j1, j2, j3, weight, b1, b2, b3 = p
    w1, w2, w3, v1, v2, v3 = y[12:18]
    for i in range(0, 9, 3):
        x1, x2, x3 = y[i], y[i + 1], y[i + 2]
        out[i] = x2 * w3 - x3 * w2
        out[i + 1] = x3 * w1 - x1 * w3
        out[i + 2] = x1 * w2 - x2 * w1
        out[9 + i // 3] = x1 * v1 + x2 * v2 + x3 * v3
    a1, a2, a3 = y[6], y[7], y[8]
    out[12] = ((j2 - j3) * w2 * w3 + (m2 - m3) * v2 * v3 + b2 * a3 - b3 * a2) / j1
    out[13] = ((j3 - j1) * w3 * w1 + (m3 - m1) * v3 * v1 + b3 * a1 - b1 * a3) / j2
    out[14] = ((j1 - j2) * w1 * w2 + (m1 - m2) * v1 * v2 + b1 * a2 - b2 * a1) / j3
    out[15] = (m2 * v2 * w3 - m3 * v3 * w2 + weight * a1) / m1
    out[16] = (m3 * v3 * w1 - m1 * v1 * w3 + weight * a2) / m2
    out[17] = (m1 * v1 * w2 - m2 * v2 * w1 + weight * a3) / m3


@numba.njit(error_model="numpy")
def compiled_rate(t, y, p):
    """ẏ compiled, for scipy."""
    out = np.empty(18)
    _rate(y, p, out)
    return out


@numba.njit(fastmath={"contract", "nsz"}, error_model="numpy")
def rk4(p, h, y, records, save_every, out):
    """The classical Runge–Kutta method by hand: advances y in place, out (records, 18) keeps every save_every-th."""
    k1, k2, k3, k4, z = np.empty(18), np.empty(18), np.empty(18), np.empty(18), np.empty(18)
    for record in range(records):
        out[record] = y
        for _ in range(save_every):
            _rate(y, p, k1)
            for i in range(18):
                z[i] = y[i] + 0.5 * h * k1[i]
            _rate(z, p, k2)
            for i in range(18):
                z[i] = y[i] + 0.5 * h * k2[i]
            _rate(z, p, k3)
            for i in range(18):
                z[i] = y[i] + h * k3[i]
            _rate(z, p, k4)
            for i in range(18):
                y[i] += h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])


def by_scipy(body: Body, y: np.ndarray, times: np.ndarray, method: str, tolerance: float, compiled: bool = False):
    """scipy's solution at `times`: rows y, and the number of steps; `compiled`: with the right-hand side by numba."""
    plain, span = plain_rate(body), (times[0], times[-1])
    function, extra = (compiled_rate, (body.numbers,)) if compiled else (plain, None)
    found = solve_ivp(function, span, y, method=method, t_eval=times, rtol=tolerance, atol=tolerance, args=extra)
    return found.y.T, _steps(found.nfev, method)


def _steps(evaluations: int, method: str) -> float:
    """Steps tried, from the evaluations of a method that takes so many a step."""
    return evaluations / {"DOP853": 12, "RK45": 6}[method]


def reference(body: Body, y: np.ndarray, times: np.ndarray) -> np.ndarray:
    """The motion at `times` to about twelve digits: DOP853 at the least tolerance that scipy takes."""
    return by_scipy(body, y, times, "DOP853", 2.5e-14, compiled=True)[0]
