"""Initial guesses of a solver: states, velocities and momenta that fit each other."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import partial, reduce
from typing import Any, TypeVar

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.control.geodesics import Geodesics
from coadjoint.control.given import goal_place
from coadjoint.control.inputs_between import guesses
from coadjoint.control.linearised import Simulated
from coadjoint.control.problem_data import ProblemData
from coadjoint.control.problem_parts import End
from coadjoint.control.stage import numbers_of
from coadjoint.control.transcription import Split, Transcription
from coadjoint.errors import ArgumentError, StepError
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.start import legendre
from coadjoint.mechanics.state import State
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.methods.rattle import around
from coadjoint.simulation.run import Run
from coadjoint.simulation.simulate import simulate

BEND = 0.5
"""The size of random bends of a guess, of its own extent."""

BENT, MISSED = 2, 1e-5
"""The count of bent guesses among others, and the violation of a soft end that counts as a miss."""

FAILS = (
    "The motion with the inputs' guesses, where the solver would begin, fails ({}): give another `guess`, or a smaller "
    "dt."
)
T = TypeVar("T")


def least(found: Iterable[T], cost: Callable[[T], float], ends: Callable[[T], bool]) -> T | None:
    """The solution of least cost of those from one guess after the other, until the best `ends` where it should."""
    best = None
    for one in found:
        best = one if best is None or cost(one) < cost(best) else best
        if ends(best):
            break
    return best


class Guesses:
    """Starts of the solver for a transcription; what JAX traces for them is traced once."""

    def __init__(self, transcription: Transcription):
        self._transcription = transcription
        self._simulated: Simulated | None = None
        self._geodesics = Geodesics(transcription.problem.system.group, transcription.problem.count + 1)
        self._straight, self._stages = _Traced(), _Traced()

    def motion(self, problem: ProblemData, guess: Run | str | None) -> tuple[State, dict[str, np.ndarray]]:
        """The states of all nodes at the start of the solver, and the known inputs there.

        problem: that of the transcription, or with another start, goal or parameters.
        guess: a run of the same number of steps, every node saved; "simulate", the motion with the inputs' guesses;
        "interpolate", along exp(s log g₀⁻¹g_N) on the group and a straight line in q, with s = 3τ² − 2τ³, so that it
        rests at both ends; None, interpolated where the end gives g or q, otherwise simulated.
        """
        if isinstance(guess, Run):
            return _of_run(problem, self._transcription, guess)
        return (self._interpolated if named(problem, guess) == "interpolate" else _simulated)(problem), {}

    def variables(self, problem: ProblemData, guess: Run | str | None, first: np.ndarray) -> np.ndarray:
        """The variables (n,) at the start of the solver, from the first node (nx,) on."""
        transcription = self._transcription
        if not isinstance(guess, Run) and named(problem, guess) == "simulate" and problem is not transcription.problem:
            return self._marched(problem, first)
        states, known = self.motion(problem, guess)
        return self.of_motion(problem, states, known, first)

    def of_motion(
        self, problem: ProblemData, states: State, known: dict[str, np.ndarray], first: np.ndarray
    ) -> np.ndarray:
        """The variables (n,) of a motion from the first node (nx,) on; unknown inputs have their guesses."""
        transcription = self._transcription
        x = transcription.graph.numbers(states)[:, transcription.live]
        x[0] = first
        before = jax.tree.map(lambda leaf: np.asarray(leaf)[:-1], states)
        return _joined(transcription, problem, x, self._z(problem, before), known)

    def other_way(self, problem: ProblemData, w: np.ndarray) -> np.ndarray | None:
        """The variables of the motion to the goal the other way round; None where the goal is no rotation.

        w: the variables of the first guess, whose first node is taken.
        """
        group, Q = problem.system.group, problem.system.additional
        if named(problem, None) != "interpolate" or (Q.dim(group) and not Q.flat):
            return None
        turn, (g, _) = self._turned(problem), goal_place(problem)
        angle = float(np.linalg.norm(turn))
        if not 1e-6 < angle < 2 * np.pi:
            return None
        back = turn * (1 - 2 * np.pi / angle)
        there = evaluate(lambda a, xi: group.matrix(group.compose(a, group.exp(xi))), problem.start.g, back)
        if np.max(np.abs(there - evaluate(group.matrix, g))) > 1e-9:
            return None
        first = self._transcription.split(w).x[0]
        return self.of_motion(problem, self._interpolated(problem, back), {}, first)

    def others(self, problem: ProblemData, w: np.ndarray, first: np.ndarray) -> Iterator[np.ndarray]:
        """The variables of further guesses after the default one w: the simulated motion, and w bent."""
        if named(problem, None) != "simulate":
            with suppress(ArgumentError):
                yield self.variables(problem, "simulate", first)
        for seed in range(BENT):
            yield bent(self._transcription, w, seed)

    def _interpolated(self, problem: ProblemData, turn: np.ndarray | None = None) -> State:
        """The motion along a geodesic on the group, by a turn, and a line in q, at rest at both ends."""
        start, (group, Q, _) = problem.start, problem.system.places
        if Q.dim(group) and not Q.flat:
            raise ArgumentError('A curved space of q has no straight lines: take guess="simulate", or a run.')
        turn = self._turned(problem) if turn is None else turn
        q = goal_place(problem)[1]
        g = self._geodesics.along(start.g, turn, _eased(problem)[0])
        given = start.replace(memory=None), g, q, turn, problem.system.parameters
        return self._straight(partial(_straight, problem), *given)

    def _turned(self, problem: ProblemData) -> np.ndarray:
        """log g₀⁻¹g_N, (dim G,)."""
        return self._geodesics.turn(problem.start.g, goal_place(problem)[0])

    def _z(self, problem: ProblemData, states: State) -> np.ndarray:
        """z of every step, (N, nz): the start of Newton's iteration in each stage."""
        transcription = self._transcription
        given = states, transcription.beginning.state.inputs, problem.system.parameters
        found = self._stages(partial(_stages, transcription), *given)
        z = np.concatenate([np.asarray(z).reshape(len(states.t), -1) for z in found], axis=1)
        return np.tile(z, (1, 1 + transcription.problem.path_points))

    def _marched(self, problem: ProblemData, first: np.ndarray) -> np.ndarray:
        """The variables of the motion with the inputs' guesses, by the steps of the program."""
        transcription = self._transcription
        self._simulated = self._simulated or Simulated(transcription)
        nz = transcription.sizes[2]
        x, z = np.tile(first, (problem.count + 1, 1)), np.zeros((problem.count, nz))
        parts = transcription.split(_joined(transcription, problem, x, z, {}))
        p, near = transcription.numbers(parts.parameters), np.zeros(nz)
        for k in range(problem.count):
            found = self._simulated(parts.x[k], parts.u[k], near, p, parts.h)
            if found is None:
                raise ArgumentError(FAILS.format(f"step {k} has no solution"))
            parts.x[k + 1], near = found
            parts.z[k] = near
        return transcription.joined(parts)


