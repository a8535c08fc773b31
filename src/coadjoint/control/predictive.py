"""Model predictive control by real-time iterations: one quadratic program per period, about the plan of the last one.

Source: M. Diehl, H. G. Bock, J. P. Schlöder, *A real-time iteration scheme for nonlinear optimization in optimal
feedback control*, SIAM J. Control Optim. 43 (2005).
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.c_sources import identifier, write_library
from coadjoint.checks import whole
from coadjoint.control.c_library import sources
from coadjoint.control.expansion import Expanding, Expansion
from coadjoint.control.free_duration import FreeDurationController
from coadjoint.control.planning import MotionPlan, PlanningController, Timeline
from coadjoint.control.problem_data import ProblemData
from coadjoint.control.quadratic import QuadraticSolver, StageLayout
from coadjoint.control.requirements import require_controllable, require_free_duration, steps_of
from coadjoint.errors import ArgumentError
from coadjoint.mechanics.state import State

STILL, SHAKEN = 1e-9, 1e-2
"""The largest change of inputs by a first program that counts as none, and the random change that follows, of the unit
of each input."""

VIOLATED = 1e-5
"""The largest violation of the constraints of a program by a solution."""


class Controller(PlanningController):
    """Model predictive control: controller(state).command once a period; `co.control.Problem.controller` makes it.

    Each call takes one step of Gauss and Newton (`iterations` of them) towards the optimum of the problem from this
    state on, about the last plan, which is shifted by the steps that have passed since:

        preparation: x, u, z shifted by s steps, their linear steps, costs and constraints  (no state is needed);
        feedback: the quadratic program with δx_0 = x(t + delay) − x_0, whose u_0, u_1, … are the command.

    Called again with a state of the same t it shifts nothing, and iterates further towards the optimum of that state. A
    state that is earlier than the last one, or later than the plan, restarts from the inputs' guesses, as `reset` does.
    """

    STANDING = (*PlanningController.STANDING, "_prepared")

    def __init__(
        self,
        problem: ProblemData,
        period: int,
        delay: int,
        iterations: int,
        fallback: Callable[[State], PyTree] | None,
        shortest: int | None = None,
    ):
        self.shortest = problem.count if shortest is None else shortest
        self.iterations = iterations
        super().__init__(problem, period, delay, fallback)
        self._expanding = expanding = Expanding(self._transcription)
        nx = expanding.width + len(expanding.rated)
        self._layout = StageLayout(problem.count, nx, len(expanding.free) + expanding.slack.size, expanding.patterns())
        self._solve = QuadraticSolver(self._layout)
        self.reset()

    def reset(self) -> None:
        """Forget the plan and past inputs: the next call starts from the inputs' guesses."""
        super().reset()
        self._prepared: tuple[int, MotionPlan, Expansion] | None = None
        self._expanding.multiplier = 0.0

    def prepare(self) -> float:
        """Linearise about the plan one period after the last state; returns seconds.

        A loop calls it while it waits for the next state; otherwise the call with that state does this first.
        """
        began = time.perf_counter()
        if self._plan is not None and self._prepared is None:
            self._prepare(self.steps)
        return time.perf_counter() - began

    def _make_ready(self, passed: int | None, renewed: bool) -> None:
        if renewed:
            self._prepared = None
        if self._plan is not None and passed is not None and (self._prepared is None or self._prepared[0] != passed):
            self._prepare(passed)
        if self._prepared is not None:
            self._plan = self._prepared[1]

    def _prepare(self, passed: int) -> None:
        assert self._clock is not None
        before = self._clock.inputs[passed + self.delay]
        plan = self._shifted(passed, before)
        with np.errstate(all="ignore"):
            self._prepared = passed, plan, self._expanded(plan, before)

    def _shifted(self, passed: int, before: np.ndarray) -> MotionPlan:
        """The plan some steps later, whose last input is held and whose last nodes follow from it."""
        assert self._plan is not None
        x, u, z, left, h = self._plan
        left = max(left - passed, self.shortest)
        if passed:
            x, u, z = (np.concatenate([rows[passed:], rows[-1:].repeat(passed, 0)]) for rows in (x, u, z))
        u = self._expanding.continuous(u, before)
        if passed:
            self._follow(x, u, z, left, max(left - passed, 0))
        return MotionPlan(x, u, z, left, h)

    def _expanded(self, plan: MotionPlan, before: np.ndarray) -> Expansion:
        return self._expanding(plan.x, plan.u, plan.z, self._p, before, plan.left)

    def _follow(self, x: np.ndarray, u: np.ndarray, z: np.ndarray, left: int, first: int = 0) -> bool:
        """Simulate the nodes from `first` on in place; False if a step has no solution."""
        lengths = self._expanding.lengths(left)
        for k in range(first, len(u)):
            found = self._simulated(x[k], u[k], z[max(k - 1, 0)], self._p, lengths[k])
            if found is None:
                x[k + 1 :] = x[k]
                return False
            x[k + 1], z[k] = found
        return True

    def _iterate(self, measured: np.ndarray, clock: Timeline) -> str:
        """Solve from the state that the delay ends at; returns why it failed, or an empty sentence."""
        first = self._predicted(measured, clock)
        if first is None:
            self._prepared = None
            return "the model has no step from this state"
        new = self._plan is None
        if self._plan is None:
            self._begin(first, clock)
        for _ in range(self.iterations):
            if self._prepared is None:
                self._prepare_again(clock)
            assert self._prepared is not None
            _, plan, expansion = self._prepared
            self._prepared = None
            reason = self._step(plan, expansion, first)
            if reason:
                return reason
            if new and self._plan is not None and np.max(np.abs(self._plan.u - plan.u), initial=0.0) < STILL:
                self._shake(self._plan, first, clock)
            new = False
        return ""

    def _shake(self, still: MotionPlan, first: np.ndarray, clock: Timeline) -> None:
        """Leave a first plan that is stationary but no minimum, as half a turn away from the goal: iterate from random
        inputs about it, and stay where these lead back."""
        expanding, generator, violated = self._expanding, np.random.default_rng(0), self._violated
        u = still.u + SHAKEN * expanding.scale * generator.uniform(0.5, 1.0, still.u.shape[1])
        u = expanding.continuous(np.clip(u, expanding.lower, expanding.upper), clock.inputs[-1])
        x, z = still.x.copy(), still.z.copy()
        begun = moved = float(np.max(np.abs(u - still.u), initial=0.0))
        self._plan, good = MotionPlan(x, u, z, still.left, still.h), self._follow(x, u, z, still.left)
        while good and 0.5 * begun < moved < 10 * begun:
            self._prepare_again(clock)
            assert self._prepared is not None and self._plan is not None
            (_, plan, expansion), self._prepared = self._prepared, None
            good = not self._step(plan, expansion, first)
            last, moved = moved, float(np.max(np.abs(self._plan.u - still.u), initial=0.0)) if good else 0.0
            good = good and abs(moved - last) > 1e-3 * begun
        if not (good and moved >= 10 * begun):
            self._plan, self._violated = still, violated

    def _prepare_again(self, clock: Timeline) -> None:
        assert self._plan is not None
        plan = self._plan._replace(u=self._expanding.continuous(self._plan.u, clock.inputs[-1]))
        with np.errstate(all="ignore"):
            self._prepared = 0, plan, self._expanded(plan, clock.inputs[-1])

    def _begin(self, first: np.ndarray, clock: Timeline) -> None:
        """A first plan: the motion from here under the inputs' guesses."""
        count, nz = self.problem.count, self._transcription.sizes[2]
        x, u, z = np.tile(first, (count + 1, 1)), np.tile(self._guess, (count, 1)), np.zeros((count, nz))
        u = self._expanding.continuous(np.clip(u, self._expanding.lower, self._expanding.upper), clock.inputs[-1])
        self._follow(x, u, z, count)
        self._plan = MotionPlan(x, u, z, count, self.problem.dt)

    def _step(self, plan: MotionPlan, expansion: Expansion, first: np.ndarray) -> str:
        """One quadratic program, and the plan moved by its solution."""
        stages, steps = expansion.stages, expansion.steps
        if not (np.all(np.isfinite(stages.M)) and np.all(np.isfinite(stages.H)) and np.all(np.isfinite(stages.g))):
            self._plan = None
            return "a function of the problem, or a derivative, is not finite about the plan"
        expanding = self._expanding
        tangents, width = expanding.tangents, expanding.width
        y = tangents.first(first - plan.x[0], expansion.inverses)
        solved = self._solve(stages, np.concatenate([y, np.zeros(len(self._expanding.rated))]))
        if solved.failure or solved.violation > VIOLATED:
            return solved.failure or f"the constraints of the quadratic program are violated by {solved.violation:.1e}"
        expanding.note(solved.multipliers)
        y, du = solved.x[:, :width], np.zeros_like(plan.u)
        du[:, expanding.free] = solved.u[:, : len(expanding.free)]
        du[:, expanding.begins] = solved.x[:-1, width + expanding.linear]
        dz = (steps.E @ np.concatenate([y[:-1], du], axis=1)[:, :, None])[:, :, 0] + steps.e
        self._violated = expanding.violated(solved.u, solved.last)
        u = np.clip(plan.u + du * expanding.scale, expanding.lower, expanding.upper)
        if len(expanding.begins):
            u[0, expanding.begins] = plan.u[0, expanding.begins]
            u[1:, expanding.begins] = u[:-1, expanding.ends]
        x = tangents.moved_by(plan.x, y, u, self._p, self.problem.dt)
        x[0] = first
        self._plan = MotionPlan(x, u, plan.z - dz, plan.left, plan.h)
        return ""

    def export_c(
        self,
        folder: str | os.PathLike[str],
        *,
        name: str | None = None,
        units: Mapping[str, str] | None = None,
        iterations: int = 30,
        overwrite: bool = False,
    ) -> Path:
        """Write a C library without Python: NAME.h, NAME.c, NAME_solver.c by CasADi, and CMakeLists.txt.

            controller.export_c("robot/control")

        The library solves the problem of each state until it converges, by CasADi's `sqpmethod` and `qrqp`, from the
        last plan; so its commands are those of this controller after many iterations, to 1e-5 of their size. The goal
        and the parameters in `changing` may change between calls.

        folder, name, units, overwrite: as of `co.Stepper.export_c`. iterations: of the solver, at most. Raises
        FileError rather than replace a file, ArgumentError for a controller with a delay or with linear inputs.
        """
        name = identifier(Path(folder).name if name is None else name, "folder" if name is None else "name")
        checks.leave_out(self.delay, "`delay`", "A controller with a delay has no C library")
        if len(self._expanding.begins):
            raise ArgumentError("A controller of linear inputs has no C library: take inputs that are held.")
        checks.leave_out(
            self.shortest < self.problem.count, "`shortest`", "A controller whose horizon shrinks has no C library"
        )
        texts = sources(self.problem, name, whole(iterations, "iterations"), {"t": "s", **(units or {})})
        return write_library(folder, name, texts, overwrite)


