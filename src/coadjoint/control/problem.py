"""The problem of an optimal motion, and its solution."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from coadjoint import checks
from coadjoint.checks import whole
from coadjoint.control.built import BuiltProgram, threads_of
from coadjoint.control.free_duration import FreeDurationController
from coadjoint.control.moving_horizon import Estimator
from coadjoint.control.optimum import Optimum
from coadjoint.control.predictive import Controller, controller
from coadjoint.control.problem_data import ProblemData
from coadjoint.control.problem_parts import End
from coadjoint.control.regulator import Regulator, regulator
from coadjoint.control.requirements import steps_of
from coadjoint.control.solve import settings_of
from coadjoint.errors import ArgumentError, OptimumError
from coadjoint.mechanics.state import State
from coadjoint.overview import NumberRow, Overview, WithOverview, listed
from coadjoint.paths import paths
from coadjoint.simulation.run import Run


@dataclass(frozen=True, eq=False, repr=False)
class Problem(WithOverview, ProblemData):
    """The motion of least cost from `start`, by N steps of a method, whose equations are the constraints:

        min Σ_k h/2 (L(x_k, u_k) + L(x_{k+1}, u_k)) + M(x_N)   subject to
        r(x_k, u_k, z_k) = 0, x_{k+1} = Φ(x_k, u_k, z_k), bounds, and the end,

    with the equations r of a step and the step Φ that `co.simulate` solves and takes, exact derivatives of both, and
    group elements that stay on their group by its own multiplication (discrete mechanics and optimal control).

        problem = co.control.Problem(
            body, body.state(), dt=0.05, duration=5.0,
            inputs={"torque": co.control.Input((3,), lower=-1, upper=1)},
            cost=lambda motion, p: 0.5 * motion.inputs.torque @ motion.inputs.torque,
            end=co.control.End(g=co.attitude.zyx(2.5, 0, 0), xi=[0, 0, 0]))
        optimum = problem.solve()
        print(optimum), optimum.run.plot.budget()

    Arguments:
        system: a `co.System` whose forces, ℓ or rule read the inputs.
        start: the state at t = t₀.
        dt: h, s. duration, steps: of the motion, as in `co.simulate`.
        method: any with fixed steps, also compositions; by default `co.Midpoint()`.
        inputs: name → `co.control.Input` or `co.control.Profile`; other values are signals and functions of the motion,
            as in `co.simulate`.
        cost: L(motion [, p]), a number a second, of the `co.mechanics.NodeMotion`; by default none.
        final_cost: M(motion [, p]), a number, of the last node; by default none.
        path: name → `co.control.Bounds`, at every node; by default none.
        path_points: the number of points inside each step at which `path` holds as well, evenly spaced, by default 0.
            Each adds the equations of a part of the step, so that the constrained path is that of
            `optimum.run.at(times)`.
        accuracy: whether the resolution by dt is judged, by default True, with one warning and a dt that would: of the
            run of an optimum, when it is made, of plans of a controller and of motions of an estimator, at a sample of
            calls.
        end: a `co.control.End`, or a function (motion [, p]) that is zero at the last node; by default free.
        free_duration: (shortest, longest) duration, s: then h is chosen as well, N stays. By default fixed.
        parameters: names of parameters of the system that are optimised → (lower, upper).
        free_start: parts of the start that are optimised, of "g" (η in g exp(η)), "q", and "xi", "qdot" or "mu", "pi" →
            standard deviation σ, which adds ½|η/σ|² to the cost; math.inf if unknown. By default none.
        measured: name → `co.control.Measured`, whose misfit is added to the cost; by default none.
        changing: names of parameters that `solve` and `controller.change` may set without building the program anew, by
            default none.
        terminal: a `co.control.Regulator`, whose cost ½ eᵀVe of the last node, and set, if it has one, count as well;
            by default none.

    Raises ArgumentError and LagrangianError. Source: Ober-Blöbaum, Junge, Marsden (2011) on discrete mechanics and
    optimal control; the equations of a step are (P43), (P44).
    """

    def _overview(self) -> Overview:
        facts = {
            "of": f"{self.system.name} on {self.system.group!r}",
            "steps": f"{self.count:,} of {self.dt:g} s, {self.method.title}",
            "optimised": listed([*self.inputs, *self.parameters, *(f"start {part}" for part in self.free_start)]),
            "cost": listed(
                name.replace("_", " ") for name in ("cost", "final_cost") if getattr(self, name) is not None
            ),
            "measured": listed(self.measured),
            "path": listed(self.path),
            "end": "" if self.end is None else "given",
            "duration": "" if self.free_duration is None else "{:g} to {:g} s".format(*self.free_duration),
        }
        units = dict(self.system.units)
        given = {} if self.system.parameters is None else paths(self.system.parameters)
        return Overview(
            "Problem", facts, tuple(NumberRow(name, one, units.get(name, "")) for name, one in given.items())
        )

    @cached_property
    def _built(self) -> BuiltProgram:
        """Its program, with the functions and solvers of CasADi."""
        return BuiltProgram(self)

    def __getstate__(self) -> dict[str, object]:
        return {name: one for name, one in self.__dict__.items() if name != "_built"}

    def solve(
        self,
        guess: Run | Optimum | str | None = None,
        *,
        start: State | None = None,
        goal: End | None = None,
        parameters: Mapping[str, object] | None = None,
        previous: Mapping[str, object] | None = None,
        guesses: int = 1,
        solver: str = "ipopt",
        tolerance: float = 1e-9,
        max_iterations: int = 500,
        verbose: bool = False,
        options: Mapping[str, object] | None = None,
    ) -> Optimum:
        """The optimum, which `co.simulate` simulates again where its run is read.

            problem.solve()
            problem.solve(start=body.state(xi=[0.1, 0, 0]), goal=co.control.End(g=turn, xi=[0, 0, 0]))

        The first call traces the functions of the problem and builds its program; all others only solve it, also for
        another start, goal or parameters.

        Arguments:
            guess: the start of the solver: a run of as many steps, an optimum of this problem, "interpolate",
                "simulate", or None, which interpolates on the group where the end gives g or q, and simulates
                otherwise.
            start: another start, a state of the same system, by default that of the problem.
            goal: a `co.control.End` with the same names as `end`, by default that of the problem.
            parameters: name → value of parameters that `changing` names; by default those of the system.
            guesses: the number of guesses, by default 1: after the first one the other way round, where the end is a
                rotation, and random ones about it, the same in every call. The result has the least cost, and
                `optimum.guesses` all.
            previous: name → the command in force, of inputs with `previous`; by default that of the input.
            solver: "ipopt" (the default) or "fatrop".
            tolerance: of the solver's optimality and of the constraints, by default 1e-9.
            max_iterations: by default 500.
            verbose: whether the solver prints its iterations, by default False.
            options: more options for `casadi.nlpsol`, those of the solver in {solver: {…}}; by default none.

        Raises OptimumError if no optimum was found, with the constraint that is violated most; ArgumentError and
        LagrangianError for ill-posed problems.
        """
        settings = settings_of(solver, tolerance, max_iterations, verbose, options)
        case = self._built.case(start, goal, parameters, previous, guess)
        if whole(guesses, "guesses") > 1:
            found = self._built.best(case, settings, guesses)
        else:
            found = (self._built.solved if guess is not None else self._built.solved_around)(case, settings)
        return found

    def solve_each(
        self,
        starts: Sequence[State] | None = None,
        goals: Sequence[End] | None = None,
        parameters: Sequence[Mapping[str, object]] | None = None,
        *,
        previous: Sequence[Mapping[str, object]] | None = None,
        guesses: Sequence[Run | Optimum | str | None] | None = None,
        threads: int | None = None,
        solver: str = "ipopt",
        tolerance: float = 1e-9,
        max_iterations: int = 500,
        options: Mapping[str, object] | None = None,
    ) -> list[Optimum | OptimumError]:
        """The optimum for each start, goal and set of parameters, on threads; an `OptimumError` where there is none.

            optima = problem.solve_each(starts=[body.state(xi=[w, 0, 0]) for w in speeds])

        Arguments:
            starts, goals, parameters, previous, guesses: n values each, as those of `solve`; by default those of the
                problem for all.
            threads: by default one for each processor. Results do not depend on it.
            solver, tolerance, max_iterations, options: as in `solve`.

        Raises ArgumentError for values that `solve` does not take.
        """
        settings = settings_of(solver, tolerance, max_iterations, False, options)
        given = {"starts": starts, "goals": goals, "parameters": parameters, "previous": previous, "guesses": guesses}
        named = {name: one for name, one in given.items() if one is not None}
        counts = {name: len(checks.instance(one, name, (list, tuple), "a list")) for name, one in named.items()}
        if len(set(counts.values())) != 1:
            raise ArgumentError(f"Arguments {', '.join(given)} must be lists of one length, but have {counts}.")
        n = next(iter(counts.values()))
        rows = zip(*([None] * n if one is None else one for one in given.values()), strict=True)
        cases = [self._built.case(*row) for row in rows]
        return self._built.solved_each(cases, settings, threads_of(threads, n))

    def estimator(self, horizon: float | None = None, *, known: Sequence[str] = (), iterations: int = 1) -> Estimator:
        """Estimation on a moving horizon: `estimator(measured)` at every node returns the state there.

            estimator = problem.estimator(horizon=2.0, known=("thrust",))
            estimate = estimator({"depth": 1.3}, inputs={"thrust": 4.0})

        Arguments:
            horizon: its length, s; by default the duration of the problem.
            known: names of inputs that are given at every step, by default none; the others are disturbances, which
                `cost` weighs.
            iterations: steps of Gauss and Newton in each call, by default 1.

        `free_start` is the prior of the start; of `measured` only the functions and their deviations count, and the
        values may be None. Raises ArgumentError and LagrangianError for problems that cannot be estimated.
        """
        steps = self.count if horizon is None else steps_of(horizon, self.dt, "horizon", 1)
        self._require_no_points("An estimator")
        names = (known,) if isinstance(known, str) else known
        checks.texts(names, "known", 'names of inputs, such as ("thrust",)')
        measured = {name: replace(one, values=None, times=None) for name, one in self.measured.items()}
        problem = replace(self, duration=None, steps=steps, measured=measured)
        return Estimator(problem, steps, tuple(names), whole(iterations, "iterations"))

    def controller(
        self,
        horizon: float | None = None,
        period: float | None = None,
        *,
        delay: float = 0.0,
        iterations: int = 1,
        fallback: Callable[[State], object] | None = None,
        changing: Sequence[str] = (),
        shortest: float | None = None,
    ) -> Controller | FreeDurationController:
        """Model predictive control of this problem: `controller(state)` is the command for a state, by one iteration.

            controller = problem.controller(horizon=2.0, period=0.1)
            stepper.step(controller(stepper.state).command)

        Arguments:
            horizon: its length, s; by default the duration of the problem.
            period: the time for which each solution acts, s, a multiple of dt; by default one step.
            delay: the time from a state to the start of its plan, s, a multiple of dt up to the period; until then the
                previous solution acts. By default 0.
            iterations: quadratic programs in each call, by default 1.
            fallback: state → {name: command}, the inputs without a plan; by default the inputs' guesses.
            changing: names of further parameters that `controller.change` may set from period to period, by default
                none.
            shortest: s, a multiple of dt: the end of the first plan is kept, and the horizon shrinks until it is that
                short; by default it recedes.

        With `free_duration` each call solves the problem to its optimum, by IPOPT, from the last plan less the elapsed
        time; `duration` of the solution is the time that is left. The shortest one must exceed the period: from there
        on the plan recedes. A soft `end` has a plan also where a hard one is out of reach. `iterations` and `shortest`
        are then left out.

        The start of the problem only gives its system and internal state. Raises ArgumentError and LagrangianError for
        unsuitable problems.
        """
        self._require_no_points("A controller")
        problem = self
        if horizon is not None:
            problem = replace(self, duration=None, steps=steps_of(horizon, self.dt, "horizon", 1))
        return controller(problem, period, delay, iterations, fallback, changing, shortest)

    def regulator(self, at: State | None = None, inputs: Mapping[str, object] | None = None) -> Regulator:
        """The linear-quadratic regulator about a state at rest, for this cost over an endless horizon.

            regulator = problem.regulator(body.state(g=goal))
            controller = replace(problem, duration=None, steps=10, terminal=regulator).controller(fallback=regulator)

        Arguments:
            at: the state, by default the start.
            inputs: name → the command that holds it, by default the guesses.

        Of a linear system with quadratic costs a controller with this terminal cost is the regulator itself, until a
        bound is reached. `terminal=regulator.inside()` also imposes the set in which the regulator keeps the bounds of
        all inputs. `end`, `path`, `final_cost`, rates and costs of changes do not count. Raises ArgumentError for a
        state that moves, for a cost that is not least there, and where no regulator exists.
        """
        return regulator(self, at, inputs)

    def _require_no_points(self, what: str) -> None:
        checks.leave_out(
            self.path_points, "`path_points`, and take a smaller dt", f"{what} imposes `path` at its nodes alone"
        )
