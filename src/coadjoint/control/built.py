"""The program of a problem, traced and built once, and solved for many starts, goals and parameters."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import chain, cycle, islice
from typing import Any, NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint.control.boundary_conditions import start_values
from coadjoint.control.given import Goals, changed, given_numbers, previous_values
from coadjoint.control.guess import Guesses, bent, least, misses_end
from coadjoint.control.measured_state import MeasuredState
from coadjoint.control.optimum import Optimum, flown
from coadjoint.control.problem_data import ProblemData
from coadjoint.control.problem_parts import End
from coadjoint.control.program import NonlinearProgram, nonlinear_program
from coadjoint.control.solve import FoundOptimum, Settings, found_by, solver_of
from coadjoint.control.transcribe import begun, transcribe
from coadjoint.control.transcription import Transcription
from coadjoint.errors import ArgumentError, OptimumError
from coadjoint.mechanics.state import State
from coadjoint.simulation.run import Run

BENDS = 4
"""The number of bent guesses that are tried where the straight one leads to no optimum."""

Guess = Run | Optimum | str | None
"""The start of the solver."""


class Case(NamedTuple):
    """One solution to find: its functions with the given numbers, its program with bounds, and the start of the
    solver."""

    transcription: Transcription
    program: NonlinearProgram
    guess: np.ndarray


class BuiltProgram:
    """The program of a problem with its solvers."""

    def __init__(self, problem: ProblemData):
        began = time.perf_counter()
        self.problem, self._transcription = problem, transcribe(problem)
        self._program = nonlinear_program(self._transcription, given=True)
        self._guesses, self._goals = Guesses(self._transcription), Goals(problem, self._transcription.goal)
        self._starts = MeasuredState(self._transcription, "start")
        self._solvers: dict[tuple[str, int], tuple[Settings, Any]] = {}
        self.seconds = time.perf_counter() - began

    def case(
        self,
        start: State | None,
        goal: End | None,
        parameters: Mapping[str, object] | None,
        previous: Mapping[str, object] | None,
        guess: Guess,
    ) -> Case:
        """The solution to find for another start, goal or parameters, None for those of the problem."""
        if start is None and goal is None and not parameters and not previous:
            first = self._transcription.graph.numbers(self._transcription.beginning.state)[self._transcription.live]
            return Case(self._transcription, self._program, self._guess(self.problem, guess, first))
        system = self._system({} if parameters is None else parameters)
        start = self.problem.start if start is None else start
        first = self._first(start, system)
        end = self.problem.end if goal is None else goal
        before = previous_values(self.problem, previous or {})
        values = {"goal": self._goal(goal), "previous": before, "start": start_values(self.problem, start)}
        inputs = {name: replace(one, previous=before[name]) if name in before else one
                  for name, one in self.problem.inputs.items()}  # fmt: skip
        problem = replace(self.problem, duration=None, system=system, start=start, end=end, inputs=inputs)
        given = given_numbers(problem, system, values)
        lower, upper = (side.copy() for side in self._program.bounds)
        held = np.flatnonzero(np.isfinite(lower[: len(first)]))
        lower[held] = upper[held] = first[held]
        transcription = replace(self._transcription, problem=problem, given=given)
        return Case(transcription, self._program._replace(bounds=(lower, upper)), self._guess(problem, guess, first))

    def solved(self, case: Case, settings: Settings, place: int = 0) -> Optimum:
        """The optimum; place: the number of the solver, of which each thread has its own."""
        key = repr(settings), place
        built = 0.0 if self._solvers else self.seconds
        if key not in self._solvers:
            began = time.perf_counter()
            self._solvers[key] = settings, solver_of(self._program, settings)
            built += time.perf_counter() - began
        found = found_by(self._solvers[key][1], case.program, case.guess, settings, case.transcription.given)
        return _optimum(case, found, built)

    def solved_around(self, case: Case, settings: Settings) -> Optimum:
        """The optimum; if the first guess leads to none past the constraints of a path, from guesses that are bent.

        Of a free duration also from further guesses, where there is none, or where it violates a soft end.
        """
        if self.problem.free_duration is not None and isinstance(self.problem.end, End):
            return self._of_free_duration(case, settings)
        try:
            return self.solved(case, settings)
        except OptimumError:
            if not self.problem.path:
                raise
            for seed in range(BENDS):
                found = self._attempt(case._replace(guess=bent(case.transcription, case.guess, seed)), settings, 0)
                if isinstance(found, Optimum):
                    return replace(found, solver=f"{found.solver}, from a bent guess")
            raise

    def _of_free_duration(self, case: Case, settings: Settings) -> Optimum:
        """The optimum of least cost from one guess after the other, until one reaches its end."""
        first, x = self._attempt(case, settings, 0), case.transcription.split(case.guess).x[0]
        guesses = self._guesses.others(case.transcription.problem, case.guess, x)
        others = (self._attempt(case._replace(guess=guess), settings, 0) for guess in guesses)
        found = (one for one in chain([first], others) if isinstance(one, Optimum))
        best = least(found, lambda one: one.cost, lambda one: not misses_end(one.violated))
        if best is None:
            raise OptimumError(f'{first} Another start of the solver may lead to one: guess="simulate", or guesses=8.')
        return best if best is first else replace(best, solver=f"{best.solver}, from another guess")

    def best(self, case: Case, settings: Settings, count: int) -> Optimum:
        """The optimum of least cost of several guesses; raises OptimumError if there is none."""
        tried = {"first": self._attempt(case, settings, 0)}
        if (around := self._guesses.other_way(case.transcription.problem, case.guess)) is not None and count > 2:
            tried["the other way round"] = self._attempt(case._replace(guess=around), settings, 0)
        for seed in range(count - len(tried)):
            guess = bent(case.transcription, case.guess, seed)
            tried[f"random {seed + 1}"] = self._attempt(case._replace(guess=guess), settings, 0)
        found = {name: one for name, one in tried.items() if isinstance(one, Optimum)}
        if not found and isinstance(error := tried["first"], OptimumError):
            raise error
        best = min(found.values(), key=lambda one: one.cost)
        costs = {name: one.cost if isinstance(one, Optimum) else str(one) for name, one in tried.items()}
        return replace(best, guesses=costs)

    def solved_each(self, cases: Sequence[Case], settings: Settings, threads: int) -> list[Optimum | OptimumError]:
        """The optimum of each, or its error, on threads."""

        def share(place: int) -> list[Optimum | OptimumError]:
            return [self._attempt(case, settings, place) for case in cases[place::threads]]

        if threads == 1:
            return share(0)
        with ThreadPoolExecutor(threads) as pool:
            shares: list[Iterator[Optimum | OptimumError]] = [iter(one) for one in pool.map(share, range(threads))]
        return [next(one) for one in islice(cycle(shares), len(cases))]

    def _attempt(self, case: Case, settings: Settings, place: int) -> Optimum | OptimumError:
        try:
            return self.solved(case, settings, place)
        except OptimumError as error:
            return error

    def _system(self, parameters: Mapping[str, object]) -> Any:
        checks.mapping(parameters, "parameters", "a dictionary of name → value")
        return changed(self.problem, self.problem.system, parameters, "this problem")

    def _first(self, start: State, system: Any) -> np.ndarray:
        """x of the first node."""
        problem = self.problem
        found = self._starts(start, system.parameters, False)
        reads = problem.free_start or (problem.parameters and problem.start.from_velocities)
        if reads and start.from_velocities != problem.start.from_velocities:
            given = "velocities" if problem.start.from_velocities else "momenta"
            raise ArgumentError(f"Argument `start` must be given by its {given}, as that of the problem is.")
        if not system.takes("inputs"):
            return found
        beginning = begun(system, start, problem.dt, problem.method, problem.inputs)
        return self._transcription.graph.numbers(beginning.state)[self._transcription.live]

    def _goal(self, goal: End | None) -> dict[str, Any]:
        own = self.problem.end
        if goal is None and not (isinstance(own, End) and own.given):
            return {}
        return self._goals(own if goal is None else goal)

    def _guess(self, problem: ProblemData, guess: Guess, first: np.ndarray) -> np.ndarray:
        if not isinstance(guess, Optimum):
            return self._guesses.variables(problem, guess, first)
        found = guess.solution.w.copy()
        if len(found) != self._program.w.numel():
            raise ArgumentError("Argument `guess` is the optimum of another problem: give its run.")
        found[: len(first)] = first
        return found


def threads_of(given: object, count: int) -> int:
    """The number of threads for `count` solutions."""
    most = checks.whole(os.cpu_count() or 1 if given is None else given, "threads")
    return max(1, min(most, count))


def _optimum(case: Case, found: FoundOptimum, built: float) -> Optimum:
    seconds = built, found.seconds
    return flown(case.transcription, case.program, found.numbers, found.iterations, seconds, found.words, found.minimum)
