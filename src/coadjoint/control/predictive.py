"""Model predictive control by real-time iterations: one quadratic program per period, about the plan of the last one.

Source: M. Diehl, H. G. Bock, J. P. Schlöder, *A real-time iteration scheme for nonlinear optimization in optimal
feedback control*, SIAM J. Control Optim. 43 (2005).
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.c_sources import identifier, write_library
from coadjoint.checks import whole
from coadjoint.control.c_library import sources
from coadjoint.control.expansion import Expanding, Expansion, columns_of, limits_of
from coadjoint.control.given import Goals, changed, given_numbers, previous_values
from coadjoint.control.linearised import Simulated
from coadjoint.control.measured_state import MeasuredState
from coadjoint.control.mpc_solution import MpcSolution, Record
from coadjoint.control.problem_data import End, ProblemData
from coadjoint.control.quadratic import QuadraticSolver, StageLayout
from coadjoint.control.requirements import require_controllable, steps_of
from coadjoint.control.resolution import JudgedMotions
from coadjoint.control.transcription import transcribe
from coadjoint.errors import ArgumentError, shown
from coadjoint.mechanics.state import State
from coadjoint.portable import Remade

STILL, SHAKEN = 1e-9, 1e-2
"""The largest change of inputs by a first program that counts as none, and the random change that follows, of the unit
of each input."""

VIOLATED = 1e-5
"""The largest violation of the constraints of a program by a solution."""


class MotionPlan(NamedTuple):
    """Nodes x (N + 1, nx), inputs u (N, nu) and unknowns z (N, nz); left: the steps until the end of the motion."""

    x: np.ndarray
    u: np.ndarray
    z: np.ndarray
    left: int


@dataclass
class Timeline:
    """The schedule of inputs: `inputs`, rows (1 + d + N, nu), the one before t, those of the delay, and the plan; age:
    steps since the last solution."""

    t: float
    inputs: np.ndarray
    age: int = 0


class Controller(Remade):
    """Model predictive control: controller(state).command once a period; `co.control.Problem.controller` makes it.

    Each call takes one step of Gauss and Newton (`iterations` of them) towards the optimum of the problem from this
    state on, about the last plan, which is shifted by the steps that have passed since:

        preparation: x, u, z shifted by s steps, their linear steps, costs and constraints  (no state is needed);
        feedback: the quadratic program with δx_0 = x(t + delay) − x_0, whose u_0, u_1, … are the command.

    Called again with a state of the same t it shifts nothing, and iterates further towards the optimum of that state. A
    state that is earlier than the last one, or later than the plan, restarts from the inputs' guesses, as `reset` does.
    """

    STANDING = ("system", "_goal", "_p", "record", "_plan", "_clock", "_prepared")

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
        self.problem, self.steps, self.delay, self.iterations = problem, period, delay, iterations
        self._fallback = fallback
        self._transcription = transcription = transcribe(problem)
        self.names = tuple(transcription.graph.names()[i] for i in transcription.live)
        self._expanding = expanding = Expanding(transcription)
        self._simulated, self._measured = Simulated(transcription), MeasuredState(transcription)
        self._judged = JudgedMotions(transcription, self._simulated) if problem.accuracy else None
        self._guess = limits_of(transcription, "guess")
        known = {name: one.guess if one.previous is None else one.previous for name, one in transcription.inputs}
        self._before = columns_of(transcription, known)
        nx = expanding.width + len(expanding.rated)
        self._layout = StageLayout(problem.count, nx, len(expanding.free) + expanding.slack.size, expanding.patterns())
        self._solve = QuadraticSolver(self._layout)
        self.system, self._goal, self._goals = problem.system, transcription.goal, Goals(problem, transcription.goal)
        self._p = self._numbers()
        self.record = Record()
        self.reset()

    def reset(self) -> None:
        """Forget the plan and past inputs: the next call starts from the inputs' guesses."""
        self._plan: MotionPlan | None = None
        self._violated: dict[str, np.ndarray] = {}
        self._clock: Timeline | None = None
        self._prepared: tuple[int, MotionPlan, Expansion] | None = None
        self._expanding.multiplier = 0.0

    def change(self, **values: object) -> None:
        """Set parameters that `changing` names, as `system.replace` does, for all calls from now on.

        values: name → value, or name → {name: value} of a part. Raises ArgumentError for another name.
        """
        self.system = changed(self.problem, self.system, values, "this controller")
        self._p, self._prepared = self._numbers(), None

    def aim(self, goal: End) -> None:
        """Set the goal, with the same names as the problem's `end`, for all calls from now on.

        Raises ArgumentError for other names and shapes.
        """
        self._goal = self._goals(goal)
        self._p, self._prepared = self._numbers(), None

    def _numbers(self) -> np.ndarray:
        """The given numbers, in the order of the model's functions."""
        values = {"goal": self._goal, "previous": previous_values(self.problem, {}), "start": {}}
        return given_numbers(self.problem, self.system, values)

    def prepare(self) -> float:
        """Linearise about the plan one period after the last state; returns seconds.

        A loop calls it while it waits for the next state; otherwise the call with that state does this first.
        """
        began = time.perf_counter()
        if self._plan is not None and self._prepared is None:
            self._prepare(self.steps)
        return time.perf_counter() - began

    def __call__(
        self, state: State, velocities: bool = False, previous: Mapping[str, object] | None = None
    ) -> MpcSolution:
        """The command for a state, by one real-time iteration.

        state: of the problem's system, as `stepper.state`, a run or system.state(…) give it, of one member.
        velocities: whether ξ and ν of the state are taken, with the model's momenta for them, as when the vehicle has
        other masses, or other water, than the model; by default the momenta of the state.
        previous: name → the command in force until now, of all inputs, from which rates and costs of changes count; by
        default that of the last plan, at first `previous` of the inputs, or their guess. Raises ArgumentError for
        anything else; failures of the solver are part of the solution.
        """
        began = time.perf_counter()
        measured = self._measured(state, self.system.parameters, velocities)
        t, passed = float(state.t), self._passed(float(state.t))
        row = None if previous is None else self._row(previous, "Argument `previous`")
        if passed is None:
            self.reset()
        preparing = time.perf_counter()
        if row is not None and self._clock is not None and passed is not None:
            self._clock.inputs[passed] = row
            self._prepared = None
        if self._plan is not None and passed is not None and (self._prepared is None or self._prepared[0] != passed):
            self._prepare(passed)
        if self._prepared is not None:
            self._plan = self._prepared[1]
        preparation = time.perf_counter() - preparing
        clock = self._now(t, passed or 0, self._before if row is None else row)
        reason = self._iterate(measured, clock)
        if self._judged is not None and self._plan is not None and not reason:
            self._judged.judge(t + self.delay * self.problem.dt, *self._plan[:3], self._p)
        answer = self._answer(state, clock, reason, began, preparation)
        self.record.note(answer)
        return answer

    def _passed(self, t: float) -> int | None:
        """Steps since the last state; None beyond the end of the plan."""
        if self._clock is None:
            return 0
        passed = round((t - self._clock.t) / self.problem.dt)
        return passed if 0 <= passed < self.problem.count else None

    def _prepare(self, passed: int) -> None:
        assert self._clock is not None
        before = self._clock.inputs[passed + self.delay]
        plan = self._shifted(passed, before)
        with np.errstate(all="ignore"):
            self._prepared = passed, plan, self._expanded(plan, before)

    def _shifted(self, passed: int, before: np.ndarray) -> MotionPlan:
        """The plan some steps later, whose last input is held and whose last nodes follow from it."""
        assert self._plan is not None
        x, u, z, left = self._plan
        left = max(left - passed, self.shortest)
        if passed:
            x, u, z = (np.concatenate([rows[passed:], rows[-1:].repeat(passed, 0)]) for rows in (x, u, z))
        u = self._expanding.continuous(u, before)
        if passed:
            self._follow(x, u, z, left, max(left - passed, 0))
        return MotionPlan(x, u, z, left)

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

    def _now(self, t: float, passed: int, before: np.ndarray) -> Timeline:
        """The inputs until the plan begins; the rows of the plan follow if there are any."""
        if self._clock is None:
            return Timeline(t, np.tile(before, (1 + self.delay, 1)))
        acting = self._clock.inputs[passed : passed + 1 + self.delay]
        return Timeline(t, acting, self._clock.age + passed)

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
        self._plan, good = MotionPlan(x, u, z, still.left), self._follow(x, u, z, still.left)
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

    def _predicted(self, measured: np.ndarray, clock: Timeline) -> np.ndarray | None:
        x, z = measured, np.zeros(self._transcription.sizes[2])
        for u in clock.inputs[1:]:
            found = self._simulated(x, u, z, self._p, self.problem.dt)
            if found is None:
                return None
            x, z = found
        return x

    def _begin(self, first: np.ndarray, clock: Timeline) -> None:
        """A first plan: the motion from here under the inputs' guesses."""
        count, nz = self.problem.count, self._transcription.sizes[2]
        x, u, z = np.tile(first, (count + 1, 1)), np.tile(self._guess, (count, 1)), np.zeros((count, nz))
        u = self._expanding.continuous(np.clip(u, self._expanding.lower, self._expanding.upper), clock.inputs[-1])
        self._follow(x, u, z, count)
        self._plan = MotionPlan(x, u, z, count)

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
        self._plan = MotionPlan(x, u, plan.z - dz, plan.left)
        return ""

    def _answer(self, state: State, clock: Timeline, reason: str, began: float, preparation: float) -> MpcSolution:
        """The solution for a state: the plan that was found, or its replacement."""
        count, named = self.problem.count, self._transcription.commands
        age, row = clock.age if reason else 0, self._guess
        if not reason:
            status = "solved"
        elif self._plan is not None and self._clock is not None and age < count:
            status = "planned"
        else:
            status, row = self._instead(state)
            self._plan = None
        if self._plan is None:
            x, u, left = np.zeros((0, self._expanding.nx)), np.tile(row, (count, 1)), count
        else:
            x, u, _, left = self._plan
        inputs = np.concatenate([clock.inputs, u])
        self._clock = Timeline(clock.t, inputs, age)
        rows = named(inputs[1 : 1 + self.steps])
        command = {name: value[len(value) - self.steps] for name, value in rows.items()}
        sentence = f"No new plan: {reason}." if reason else ""
        seconds = time.perf_counter() - began - preparation
        violated = {} if reason else self._violated
        plan, nodes = named(u[:left]), x[: left + 1]
        return MpcSolution(command, rows, status, sentence, plan, nodes, clock.t, preparation, seconds, violated)

    def _instead(self, state: State) -> tuple[str, np.ndarray]:
        """The inputs without a plan."""
        if self._fallback is None:
            return "guess", self._guess
        row = self._row(self._fallback(state), "The `fallback`")
        return "fallback", np.clip(row, self._expanding.lower, self._expanding.upper)

    def _row(self, command: PyTree, what: str) -> np.ndarray:
        """Commands of all inputs as a row."""
        known = self._transcription.inputs
        if not isinstance(command, dict) or set(command) != {name for name, _ in known}:
            names = ", ".join(f"`{name}`" for name, _ in known)
            verb, did = ("return", "returned") if what == "The `fallback`" else ("be", "is")
            raise ArgumentError(f"{what} must {verb} a dictionary of {names}, but {did} {shown(command)}.")
        found = {
            name: np.broadcast_to(checks.array(command[name], f"{what}, `{name}`,", (), given.shape), given.shape)
            for name, given in known
        }
        return columns_of(self._transcription, found)

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
        if self.delay:
            raise ArgumentError("A controller with a delay has no C library: leave out `delay`.")
        if len(self._expanding.begins):
            raise ArgumentError("A controller of linear inputs has no C library: take inputs that are held.")
        if self.shortest < self.problem.count:
            raise ArgumentError("A controller whose horizon shrinks has no C library: leave out `shortest`.")
        texts = sources(self.problem, name, whole(iterations, "iterations"), {"t": "s", **(units or {})})
        return write_library(folder, name, texts, overwrite)

    def __str__(self) -> str:
        problem = self.problem
        rows = [
            ("controller", f"{problem.count} steps of {problem.dt:g} s, a period of {self.steps * problem.dt:g} s, "
                           f"a delay of {self.delay * problem.dt:g} s"),
            ("a step", f"{len(self.names)} numbers of the state, {len(self._guess)} of the inputs"),
            *self.record.rows(),
        ]  # fmt: skip
        return "\n".join(f"{name:<18}{text}" for name, text in rows)


def controller(
    problem: ProblemData,
    period: object,
    delay: object,
    iterations: Any,
    fallback: Any,
    changing: Any,
    shortest: object = None,
) -> Controller:
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
    return Controller(problem, steps, late, whole(iterations, "iterations"), fallback, least)
