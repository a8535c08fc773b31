"""An inertial navigation filter as one writes it by hand, in NumPy that numba compiles: the yardstick of `filters`.

The same steps, measurements and left-invariant errors (η, ξ_v, ξ_q, δb_g, δb_a) as `StrapdownProcess`, each Jacobian
derived on paper; the covariance goes on by exp(Ah) to the third order and a noise of the first.
"""

from __future__ import annotations

import numpy as np
from numba import njit

SIZE = 15


@njit(cache=True)
def hat(v):
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


@njit(cache=True)
def gammas(phi):
    """Γ₀, Γ₁, Γ₂ of a rotation vector."""
    a = np.sqrt(phi @ phi)
    x = hat(phi)
    xx = x @ x
    one = np.eye(3)
    if a < 1e-3:
        s0, s1, s2, s3 = 1 - a * a / 6, 0.5 - a * a / 24, 1 / 6 - a * a / 120, 1 / 24 - a * a / 720
    else:
        s0, s1 = np.sin(a) / a, (1 - np.cos(a)) / a**2
        s2, s3 = (a - np.sin(a)) / a**3, (0.5 * a * a + np.cos(a) - 1) / a**4
    return one + s0 * x + s1 * xx, one + s1 * x + s2 * xx, 0.5 * one + s2 * x + s3 * xx


@njit(cache=True)
def stepped(R, v, q, omega, f, h, g):
    """The motion after a step with constant rates and specific force; space axes north, east, down."""
    turn, once, twice = gammas(omega * h)
    down = np.array([0.0, 0.0, g])
    q = q + v * h + 0.5 * down * h * h + R @ (twice @ f) * h * h
    v = v + down * h + R @ (once @ f) * h
    return R @ turn, v, q


@njit(cache=True)
def carried(P, omega, f, h, noise):
    """P after a step: Φ P Φᵀ + Q, of errors in body axes."""
    A = np.zeros((SIZE, SIZE))
    for i in range(3):
        A[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = -hat(omega)
    A[3:6, :3] = -hat(f)
    A[6:9, 3:6] = np.eye(3)
    A[:3, 9:12] = -np.eye(3)
    A[3:6, 12:] = -np.eye(3)
    A *= h
    AA = A @ A
    Phi = np.eye(SIZE) + A + 0.5 * AA + AA @ A / 6.0
    P = Phi @ P @ Phi.T
    for i in range(3):
        P[i, i] += noise[0] ** 2 * h
        P[3 + i, 3 + i] += noise[1] ** 2 * h
    return P


@njit(cache=True)
def corrected(R, v, q, b, P, H, nu, variance):
    """State and covariance after measurements of one variance, by Joseph's form."""
    m = len(nu)
    S = H @ P @ H.T + variance * np.eye(m)
    K = np.linalg.solve(S, H @ P).T
    e = K @ nu
    turn, once, _ = gammas(e[:3])
    left = np.eye(SIZE) - K @ H
    P = left @ P @ left.T + variance * (K @ K.T)
    return R @ turn, v + R @ (once @ e[3:6]), q + R @ (once @ e[6:9]), b + e[9:], 0.5 * (P + P.T)


@njit(cache=True)
def filtered(R, v, q, P, imu, h, g, noise, lever, velocity, depth, heading, place, every, variances):
    """Estimates (nodes, 3) of the place, every second's, and P at the end.

    imu (N, 6). velocity, depth, heading, place: what is measured at every so many steps, `every`, of `variances`.
    """
    b = np.zeros(6)
    steps = len(imu)
    kept = np.empty((steps // 100, 3))
    for k in range(steps):
        omega, f = imu[k, :3] - b[:3], imu[k, 3:] - b[3:]
        P = carried(P, omega, f, h, noise)
        R, v, q = stepped(R, v, q, omega, f, h, g)
        n = k + 1
        if n % every[0] == 0:
            nu = R.T @ v
            H = np.zeros((3, SIZE))
            H[:, :3], H[:, 3:6], H[:, 9:12] = hat(nu), np.eye(3), hat(lever)
            seen = nu + np.cross(imu[k, :3] - b[:3], lever)
            R, v, q, b, P = corrected(R, v, q, b, P, H, velocity[n // every[0] - 1] - seen, variances[0])
        if n % every[1] == 0:
            H = np.zeros((1, SIZE))
            H[0, 6:9] = R[2]
            R, v, q, b, P = corrected(R, v, q, b, P, H, depth[n // every[1] - 1] - q[2:], variances[1])
        if n % every[2] == 0:
            x, y = R[0, 0], R[1, 0]
            H = np.zeros((1, SIZE))
            H[0, 1] = -(x * R[1, 2] - y * R[0, 2]) / (x * x + y * y)
            H[0, 2] = (x * R[1, 1] - y * R[0, 1]) / (x * x + y * y)
            off = heading[n // every[2] - 1] - np.arctan2(y, x)
            off = off - 2 * np.pi * np.round(off / (2 * np.pi))
            R, v, q, b, P = corrected(R, v, q, b, P, H, off, variances[2])
        if n % every[3] == 0:
            H = np.zeros((3, SIZE))
            H[:, 6:9] = R
            R, v, q, b, P = corrected(R, v, q, b, P, H, place[n // every[3] - 1] - q, variances[3])
        if n % 100 == 0:
            kept[n // 100 - 1] = q
    return kept, P
