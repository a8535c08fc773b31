"""How well an optimum knows what it chose, where its cost is minus the logarithm of a likelihood."""

from __future__ import annotations

import numpy as np

from coadjoint.control.boundary_conditions import free_start_sizes
from coadjoint.control.conditions import SolvedProgram, conditions
from coadjoint.control.program import nonlinear_program
from coadjoint.control.transcription import Split, Transcription, transcribe
from coadjoint.errors import ArgumentError, OptimumError


def deviations(solved: SolvedProgram) -> dict[str, np.ndarray]:
    """Standard deviations of the parameters and of η of the start; see `Optimum.deviations`."""
    problem = solved.problem
    if not problem.measured:
        raise ArgumentError("Standard deviations need what was measured: give the problem `measured`.")
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
            "The measurements do not tell all that is chosen, parameters, start and inputs: another motion is as "
            "likely. Measure more, or give deviations in `free_start` and a cost of the inputs."
        ) from None
    variance = np.array([spread[place[v], c] if v in place else 0.0 for c, v in enumerate(chosen)])
    if np.any(variance < 0.0):
        raise OptimumError(
            "The optimum is no minimum: the cost falls to one side of it, so that it has no standard deviations. "
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
