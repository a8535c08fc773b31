"""What all predictive controllers share: the state that a plan begins at, the plan in force, and the commands of it."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.control.expansion import columns_of, limits_of
from coadjoint.control.given import Goals, changed, given_numbers, previous_values
from coadjoint.control.linearised import Simulated
from coadjoint.control.measured_state import MeasuredState
from coadjoint.control.mpc_solution import MpcSolution, Record
from coadjoint.control.problem_data import ProblemData
from coadjoint.control.problem_parts import End
from coadjoint.control.resolution import JudgedMotions
from coadjoint.control.transcribe import transcribe
from coadjoint.errors import ArgumentError, shown
from coadjoint.mechanics.state import State
from coadjoint.portable import Remade


class MotionPlan(NamedTuple):
    """Nodes x (N + 1, nx), inputs u (N, nu) and unknowns z (N, nz); left: the steps until the end of the motion; h: the
    length of those that are not of dt, s."""

    x: np.ndarray
    u: np.ndarray
    z: np.ndarray
    left: int
    h: float


@dataclass
class Timeline:
    """The schedule of inputs: `inputs`, rows (1 + d + N, nu), the one before t, those of the delay, and the plan; age:
    steps since the last solution."""

    t: float
    inputs: np.ndarray
    age: int = 0


class PlanningController(Remade, ABC):
    """A controller that plans in every period from the measured state: controller(state).command."""

    STANDING = ("system", "_goal", "_p", "record", "_plan", "_clock")

    def __init__(self, problem: ProblemData, period: int, delay: int, fallback: Callable[[State], PyTree] | None):
        self.problem, self.steps, self.delay, self._fallback = problem, period, delay, fallback
        self._transcription = transcription = transcribe(problem)
        self.names = tuple(transcription.graph.names()[i] for i in transcription.live)
        self._simulated, self._measured = Simulated(transcription), MeasuredState(transcription)
        self._judged = JudgedMotions(transcription, self._simulated) if problem.accuracy else None
        self._guess, self._lower, self._upper = (limits_of(transcription, n) for n in ("guess", "lower", "upper"))
        known = {name: one.guess if one.previous is None else one.previous for name, one in transcription.inputs}
        self._before = columns_of(transcription, known)
        self.system, self._goal, self._goals = problem.system, transcription.goal, Goals(problem, transcription.goal)
        self._p = self._numbers()
        self.record = Record()

    def reset(self) -> None:
        """Forget the plan and past inputs: the next call starts from the inputs' guesses."""
        self._plan: MotionPlan | None = None
        self._violated: dict[str, np.ndarray] = {}
        self._clock: Timeline | None = None

    def prepare(self) -> float:
        """Do what needs no state, one period after the last one; returns seconds."""
        return 0.0

    def change(self, **values: object) -> None:
        """Set parameters that `changing` names, as `system.replace` does, for all calls from now on.

        values: name → value, or name → {name: value} of a part. Raises ArgumentError for another name.
        """
        self.system = changed(self.problem, self.system, values, "this controller")
        self._p = self._numbers()
        self._make_ready(None, renewed=True)

    def aim(self, goal: End) -> None:
        """Set the goal, with the same names as the problem's `end`, for all calls from now on.

        Raises ArgumentError for other names and shapes.
        """
        self._goal = self._goals(goal)
        self._p = self._numbers()
        self._make_ready(None, renewed=True)

    def _numbers(self) -> np.ndarray:
        """The given numbers, in the order of the model's functions."""
        values = {"goal": self._goal, "previous": previous_values(self.problem, {}), "start": {}}
        return given_numbers(self.problem, self.system, values)

    def __call__(
        self, state: State, velocities: bool = False, previous: Mapping[str, object] | None = None
    ) -> MpcSolution:
        """The command for a state.

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
        self._make_ready(passed, row is not None)
        preparation = time.perf_counter() - preparing
        clock = self._now(t, passed or 0, self._before if row is None else row)
        reason = self._iterate(measured, clock)
        if self._judged is not None and self._plan is not None and not reason:
            x, u, z = self._plan[:3]
            n = self._even(self._plan)
            self._judged.judge(t + self.delay * self.problem.dt, x[: n + 1], u[:n], z[:n], self._p)
        answer = self._answer(state, clock, reason, began, preparation)
        self.record.note(answer)
        return answer

    def _passed(self, t: float) -> int | None:
        """Steps since the last state; None beyond the end of the plan."""
        if self._clock is None:
            return 0
        passed = round((t - self._clock.t) / self.problem.dt)
        return passed if 0 <= passed < self.problem.count else None

    def _now(self, t: float, passed: int, before: np.ndarray) -> Timeline:
        """The inputs until the plan begins; the rows of the plan follow if there are any."""
        if self._clock is None:
            return Timeline(t, np.tile(before, (1 + self.delay, 1)))
        acting = self._clock.inputs[passed : passed + 1 + self.delay]
        return Timeline(t, acting, self._clock.age + passed)

    def _predicted(self, measured: np.ndarray, clock: Timeline) -> np.ndarray | None:
        x, z = measured, np.zeros(self._transcription.sizes[2])
        for u in clock.inputs[1:]:
            found = self._simulated(x, u, z, self._p, self.problem.dt)
            if found is None:
                return None
            x, z = found
        return x

    def _make_ready(self, passed: int | None, renewed: bool) -> None:
        """Before the state is read, `passed` steps after the last one; renewed: whether the command in force is new."""

    @abstractmethod
    def _iterate(self, measured: np.ndarray, clock: Timeline) -> str:
        """Plan from the state that the delay ends at; returns why that failed, or an empty sentence."""

    def _lengths(self, plan: MotionPlan) -> np.ndarray:
        """The lengths of the steps of a plan, (N,), s."""
        return np.full(self.problem.count, self.problem.dt)

    def _even(self, plan: MotionPlan) -> int:
        """The count of steps of dt that a plan begins with."""
        return self.problem.count

    def _on_grid(self, plan: MotionPlan) -> np.ndarray:
        """The inputs of a plan in steps of dt, (N, nu)."""
        return plan.u

    def _of_length(self) -> str:
        return f" of {self.problem.dt:g} s"

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
            x, u, left = np.zeros((0, len(self.names))), np.tile(row, (count, 1)), count
        else:
            x, u, left = self._plan.x, self._plan.u, self._plan.left
        inputs = np.concatenate([clock.inputs, u if self._plan is None else self._on_grid(self._plan)])
        self._clock = Timeline(clock.t, inputs, count if self._plan is None else age)
        rows = named(inputs[1 : 1 + self.steps])
        command = {name: value[len(value) - self.steps] for name, value in rows.items()}
        sentence = f"No new plan: {reason}." if reason else ""
        seconds = time.perf_counter() - began - preparation
        violated = {} if reason else self._violated
        plan, nodes = named(u[:left]), x[: left + 1]
        lengths = np.full(count, self.problem.dt) if self._plan is None else self._lengths(self._plan)
        times = clock.t + self.delay * self.problem.dt + np.concatenate([[0.0], np.cumsum(lengths[:left])])
        return MpcSolution(
            command, rows, status, sentence, plan, nodes, times, float(times[-1] - times[0]), clock.t, preparation,
            seconds, violated,
        )  # fmt: skip

    def _instead(self, state: State) -> tuple[str, np.ndarray]:
        """The inputs without a plan."""
        if self._fallback is None:
            return "guess", self._guess
        row = self._row(self._fallback(state), "The `fallback`")
        return "fallback", np.clip(row, self._lower, self._upper)

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

    def __str__(self) -> str:
        problem = self.problem
        rows = [
            ("controller", f"{problem.count} steps{self._of_length()}, a period of {self.steps * problem.dt:g} s, "
                           f"a delay of {self.delay * problem.dt:g} s"),
            ("a step", f"{len(self.names)} numbers of the state, {len(self._guess)} of the inputs"),
            *self.record.rows(),
        ]  # fmt: skip
        return "\n".join(f"{name:<18}{text}" for name, text in rows)
