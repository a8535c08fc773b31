"""An optimal motion: the solution of the solver, simulated again by `co.simulate`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.control.boundary_conditions import moved_start
from coadjoint.control.conditions import SolvedProgram, deviations
from coadjoint.control.inputs_between import at_end, flown_inputs
from coadjoint.control.library import casadi
from coadjoint.control.problem_parts import Input
from coadjoint.control.program import NonlinearProgram
from coadjoint.control.sensitivity import Sensitivity, sensitivity
from coadjoint.control.transcription import Split, Transcription
from coadjoint.control.within_steps import WorstWithin, lines, worst_within
from coadjoint.errors import OptimumError, StepError, warn
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.plotting.plots import Plots
from coadjoint.simulation.accuracy.resolution import accuracy_warnings
from coadjoint.simulation.run import Run
from coadjoint.simulation.simulate import simulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROUND_OFF = 1e-13
"""The largest violation of a step that counts as none."""

UNSTABLE = (
    "the run leaves the optimum by more than ten times the sum of the violations of all steps: the motion is unstable, "
    "or the tolerance too large"
)
SADDLE = (
    "the solver ended where the cost is stationary but no minimum: a motion nearby costs less; `guesses=4` looks for it"
)
STATIONARY = (
    "the solver ended at its initial guess, where the cost is stationary: another guess shows whether that is a minimum"
)


@dataclass(frozen=True, eq=False)
class Optimum:
    """The result of `Problem.solve`; `print` shows a summary, with the certificate of the run below.

    run: the motion, simulated by `co.simulate` with the optimum's inputs when `run`, `difference`, `within` or the
    summary is first read, which also judges its accuracy. inputs: name → (N, *shape), held over each
    step; (N + 1, *shape) at the nodes of linear ones; θ of a profile. cost: the least value found. duration: s.
    parameters: name → value, of the optimised ones. residuals: of measurements, name → (K, …), (function − y)/σ, NaN
    for gaps. costates: (N, nx), the multipliers of x_{k+1} = Φ, in the order of `names`. violation: the largest
    violation of the constraints. difference: the largest |x − x of the run| of any number of the state. iterations, and
    seconds of building, solving: of the solver. violated: name → the violation of each soft constraint at its nodes,
    (N + 1, rows), "end g" and so on of the end, (1, rows). minimum: whether the solver saw a strict minimum there, by
    the inertia of its last step. guesses: name of each guess of `solve(guesses=n)` → the cost it led to, or why it led
    to none. within: name → the largest violation of a constraint of the path between the nodes of the run, the violated
    bound, and its time.
    """

    inputs: dict[str, np.ndarray]
    cost: float
    duration: float
    parameters: dict[str, np.ndarray]
    residuals: dict[str, np.ndarray]
    costates: np.ndarray
    names: list[str]
    violation: float
    iterations: int
    build_seconds: float
    solve_seconds: float
    solver: str
    solution: SolvedProgram
    violated: dict[str, np.ndarray]
    minimum: bool
    guesses: dict[str, float | str]
    _fly: Callable[[], OptimalMotion] | None = field(repr=False)

    @cached_property
    def _flown(self) -> OptimalMotion:
        assert self._fly is not None
        return self._fly()

    @property
    def run(self) -> Run:
        """The motion with the optimum's inputs, by `co.simulate`; raises OptimumError if it cannot be simulated."""
        return self._flown.run

    @property
    def plot(self) -> Plots:
        """The figures of the run; `plot.inputs()` shows the inputs against the bounds of the problem."""
        return OptimumPlots(self.run.dataset, self.solution.problem.inputs)

    @property
    def difference(self) -> float:
        """The largest |x − x of the run| of any number of the state."""
        return self._flown.difference

    @property
    def within(self) -> dict[str, WorstWithin]:
        """Name → the largest violation of a constraint of the path between the nodes of the run."""
        return self._flown.within

    def __getstate__(self) -> dict[str, Any]:
        _ = self._flown
        return {**self.__dict__, "_fly": None}

    def sensitivity(self, *names: str, start: tuple[str, ...] = ()) -> Sensitivity:
        """The first derivatives of the optimum by its data, from the conditions that it satisfies.

        names: of parameters θ of the system, weights of the cost among them, at the velocities of the start where it
            was given by these; arrays count by each of their numbers.
        start: parts of the start, of "g" (η in g exp(η), while q, a₀, μ and π stay), "q", "mu", "pi", as the method
            begins with them; by default none.

        Raises ArgumentError for unknown names, OptimumError if the optimum has no derivative: if a bound is only just
        reached, or if it is not strict. Source: Fiacco (1983), Introduction to Sensitivity and Stability Analysis in
        Nonlinear Programming.
        """
        return sensitivity(self.solution, self.run, names, (start,) if isinstance(start, str) else start)

    def deviations(self) -> dict[str, np.ndarray]:
        """Standard deviations of the chosen parameters and of the start ("start g", in η of g exp(η), and so on).

        Where the cost is minus the logarithm of a likelihood, as ½|w/σ|² of measurements and disturbances, they are
        those of the normal distribution that touches it at the optimum (Laplace): the roots of the diagonal of the
        inverse of its second derivative along the motions. 0 for numbers at a bound.

        Raises ArgumentError without measurements or unknowns, OptimumError if the measurements do not determine the
        unknowns.
        """
        return deviations(self.solution)

    def __str__(self) -> str:
        rows = [
            ("optimum", f"cost {self.cost:.9g} over {self.duration:.6g} s, {len(self.run.records.t) - 1} steps"),
            ("solver", f"{self.solver}, {self.iterations} iterations in {self.solve_seconds:.3g} s, "
                       f"built in {self.build_seconds:.3g} s"),
            ("constraints", f"violated by at most {self.violation:.1e}; the run differs from the optimum by at most "
                            f"{self.difference:.1e}"),
            *soft_lines(self.violated, float(self.run.records.t[0]), self.duration),
            *lines(self.within, self.solution.problem.path_points),
            *((f"parameter {name}", f"{np.array2string(value, precision=6)}")
              for name, value in self.parameters.items()),
        ]  # fmt: skip
        for name, values in self.residuals.items():
            known = values[np.isfinite(values)]
            rows.append((f"measured {name}", f"{known.size} numbers, {np.sqrt(np.mean(known**2)):.3g} σ in the mean "
                                             f"square, {np.max(np.abs(known)):.3g} σ at most"))  # fmt: skip
        steps = len(self.run.records.t) - 1
        if self.difference > 10 * steps * max(self.violation, ROUND_OFF):
            rows.append(("warning", UNSTABLE))
        if self.guesses:
            rows.append(("guesses", guesses_line(self.guesses)))
        if not self.minimum:
            rows.append(("warning", SADDLE))
        if self.iterations == 0:
            rows.append(("warning", STATIONARY))
        return "\n".join(f"{name:<18}{text}" for name, text in rows) + f"\n\n{self.run}"


