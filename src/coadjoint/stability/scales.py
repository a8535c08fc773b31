"""Natural sizes of the variables around a motion, so that no result depends on the user's units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.groups import LieGroup
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System


class Scales(NamedTuple):
    """What counts as one: of z = (δξ, δn, δν, η), of y = (μ, n, π, a), of rates 1/s, and of energies.

    `rate` ρ is the largest of |ad_ξ|, of the slopes of forces by velocities, and of the roots of those by positions,
    per inertia. `energy` E is that of turning at ρ or of the motion, the larger. Velocities are √(E/M_ii), momenta
    √(E M_ii), positions √(E/M_ii)/ρ, angles 1, and an advected parameter has its own size. All of these change
    with the units as the variables do, but where nothing moves: a rate, an energy, an inertia or an advected parameter
    that vanishes counts as 1.

    z: (z,). y: (y,). rate, energy: one number.
    """

    z: np.ndarray
    y: np.ndarray
    rate: float
    energy: float


def natural_scales(system: System, state: State, y_z: np.ndarray, rate_z: np.ndarray, sizes: Sequence[int]) -> Scales:
    """The scales at a state.

    y_z, rate_z: derivatives of y and of its rate by z, shape (rows of y, rows of z). sizes: how many of z are of each
    kind.
    """
    dim, ambient, _, angles = sizes
    # Where δξ, δν are in z, and μ, π in y.
    moving = np.r_[:dim, dim + ambient : dim + 2 * ambient]
    inertia = np.abs(y_z[np.ix_(moving, moving)].diagonal())
    inertia = np.where(inertia > 0, inertia, np.max(inertia, initial=0.0) or 1.0)
    ad, turns = _adjoint(system.group, state.xi)
    rate = _rate(ad, rate_z[moving], inertia, sizes)
    turning = inertia[:dim][turns > 0] / turns[turns > 0] ** 2
    spinning = rate**2 * float(np.mean(turning)) if len(turning) else 0.0
    energy = max(spinning, float(np.concatenate([state.xi, state.nu]) ** 2 @ inertia)) or 1.0
    v = np.sqrt(energy / inertia)
    eta = np.where(turns > 0, 1 / np.where(turns > 0, turns, 1.0), v[:dim] / rate)[:angles]
    z = np.concatenate([v[:dim], v[dim:] / rate, v[dim:], eta])
    y = np.concatenate([energy / v[:dim], v[dim:] / rate, energy / v[dim:], _advected(system, state)])
    return Scales(z, y, rate, energy)


def _rate(ad: np.ndarray, force_z: np.ndarray, inertia: np.ndarray, sizes: Sequence[int]) -> float:
    """ρ: the largest of |ad_ξ|, ∂f/∂v and √(∂f/∂q), f, v, q weighed by the roots of their inertias."""
    dim, ambient, _, angles = sizes
    weights = np.sqrt(inertia)
    by_velocity = force_z[:, np.r_[:dim, dim + ambient : dim + 2 * ambient]] / np.outer(weights, weights)
    positions = np.r_[dim : dim + ambient, dim + 2 * ambient : dim + 2 * ambient + angles]
    by_position = force_z[:, positions] / np.outer(weights, np.concatenate([weights[dim:], weights[:angles]]))
    turning = ad * weights[:dim, None] / weights[:dim]
    largest = [float(np.max(np.abs(part), initial=0.0)) for part in (turning, by_velocity, by_position)]
    return max(*largest[:2], float(np.sqrt(largest[2]))) or 1.0


def _adjoint(group: LieGroup, xi: Array) -> tuple[np.ndarray, np.ndarray]:
    """ad_ξ as a matrix, and √(|tr ad_i²|/2) of every basis vector: 1 for a rotation in space, 0 for a translation."""
    unit = np.eye(group.dim)

    def matrix(x: Array) -> Array:
        return jax.vmap(lambda e: group.ad(x, e), out_axes=1)(unit)

    def squared(x: Array) -> Array:
        found = matrix(x)
        return jnp.sum(found * found.T)

    ad, traces = evaluate(lambda x: (matrix(x), jax.vmap(squared)(unit)), xi)
    return ad, np.sqrt(np.abs(traces) / 2)


def _advected(system: System, state: State) -> np.ndarray:
    """How large every advected parameter is; 1 where it vanishes."""
    a = np.asarray(state.a)
    found = np.ones(len(a))
    for part in system.advected.components(system.group, "a").values():
        found[part] = np.linalg.norm(a[part]) or 1.0
    return found