def bent(transcription: Transcription, w: np.ndarray, seed: int) -> np.ndarray:
    """Variables moved by random bends of the motion, which leave its ends, and by random constant inputs."""
    generator, parts = np.random.default_rng(seed), transcription.split(w)

    def moved(rows: np.ndarray, tau: np.ndarray) -> np.ndarray:
        size = BEND * (0.1 + np.ptp(rows, axis=0)) * generator.standard_normal(rows.shape[1])
        return rows + np.sin(np.pi * tau)[:, None] * size

    N = transcription.problem.count
    x, z = moved(parts.x, np.linspace(0, 1, N + 1)), moved(parts.z, (np.arange(N) + 0.5) / N)
    u = parts.u + BEND * (0.1 + np.ptp(parts.u, axis=0)) * generator.standard_normal(parts.u.shape[1])
    return transcription.joined(parts._replace(x=x, u=u, z=z))


def misses_end(violated: Mapping[str, np.ndarray]) -> bool:
    """Whether a motion with these violations of soft constraints misses its end."""
    return any(np.max(one, initial=0.0) > MISSED for name, one in violated.items() if name.startswith("end "))


class _Traced:
    """A function that is traced once for each kind of arguments."""

    def __init__(self) -> None:
        self._found: dict[tuple[object, ...], Callable[..., Any]] = {}

    def __call__(self, function: Callable[..., Any], *arguments: object) -> Any:
        leaves, structure = jax.tree.flatten(arguments)
        key = structure, *map(np.shape, leaves)
        if key not in self._found:
            self._found[key] = tabulate(function, *arguments)
        return self._found[key](*arguments)


def named(problem: ProblemData, guess: object) -> str:
    """The name of a guess that is not a run."""
    end = problem.end
    if guess is None:
        placed = isinstance(end, End) and (end.g is not None or end.q is not None)
        return "interpolate" if placed else "simulate"
    checks.instance(guess, "guess", str, "a run, a name or None")
    checks.choice(guess, "Argument `guess`, if it is not a run,", ("interpolate", "simulate"))
    return str(guess)


