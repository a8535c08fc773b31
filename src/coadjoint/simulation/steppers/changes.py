"""Parameters of a stepper that change between two steps: a fault, a dropped mass, a front of current."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.errors import ArgumentError, StepError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import inverse_legendre
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.start import legendre
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.program import Constants
from coadjoint.simulation.steppers.beginning import Beginning
from coadjoint.simulation.steppers.trees import rows_of

ROUND_OFF = 1e-12
"""The eigenvalue, beside the largest, whose sign counts."""


def carried(beginning: Beginning, states: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """States (k, size) after a change of parameters (k, size) at which the velocities of the node are continuous.

    (ξ, ν) solves ∂ℓ(ξ, ν; before) = (μ, π), and (μ, π) jumps by ∂ℓ(ξ, ν; after) − ∂ℓ(ξ, ν; before): what is dropped
    takes its own momentum away, and a parameter that does not enter ℓ changes nothing.
    Raises ArgumentError where an eigenvalue of ∂²ℓ/∂(ξ, ν)² changes its sign, as with a negative mass.
    """
    if not beginning.skeleton.continuous:
        raise ArgumentError(
            'A system with only a discrete Lagrangian has no velocity at a node that could stay: pass keep="momentum".'
        )

    weighed = beginning.skeleton.lagrangian is not None

    def carry(before: Constants, after: Constants, state: State) -> tuple[State, Any, Any]:
        old, new = (replace_parameters(beginning.skeleton, constants.system) for constants in (before, after))
        xi, nu, residual = inverse_legendre.velocities(old, state)
        place = (xi, state.n, nu, state.a, state.t, state.inputs, state.internal)
        (mu, pi), (mu_new, pi_new) = legendre(old, *place), legendre(new, *place)
        moved = state.replace(mu=state.mu + (mu_new - mu), pi=state.pi + (pi_new - pi))
        masses = [_mass_matrix(system, place) for system in (old, new)] if weighed else []
        return moved, jnp.zeros(()) if residual is None else residual, masses

    given = beginning.constants.unpack(before), beginning.constants.unpack(after), beginning.state.unpack(states)
    found, residuals, masses = evaluate(jax.vmap(carry), *given)
    if not np.all(residuals <= inverse_legendre.SOLVED):
        raise StepError('The velocities of the node could not be found from its momenta: pass keep="momentum".')
    rows = rows_of(found, len(states))
    if not np.all(np.isfinite(rows)):
        raise ArgumentError("With these parameters the momenta are not finite: look for a mass or an inertia of zero.")
    if masses and np.any(_negative(masses[0]) != _negative(masses[1])):
        raise ArgumentError(
            "With these parameters an eigenvalue of ∂²ℓ/∂(ξ, ν)² has another sign than before: look for a mass or an "
            "inertia that is negative, or too small beside the others."
        )
    return rows


def _mass_matrix(system: System, place: tuple[Any, ...]) -> Any:
    """∂²ℓ/∂(ξ, ν)², a square matrix."""
    xi, n, nu, *rest = place

    def momenta(velocities: Any) -> Any:
        return jnp.concatenate(legendre(system, velocities[: xi.size], n, velocities[xi.size :], *rest))

    return jax.jacfwd(momenta)(jnp.concatenate([xi, nu]))


def _negative(matrices: Any) -> np.ndarray:
    """How many eigenvalues are negative beyond round-off, of each of some matrices."""
    found = np.linalg.eigvalsh(np.asarray(matrices))
    scale = np.max(np.abs(found), axis=-1, keepdims=True, initial=0.0)
    return np.sum(found < -ROUND_OFF * scale, axis=-1)
