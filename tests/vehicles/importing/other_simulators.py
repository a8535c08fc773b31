"""The equations of the original simulators, written again from their documentation: nothing of the library is in them.

Space is east, north, up and a body forward, port, up; the state is (q, R, v, ω) of the link's origin, v and ω in body
axes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

Wrench = Callable[[float, np.ndarray, np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def cross(v: np.ndarray) -> np.ndarray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def turned(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """R_z R_y R_x."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(x), np.sin(x)) for x in (roll, pitch, yaw))
    x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    return np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ y @ x


def rigid(bodies: list[tuple[float, np.ndarray, np.ndarray]]) -> np.ndarray:
    """The 6 × 6 inertia of (mass, place, inertia about it) about the origin, order (v, ω)."""
    M = np.zeros((6, 6))
    for mass, r, inertia in bodies:
        S = cross(r)
        M += np.block([[mass * np.eye(3), -mass * S], [mass * S, inertia - mass * S @ S]])
    return M


def coriolis(M: np.ndarray, nu: np.ndarray) -> np.ndarray:
    """C(ν)ν = [ω × p; ω × l + v × p], (p, l) = Mν, for rigid bodies and for added mass alike."""
    p, l = np.split(M @ nu, 2)
    v, w = nu[:3], nu[3:]
    return np.concatenate([np.cross(w, p), np.cross(w, l) + np.cross(v, p)])


def moved(body: np.ndarray, water: np.ndarray, wrench: Wrench, start: np.ndarray, duration: float) -> np.ndarray:
    """The state at the end of (M + M_A)ν̇ = −C(ν)ν − C_A(ν)ν + τ(t, q, R, v, ω), finely integrated."""
    total = np.linalg.inv(body + water)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        q, R, nu = y[:3], y[3:12].reshape(3, 3), y[12:]
        force = wrench(t, q, R, nu[:3], nu[3:]) - coriolis(body, nu) - coriolis(water, nu)
        return np.concatenate([R @ nu[:3], (R @ cross(nu[3:])).ravel(), total @ force])

    found = solve_ivp(rate, (0.0, duration), start, method="DOP853", rtol=1e-9, atol=1e-10)
    assert found.success
    return found.y[:, -1]