def _joined(
    transcription: Transcription,
    problem: ProblemData,
    x: np.ndarray,
    z: np.ndarray,
    known_inputs: dict[str, np.ndarray],
) -> np.ndarray:
    """The variables (n,) of nodes x and unknowns z; unknown inputs and profiles have their guesses."""
    _, nu, _, _ = transcription.sizes
    u = np.zeros((problem.count, nu))
    for name, given, begin, end in transcription.columns:
        nodes = np.broadcast_to(np.ravel(given.guess), (problem.count + 1, given.guess.size))
        nodes = np.clip(known_inputs.get(name, nodes), np.ravel(given.lower), np.ravel(given.upper))
        u[:, end], u[:, begin] = nodes[1:], nodes[:-1]
    known = problem.system.parameters
    parameters = [numbers_of(getattr(known, name)) for name in problem.parameters]
    theta = [np.clip(one.guess, one.lower, one.upper).ravel() for one in transcription.profiles.values()]
    numbers = np.concatenate([*theta, *parameters, np.zeros(len(transcription.eta))])
    h = problem.dt if problem.free_duration is None else float(np.clip(problem.length, *problem.free_duration))
    h = h if problem.free_duration is None else h / problem.count
    return transcription.joined(Split(x, u, z, numbers, h))


def _stages(transcription: Transcription, states: State, inputs: PyTree, parameters: PyTree) -> Any:
    """The starts of Newton's iteration in all stages of the steps from some states."""
    system, method, h, _ = transcription.beginning
    program = StepProgram(system, method)
    steps = [step for step, _ in around(system, method.stages)]

    def of_step(one: State) -> Any:
        one = one.replace(memory=None, inputs=inputs, ledger=None)
        here = replace_parameters(system, parameters)
        begun = reduce(lambda found, step: step.remember(here, found), steps, one)
        constants = Constants(parameters, {})
        return [
            stage.guess(constants, begun, part * stage.fraction * h)
            for part in program.substeps
            for stage in program.stages
        ]

    return jax.vmap(of_step)(states)


def _of_run(problem: ProblemData, transcription: Transcription, run: Run) -> tuple[State, dict[str, np.ndarray]]:
    """The states of a run, and its inputs at all nodes, (N + 1, size), by their names."""
    records = run.records
    if np.size(records.t) != problem.count + 1 or records.places != problem.system.places:
        raise ArgumentError(
            f"Argument `guess` must be a run of this system with {problem.count} steps, every node saved, but has "
            f"{np.size(records.t)} records."
        )
    if run.system.inputs is None or run.system.inputs.names is None:
        return records, {}
    values = evaluate(jax.vmap(run.system.inputs_at), records.t, records.inputs).asdict()
    found = {}
    for name, given in transcription.inputs:
        if name in values and np.shape(values[name])[1:] == given.shape:
            found[name] = np.reshape(values[name], (problem.count + 1, -1))
    return records, found


def _simulated(problem: ProblemData) -> State:
    try:
        run = simulate(
            problem.system, problem.start, dt=problem.dt, steps=problem.count, method=problem.method,
            inputs=guesses(problem.inputs),
            monitors=False, accuracy=False, progress=False,
        )  # fmt: skip
    except StepError as error:
        raise ArgumentError(FAILS.format(error.sentence)) from error
    return run.records


def _eased(problem: ProblemData) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """s from 0 to 1 at the nodes, its rate, 1/s, and the part of the duration."""
    tau = np.linspace(0.0, 1.0, problem.count + 1)
    return tau**2 * (3 - 2 * tau), 6 * tau * (1 - tau) / problem.length, tau


def _straight(problem: ProblemData, start: State, g: Element, goal: Array, turn: Array, parameters: PyTree) -> State:
    """The states at g₀ exp(s turn), as given, and q₀ + s (goal − q₀), with the momenta of their velocities."""
    system = replace_parameters(problem.system, parameters)
    group, Q, V = system.places
    s, speed, tau = _eased(problem)
    q, a0 = Q.act(group, start.g, start.n), V.act(group, start.g, start.a)

    def node(g: Element, s: Scalar, speed: Scalar, t: Scalar) -> State:
        xi = speed * turn
        back, here = group.inverse(g), q + s * (goal - q)
        n, nu, a = Q.act(group, back, here), Q.push(group, back, here, speed * (goal - q)), V.act(group, back, a0)
        mu, pi = legendre(system, xi, n, nu, a, t, start.inputs, start.internal)
        return start.replace(t=t, g=g, n=n, a=a, mu=mu, pi=pi, xi=xi, nu=nu)

    return jax.vmap(node)(g, s, speed, start.t + problem.length * tau)
