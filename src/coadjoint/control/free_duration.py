"""Predictive control with a chosen duration, as of the quickest motion: each call solves the problem to its optimum.

The first steps of a plan, those of a period, have the length dt, so that the plan holds each command as long as the
loop does; all others share the chosen length, which shrinks as the end comes nearer. A quadratic program about the last
plan would not do: the equations of a step are products of inputs and durations, whose curvature decides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain, repeat
from typing import Any

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.control.given import with_previous
from coadjoint.control.guess import Guesses, least, misses_end
from coadjoint.control.planning import MotionPlan, PlanningController, Timeline
from coadjoint.control.problem_data import ProblemData
from coadjoint.control.problem_parts import End
from coadjoint.control.program import NonlinearProgram, nonlinear_program
from coadjoint.control.solve import answer, settings_of, solver_of
from coadjoint.errors import ArgumentError, OptimumError
from coadjoint.mechanics.state import State

TOLERANCE, MOST = 1e-8, 300
"""Of the solver, and its iterations at most."""

NEAR = {"mu_init": 1e-4, "bound_push": 1e-6, "bound_frac": 1e-6, "slack_bound_push": 1e-6, "slack_bound_frac": 1e-6}
"""Options of IPOPT from the last plan, which lies close to the bounds."""


class FreeDurationController(PlanningController):
    """Model predictive control with a free duration: controller(state).duration is the time that is left.

    `co.control.Problem.controller` makes it of a problem with `free_duration`. Each call solves the problem from this
    state on, by IPOPT, from the last plan less the time that has passed. The duration is never less than the shortest
    one; from there on it recedes, so that the end of the plan stays that far ahead. Where no optimum is found, or a
    plan newly violates a soft end, the solver starts from other guesses, and the plan of least cost counts.
    """

    STANDING = (*PlanningController.STANDING, "_end", "_begin")

    def __init__(self, problem: ProblemData, period: int, delay: int, fallback: Callable[[State], PyTree] | None):
        super().__init__(with_previous(problem), period, delay, fallback)
        self._program = nonlinear_program(self._transcription, given=True, even=period)
        self._guesses = Guesses(self._transcription)
        settings = [settings_of("ipopt", TOLERANCE, MOST, False, more) for more in ({"ipopt": NEAR}, None)]
        self._solvers = [solver_of(self._program, one) for one in settings]
        self._end, self._begin = problem.end, 0.0
        self.reset()

    def aim(self, goal: End) -> None:
        """Set the goal, with the same names as the problem's `end`, for all calls from now on.

        Raises ArgumentError for other names and shapes.
        """
        super().aim(goal)
        self._end = goal

    def export_c(self, *_: object, **__: object) -> None:
        """Raises ArgumentError: the solver of a free duration is IPOPT, which CasADi cannot generate."""
        raise ArgumentError("A controller with a `free_duration` has no C library: take a fixed one, or `shortest`.")

    def _iterate(self, measured: np.ndarray, clock: Timeline) -> str:
        first = self._predicted(measured, clock)
        if first is None:
            return "the model has no step from this state"
        begin = clock.t + self.delay * self.problem.dt
        bounds = self._program.bounds[0].copy(), self._program.bounds[1].copy()
        for side in bounds:
            side[: len(first)] = first
        program = self._program._replace(bounds=bounds)
        numbers = self._with_previous(clock.inputs[-1])
        near, far = self._solvers
        later = [] if self._plan is None else [self._later(begin, first)]
        missed = bool(later) and misses_end(self._violated)

        def ends(optimum: tuple[float, np.ndarray]) -> bool:
            return missed or not misses_end(self._transcription.violated(self._transcription.split(optimum[1])))

        starts = chain(zip(repeat(near), later), zip(repeat(far), self._from_afar(first)))
        optima = (self._optimum(solver, program, guess, numbers) for solver, guess in starts)
        best = least((one for one in optima if one is not None), lambda one: one[0], ends)
        if best is not None:
            self._keep(best[1], begin)
            return ""
        soft = isinstance(self.problem.end, End) and self.problem.end.soft is not None
        return f"the solver found no optimum from this state{'' if soft else '; a soft `end` can always be planned'}"

    def _optimum(
        self, solver: Any, program: NonlinearProgram, guess: np.ndarray, numbers: np.ndarray
    ) -> tuple[float, np.ndarray] | None:
        """The cost and the variables of the optimum from a guess, None if the solver finds none."""
        try:
            found = answer(solver, program, guess, numbers)
        except OptimumError:
            return None
        return (float(found["f"]), found["x"].full().ravel()) if solver.stats()["success"] else None

    def _keep(self, w: np.ndarray, begin: float) -> None:
        parts = self._transcription.split(w)
        u = np.clip(parts.u, self._lower, self._upper)
        self._plan, self._begin = MotionPlan(parts.x, u, parts.z, self.problem.count, parts.h), begin
        self._violated = self._transcription.violated(parts)

    def _with_previous(self, row: np.ndarray) -> np.ndarray:
        """The given numbers with the command in force, a row of inputs."""
        numbers = self._p.copy()
        for name, _, _, end in self._transcription.columns:
            if name in self._transcription.previous:
                numbers[self._transcription.previous[name]] = row[end]
        return numbers

    def _from_afar(self, first: np.ndarray) -> Iterator[np.ndarray]:
        """The variables of a first plan, from one guess after the other."""
        graph, start = self._transcription.graph, self._transcription.beginning.state
        numbers = graph.numbers(start)
        numbers[self._transcription.live] = first
        given = {"start": graph.filled(start, numbers), "end": self._end, "system": self.system}
        problem = replace(self.problem, duration=None, **given)
        guess = self._guesses.variables(problem, None, first)
        yield guess
        yield from self._guesses.others(problem, guess, first)

    def _later(self, begin: float, first: np.ndarray) -> np.ndarray:
        """The variables of the last plan from a later time on, at the nodes of what is left of it."""
        assert self._plan is not None and self.problem.free_duration is not None
        plan, even, count = self._plan, self.steps, self.problem.count
        nodes = self._begin + np.concatenate([[0.0], np.cumsum(self._lengths(plan))])
        left = float(np.clip(nodes[-1] - begin, *self.problem.free_duration))
        h = (left - even * self.problem.dt) / (count - even)
        now = begin + np.concatenate([[0.0], np.cumsum(self._lengths(plan._replace(h=h)))])
        x = np.column_stack([np.interp(now, nodes, column) for column in plan.x.T])
        x[0] = first
        u, z = self._inputs_at(now), plan.z[_steps(nodes, 0.5 * (now[1:] + now[:-1]))]
        parts = self._transcription.zeros()._replace(x=x, u=u, z=z, h=h)
        return self._transcription.joined(parts)

    def _inputs_at(self, times: np.ndarray) -> np.ndarray:
        """The inputs of the plan in steps between these times, (n, nu): after its end their guesses."""
        assert self._plan is not None
        u, nodes = self._plan.u, self._begin + np.concatenate([[0.0], np.cumsum(self._lengths(self._plan))])
        middle = 0.5 * (times[1:] + times[:-1])
        found = np.where((middle > nodes[-1])[:, None], self._guess, u[_steps(nodes, middle)])
        for _, _, begin, end in self._transcription.columns:
            if begin != end:
                course = np.vstack([u[:, begin], u[-1:, end]])
                at = np.column_stack([np.interp(times, nodes, one) for one in course.T])
                found[:, begin], found[:, end] = at[:-1], at[1:]
        return found

    def _lengths(self, plan: MotionPlan) -> np.ndarray:
        return np.where(np.arange(self.problem.count) < self.steps, self.problem.dt, plan.h)

    def _even(self, plan: MotionPlan) -> int:
        return self.steps

    def _on_grid(self, plan: MotionPlan) -> np.ndarray:
        return self._inputs_at(self._begin + self.problem.dt * np.arange(self.problem.count + 1))

    def _of_length(self) -> str:
        shortest, longest = self.problem.free_duration or (0.0, 0.0)
        return f" over {shortest:g} to {longest:g} s"


def _steps(nodes: np.ndarray, times: np.ndarray) -> np.ndarray:
    """The numbers of the steps between nodes in which times lie."""
    return np.clip(np.searchsorted(nodes, times) - 1, 0, len(nodes) - 2)
