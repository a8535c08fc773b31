"""Rigid bodies in minimal coordinates, by Lagrange's equations and DOP853: an independent solution for mechanisms."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

G = 9.81


def turned(axis: Sequence[float], angle: jax.Array) -> jax.Array:
    """The rotation (3, 3) by an angle about a unit vector."""
    x, y, z = axis
    K = jnp.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], dtype=float)
    return jnp.eye(3) + jnp.sin(angle) * K + (1 - jnp.cos(angle)) * K @ K


def integrated(
    poses: Callable, masses: Sequence[float], inertias: Sequence, start: Sequence, rates: Sequence, duration: float
) -> tuple[np.ndarray, np.ndarray]:
    """The coordinates and their rates after a duration. poses: coordinates to R (N, 3, 3) and x (N, 3)."""
    J, m, count = np.stack([np.diag(one) for one in inertias]), np.array(masses), len(start)

    def lagrangian(x, v):
        (R, place), (dR, velocity) = jax.jvp(poses, (x,), (v,))
        W = jnp.einsum("nji,njk->nik", R, dR)
        omega = jnp.stack([W[:, 2, 1], W[:, 0, 2], W[:, 1, 0]], axis=1)
        turning = jnp.einsum("ni,nij,nj", omega, J, omega)
        return 0.5 * turning + m @ (0.5 * jnp.sum(velocity**2, axis=1) - G * place[:, 2])

    @jax.jit
    def acceleration(x, v):
        rest = jax.jacfwd(jax.grad(lagrangian, 1), 0)(x, v) @ v
        return jnp.linalg.solve(jax.hessian(lagrangian, 1)(x, v), jax.grad(lagrangian)(x, v) - rest)

    def slopes(_, y):
        return np.concatenate([y[count:], acceleration(y[:count], y[count:])])

    with jax.enable_x64(True):
        end = solve_ivp(slopes, (0, duration), [*start, *rates], method="DOP853", rtol=1e-10, atol=1e-10).y[:, -1]
    return end[:count], end[count:]
