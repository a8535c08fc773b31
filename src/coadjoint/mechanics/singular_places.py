"""Places where rows of constraints become dependent, as reasons of a step that fails."""

from __future__ import annotations

import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import inverse_legendre
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.projection import moved
from coadjoint.mechanics.reactions import Independent, node_rates, parts, rows_of
from coadjoint.mechanics.reduced_functions import ReducedFunctions
from coadjoint.mechanics.state import State

SINGULAR = 1e-3
"""The smallest eigenvalue of A M⁻¹Aᵀ in units of its diagonal, relative to the largest, at a singular place."""

PLACES = np.linspace(0.0, 1.0, 5)
"""The parts of a step at which its rows are looked at."""


def singular_place(system: ReducedFunctions, state: State, independent: Independent, h: Scalar = 0.0) -> str:
    """A sentence if rows of the constraints become dependent on the way of a step of h, which they were not before.

    independent: the rows that steps keep, None for all.
    """
    if not system.constraints or rows_of(system) is not None:
        return ""

    def along(state: State, parameters: PyTree, time: Array) -> Array:
        here = replace_parameters(system, parameters)
        xi, nu, _ = inverse_legendre.velocities(here, state)
        return node_rates(here, moved(here, state, time * xi, time * nu)).mobility

    places = [evaluate(along, state, system.parameters, time) for time in h * PLACES]
    rank = len(places[0] if independent is None else independent)
    for found in places:
        if np.all(np.isfinite(found)) and (names := _dependent(system, found, None, rank)):
            return (
                f" The rows of its constraints are all but dependent there, those of {names}, so that the motion comes "
                "to a singular place: start elsewhere, or describe the place by other constraints."
            )
    for found in places:
        if np.all(np.isfinite(found)) and (names := _dependent(system, found, independent, rank)):
            return (
                f" Of the redundant rows of its constraints steps keep some, which become dependent there, those of "
                f"{names}, while others do not: simulate from `.run.final`, for which others are chosen."
            )
    return ""


def _dependent(system: ReducedFunctions, matrix: np.ndarray, chosen: Independent, rank: int) -> str:
    """The constraints whose rows are nearly dependent at A M⁻¹Aᵀ, as text; empty if `rank` rows are independent.

    chosen: the rows of the matrix that count, None for all.
    """
    rows = np.arange(len(matrix)) if chosen is None else np.array(chosen)
    own = matrix[np.ix_(rows, rows)]
    scale = 1 / np.sqrt(np.maximum(np.abs(np.diag(own)), np.finfo(float).tiny))
    sizes, directions = np.linalg.eigh(scale[:, None] * (0.5 * (own + own.T)) * scale)
    least = len(sizes) - rank
    if sizes[least] > SINGULAR * sizes[-1]:
        return ""
    share = np.zeros(len(matrix))
    share[rows] = np.abs(directions[:, least])
    return ", ".join(f"`{one.name}`" for one, part in parts(system) if np.max(share[part]) > 0.1)