def guesses_line(guesses: dict[str, float | str]) -> str:
    """The spread of the optima that several guesses led to."""
    costs = {name: one for name, one in guesses.items() if isinstance(one, float)}
    best = min(costs, key=costs.__getitem__)
    found = f"{len(costs)} of {len(guesses)} led to an optimum"
    return f"{found}, costs {costs[best]:.9g} (`{best}`) to {max(costs.values()):.9g}"


def soft_lines(violated: dict[str, np.ndarray], begin: float, duration: float) -> list[tuple[str, str]]:
    """The summary of soft constraints, as names and texts."""
    found = []
    for name, rows in violated.items():
        most, node = float(np.max(rows, initial=0.0)), int(np.argmax(np.max(rows, axis=1, initial=0.0)))
        at = f" at t = {begin + duration * node / (len(rows) - 1):.4g} s" if len(rows) > 1 else ""
        text = f"`{name}` is violated by at most {most:.3g}{at}" if most > 1e-6 else f"`{name}` holds"
        found.append(("soft constraint", text))
    return found


class OptimumPlots(Plots):
    """Figures of an optimum, whose inputs have bounds."""

    def __init__(self, dataset: Any, inputs: Mapping[str, PyTree]):
        super().__init__(dataset)
        self._bounds = {name: one for name, one in inputs.items() if isinstance(one, Input)}

    def inputs(self, *others: object, bounds: Mapping[str, object] | None = None, **more: Any) -> Figure:
        return super().inputs(*others, bounds=self._bounds if bounds is None else bounds, **more)


