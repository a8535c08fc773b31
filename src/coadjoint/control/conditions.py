"""The conditions that an optimum satisfies, to first and second order, with the constraints that are active.

Where the cost is minus the logarithm of a likelihood, they give the standard deviations of the unknowns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import bmat, csc_matrix
from scipy.sparse.linalg import splu

from coadjoint.arrays import PyTree
from coadjoint.control.boundary_conditions import free_start_sizes
from coadjoint.control.library import casadi
from coadjoint.control.problem_data import ProblemData
from coadjoint.control.program import NonlinearProgram, nonlinear_program
from coadjoint.control.transcribe import transcribe
from coadjoint.control.transcription import Split, Transcription
from coadjoint.errors import ArgumentError, OptimumError

SETTLED = 1e-4
"""The distance from a bound and its multiplier, relative to the largest, of which one at least must be larger."""


class SolvedProgram(NamedTuple):
    """The solution of a program: its problem, and w with the multipliers of g(w) and of the bounds of w."""

    problem: ProblemData
    w: np.ndarray
    of_rows: np.ndarray
    of_bounds: np.ndarray


@dataclass(frozen=True)
class Conditions:
    """At an optimum: H, the second derivative of f + λ·g, of the free variables' rows, (f, n); A, the slopes of active
    constraints, (a, n); ∇f + Aᵀλ, (n,); free, which variables no bound holds."""

    hessian: Any
    slopes: Any
    gradient: np.ndarray
    free: np.ndarray

    def solved(self, right: np.ndarray) -> np.ndarray:
        """The solution of [H Aᵀ; A 0] x = right over the free variables; raises OptimumError if there is none."""
        a = self.slopes[:, self.free]
        matrix = csc_matrix(bmat([[self.hessian[:, self.free], a.T], [a, None]]))
        no = "The optimum is not a strict one, or its constraints are not independent: it has no derivative."
        try:
            found = splu(matrix, permc_spec="COLAMD").solve(right)
        except RuntimeError:
            raise OptimumError(no) from None
        left = np.max(np.abs(matrix @ found - right), initial=0.0)
        if not np.all(np.isfinite(found)) or left > SETTLED * (1.0 + np.max(np.abs(right), initial=0.0)):
            raise OptimumError(no)
        return found


def conditions(
    program: NonlinearProgram, transcription: Transcription, w: np.ndarray, rows: np.ndarray, bounds: np.ndarray
) -> Conditions:
    """The conditions at w with the multipliers of the rows of g and of the bounds.

    Raises OptimumError if a constraint is only just reached.
    """
    ca = casadi()
    lam = ca.MX.sym("lam", program.g.numel())
    hessian, gradient = ca.hessian(program.f + ca.dot(lam, program.g), program.w)
    jacobian = ca.jacobian(program.g, program.w)
    at = ca.Function("conditions", [program.w, lam], [hessian, jacobian, gradient, program.g])
    _, slopes, _, values = at(w, rows)
    if transcription.start and not np.any(rows[_of_start(transcription)]):
        rows = _with_start(transcription, rows, slopes.sparse().tocsc(), bounds)
    second, slopes, gradient, values = at(w, rows)
    gradient = gradient.full().ravel()
    held = _active(values.full().ravel(), *program.limits, rows, "A constraint")
    fixed, others = w < SETTLED, len(w) - transcription.slacks
    lower, upper = (side[:others] for side in program.bounds)
    fixed[:others] = _active(w[:others], lower, upper, -gradient[:others], "A bound")
    free = np.flatnonzero(~fixed)
    return Conditions(second.sparse().tocsr()[free], slopes.sparse().tocsr()[held], gradient, free)


def _of_start(transcription: Transcription) -> slice:
    """The rows of g for the velocities at the start: before those of the end, which are last."""
    after = sum(len(rows.lower) for rows in transcription.end)
    size = sum(len(rows.lower) for rows in transcription.start)
    return slice(-size - after, -after or None)


def _with_start(transcription: Transcription, rows: np.ndarray, slopes: PyTree, bounds: np.ndarray) -> np.ndarray:
    """The multipliers of the start's velocities, Sᵀ λ = those of its momenta while these were fixed."""
    where, names = _of_start(transcription), transcription.graph.names()
    of_momenta = [i for i, place in enumerate(transcription.live) if names[place].startswith(("mu", "pi"))]
    square = slopes[where][:, of_momenta].toarray()
    rows = rows.copy()
    rows[where] = np.linalg.lstsq(square.T, bounds[of_momenta], rcond=None)[0]
    return rows


def _active(value: np.ndarray, lower: np.ndarray, upper: np.ndarray, multiplier: np.ndarray, what: str) -> np.ndarray:
    """The active constraints of the optimum; raises OptimumError if one is only just reached."""
    distance = np.minimum(value - lower, upper - value) / (1.0 + np.abs(value))
    force = np.abs(multiplier) / max(1.0, float(np.max(np.abs(multiplier), initial=0.0)))
    equal = lower == upper
    if np.any(~equal & (distance < SETTLED) & (force < SETTLED)):
        raise OptimumError(
            f"{what} is only just reached: the optimum has a derivative on either side of it, but not here. Move its "
            "limit a little."
        )
    return equal | (distance < force)


def deviations(solved: SolvedProgram) -> dict[str, np.ndarray]:
    """Standard deviations of the parameters and of η of the start; see `Optimum.deviations`."""
    problem = solved.problem
    if not problem.measured:
        raise ArgumentError("Standard deviations need measurements: give the problem `measured`.")
    transcription = transcribe(problem)
    if not transcription.sizes[3]:
        raise ArgumentError("Standard deviations are those of `parameters` and `free_start`, of which there are none.")
    program = nonlinear_program(transcription)
    found = conditions(program, transcription, solved.w, solved.of_rows, solved.of_bounds)
    of_parameters = transcription.joined(transcription.zeros()._replace(parameters=np.ones(transcription.sizes[3])))
    chosen = np.flatnonzero(of_parameters)
    place = {variable: row for row, variable in enumerate(found.free)}
    right = np.zeros((len(found.free) + found.slopes.shape[0], len(chosen)))
    for column, variable in enumerate(chosen):
        if variable in place:
            right[place[variable], column] = 1.0
    try:
        spread = found.solved(right)
    except OptimumError:
        raise OptimumError(
            "The measurements do not determine all unknowns, parameters, start and inputs: another motion is as "
            "likely. Measure more, or give deviations in `free_start` and a cost of the inputs."
        ) from None
    variance = np.array([spread[place[v], c] if v in place else 0.0 for c, v in enumerate(chosen)])
    if np.any(variance < 0.0):
        raise OptimumError(
            "The optimum is not a minimum: the cost falls to one side of it, so that it has no standard deviations. "
            "Another guess, or another start, leads to a minimum."
        )
    return _named(transcription, np.sqrt(variance))


def _named(transcription: Transcription, numbers: np.ndarray) -> dict[str, np.ndarray]:
    problem = transcription.problem
    blank = np.zeros(0)
    parts = Split(blank, blank, blank, numbers, 0.0)
    theta = transcription.taken(parts._replace(u=np.zeros((1, transcription.sizes[1]))))
    profiles = {name: theta[name] for name in transcription.profiles}
    found, begin = profiles | transcription.chosen(parts), 0
    eta = transcription.moved_by(parts)
    for name, size in free_start_sizes(problem).items():
        found[f"start {name}"], begin = eta[begin : begin + size], begin + size
    return found