def controller(
    problem: ProblemData,
    period: object,
    delay: object,
    iterations: Any,
    fallback: Any,
    changing: Any,
    shortest: object = None,
) -> Controller | FreeDurationController:
    """The controller of a problem; the arguments are those of `Problem.controller`."""
    require_controllable(problem)
    steps = steps_of(problem.dt if period is None else period, problem.dt, "period", 1)
    late = steps_of(delay, problem.dt, "delay", 0)
    if steps > problem.count:
        raise ArgumentError(f"Argument `period` must not be longer than the horizon of {problem.length:g} s.")
    if late > steps:
        raise ArgumentError("Argument `delay` must not be longer than the period.")
    least = None if shortest is None else steps_of(shortest, problem.dt, "shortest", 1)
    if least is not None and not steps <= least <= problem.count:
        raise ArgumentError(f"Argument `shortest` must lie between the period and the horizon of {problem.length:g} s.")
    if least is not None and any(one.soft for one in problem.path.values()):
        raise ArgumentError("A horizon that shrinks keeps the bounds of its `path`: leave out `soft`.")
    if fallback is not None:
        checks.function(fallback, "fallback", "a function of the state")
    names = (changing,) if isinstance(changing, str) else changing
    checks.texts(names, "changing", 'names of parameters, such as ("mass",)')
    problem = replace(problem, duration=None, changing=(*problem.changing, *names))
    if problem.free_duration is not None:
        require_free_duration(problem, steps, iterations, shortest)
        return FreeDurationController(problem, steps, late, fallback)
    return Controller(problem, steps, late, whole(iterations, "iterations"), fallback, least)