class OptimalMotion(NamedTuple):
    """The run of an optimum, its difference from the solution, and the violations of the path between its nodes."""

    run: Run
    difference: float
    within: dict[str, WorstWithin]


class Flight(NamedTuple):
    """The run of an optimum, and the solver's choice of inputs and of parameters."""

    run: Run
    inputs: dict[str, np.ndarray]
    parameters: dict[str, np.ndarray]


def chosen_system(transcription: Transcription, parts: Split) -> System:
    """The system with the optimal parameters."""
    chosen, system = transcription.chosen(parts), transcription.problem.system
    return system.replace(**chosen) if chosen else system


def flight(transcription: Transcription, parts: Split, start: State | None = None) -> Flight:
    """The motion with the optimal inputs and parameters, by `co.simulate`, from its own start or another."""
    problem = transcription.problem
    commands, chosen = transcription.taken(parts), transcription.chosen(parts)
    system = chosen_system(transcription, parts)
    start = moved_start(problem, system, transcription.moved_by(parts)) if start is None else start
    inputs = flown_inputs(problem.inputs, commands, float(start.t), parts.h)
    try:
        run = simulate(
            system, start, dt=parts.h, steps=problem.count, method=problem.method, inputs=inputs,
            progress=False, accuracy=problem.accuracy,
        )  # fmt: skip
    except StepError as error:
        raise OptimumError(
            f"The optimum cannot be simulated: {error.sentence} Take a smaller dt, so that the steps stay in their "
            "chart."
        ) from error
    for told in accuracy_warnings(run):
        warn(told, stacklevel=6)
    return Flight(run, commands, chosen)


def difference(transcription: Transcription, run: Run, parts: Split) -> float:
    """The largest |x − x of the run| of any number of the state."""
    rows = transcription.graph.numbers(run.records)[:, transcription.live]
    return float(np.max(np.abs(rows - parts.x), initial=0.0))


def violation(program: NonlinearProgram, g: np.ndarray) -> float:
    """The largest violation of the constraints by the solver."""
    lower, upper = program.limits
    return float(np.max(np.maximum(np.maximum(lower - g, g - upper), 0.0), initial=0.0))


def flown(
    transcription: Transcription, program: NonlinearProgram, numbers: dict[str, np.ndarray], iterations: int,
    seconds: tuple[float, float], solver: str, minimum: bool,
) -> Optimum:  # fmt: skip
    """The optimum from the solution of the solver: x, f, g and the multipliers lam_g."""
    problem, parts = transcription.problem, transcription.split(numbers["x"])

    def fly() -> OptimalMotion:
        run = flight(transcription, parts).run
        return OptimalMotion(run, difference(transcription, run, parts), worst_within(problem, run))

    (nx, _, nz, _), names = transcription.sizes, transcription.graph.names()
    equations = numbers["lam_g"][: problem.count * (nx + nz)].reshape(problem.count, -1)
    return Optimum(
        transcription.taken(parts), float(numbers["f"][0]), parts.h * problem.count, transcription.chosen(parts),
        _residuals(transcription, parts), equations[:, nz:],
        [names[i] for i in transcription.live],
        violation(program, numbers["g"]), iterations, *seconds, solver,
        SolvedProgram(problem, numbers["x"], numbers["lam_g"], numbers["lam_x"]),
        transcription.violated(parts), minimum, {}, fly,
    )  # fmt: skip


def _residuals(transcription: Transcription, parts: Split) -> dict[str, np.ndarray]:
    """(function ⊖ y)/σ by names, (K, …)."""
    u = np.vstack([parts.u, parts.u[-1:, at_end(transcription.inputs)]])
    found, p = {}, transcription.numbers(parts.parameters)
    for name, (nodes, values, weights, _) in transcription.data.items():
        each = [casadi().DM(rows[nodes].T) for rows in (parts.x, u)]
        numbers = [casadi().repmat(casadi().DM(value), 1, len(nodes)) for value in (p, parts.h)]
        function = transcription.functions.measured[name].map(len(nodes))
        off = function(*each, *numbers, casadi().DM(values)).full()
        standard, measured = np.where(weights > 0, off * weights, np.nan).T, transcription.problem.measured[name]
        found[name] = standard.reshape(np.shape(measured.values)) if measured.space is None else standard
    return found
