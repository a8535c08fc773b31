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
from coadjoint.methods.program import Constants
from coadjoint.simulation.steppers.beginning import Beginning
from coadjoint.simulation.steppers.trees import rows_of


def carried(beginning: Beginning, states: np.ndarray, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """States (k, size) after a change of parameters (k, size) at which the velocities of the node are continuous.

    (ξ, ν) solves ∂ℓ(ξ, ν; before) = (μ, π), and (μ, π) jumps by ∂ℓ(ξ, ν; after) − ∂ℓ(ξ, ν; before): what is dropped
    takes its own momentum away, and a parameter that does not enter ℓ changes nothing.
    """
    if not beginning.skeleton.continuous:
        raise ArgumentError(
            'A system with only a discrete Lagrangian has no velocity at a node that could stay: pass keep="momentum".'
        )

    def carry(before: Constants, after: Constants, state: State) -> tuple[State, Any]:
        old, new = (replace_parameters(beginning.skeleton, constants.system) for constants in (before, after))
        xi, nu, residual = inverse_legendre.velocities(old, state)
        place = (xi, state.n, nu, state.a, state.t, state.inputs, state.internal)
        (mu, pi), (mu_new, pi_new) = legendre(old, *place), legendre(new, *place)
        moved = state.replace(mu=state.mu + (mu_new - mu), pi=state.pi + (pi_new - pi))
        return moved, jnp.zeros(()) if residual is None else residual

    given = beginning.constants.unpack(before), beginning.constants.unpack(after), beginning.state.unpack(states)
    found, residuals = evaluate(jax.vmap(carry), *given)
    if not np.all(residuals <= inverse_legendre.SOLVED):
        raise StepError('The velocities of the node could not be found from its momenta: pass keep="momentum".')
    rows = rows_of(found, len(states))
    if not np.all(np.isfinite(rows)):
        raise ArgumentError("With these parameters the momenta are not finite: look for a mass or an inertia of zero.")
    return rows
