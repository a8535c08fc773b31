"""Initial guesses of a solver: states, velocities and momenta that fit each other."""

from __future__ import annotations

from functools import reduce
from typing import Any

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.control.boundary_conditions import end_state, spatial
from coadjoint.control.inputs_between import guesses
from coadjoint.control.problem_data import End
from coadjoint.control.stage import numbers_of
from coadjoint.control.transcription import Split, Transcription
from coadjoint.errors import ArgumentError, GroupError, StepError
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.members import each
from coadjoint.mechanics.state import State
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.methods.rattle import around
from coadjoint.simulation.run import Run
from coadjoint.simulation.simulate import simulate

ASIDE = -1e-3
"""The distance of a guess from half a turn, in 𝔤."""


def guessed(transcription: Transcription, guess: Run | str | None) -> np.ndarray:
    """The variables (n,) at the start of the solver."""
    return variables(transcription, *guessed_motion(transcription, guess))


def guessed_motion(transcription: Transcription, guess: Run | str | None) -> tuple[State, dict[str, np.ndarray]]:
    """The states of all nodes at the start of the solver, and the known inputs there.

    guess: a run of the same number of steps, every node saved; "simulate", the motion with the inputs' guesses;
    "interpolate", along exp(s log g₀⁻¹g_N) on the group and a straight line in q, with s = 3τ² − 2τ³, so that it rests
    at both ends; None, interpolated where the end gives g or q, otherwise simulated.
    """
    end = transcription.problem.end
    if guess is None:
        placed = isinstance(end, End) and (end.g is not None or end.q is not None)
        guess = "interpolate" if placed else "simulate"
    if isinstance(guess, Run):
        return _of_run(transcription, guess)
    checks.instance(guess, "guess", str, "a run, a name or None")
    checks.choice(guess, "Argument `guess`, if it is not a run,", ("interpolate", "simulate"))
    return (_interpolated if guess == "interpolate" else _simulated)(transcription), {}


def variables(transcription: Transcription, states: State, known_inputs: dict[str, np.ndarray]) -> np.ndarray:
    """The variables (n,) of a motion; unknown inputs have their guesses."""
    problem, graph = transcription.problem, transcription.graph
    _, nu, nz, _ = transcription.sizes
    x = graph.numbers(states)[:, transcription.live]
    x[0] = graph.numbers(transcription.beginning.state)[transcription.live]
    u = np.zeros((problem.count, nu))
    for name, given, begin, end in transcription.columns:
        nodes = np.broadcast_to(np.ravel(given.guess), (problem.count + 1, given.guess.size))
        nodes = np.clip(known_inputs.get(name, nodes), np.ravel(given.lower), np.ravel(given.upper))
        u[:, end], u[:, begin] = nodes[1:], nodes[:-1]
    z = _unknowns(transcription, jax.tree.map(lambda leaf: np.asarray(leaf)[:-1], states))
    known = transcription.beginning.system.parameters
    parameters = [numbers_of(getattr(known, name)) for name in problem.parameters]
    theta = [np.clip(one.guess, one.lower, one.upper).ravel() for one in transcription.profiles.values()]
    numbers = np.concatenate([*theta, *parameters, np.zeros(len(transcription.eta))])
    h = problem.dt if problem.free_duration is None else float(np.clip(problem.length, *problem.free_duration))
    h = h if problem.free_duration is None else h / problem.count
    return transcription.joined(Split(x, u, z.reshape(problem.count, nz), numbers, h))


def _unknowns(transcription: Transcription, states: State) -> np.ndarray:
    """z of every step, (N, nz): the start of Newton's iteration in each stage."""
    system, method, h, state = transcription.beginning
    program = StepProgram(system, method)
    steps = [step for step, _ in around(system, method.stages)]

    def of_step(one: State) -> Any:
        one = one.replace(memory=None, inputs=state.inputs, ledger=None)
        begun = reduce(lambda found, step: step.remember(system, found), steps, one)
        constants = Constants(system.parameters, {})
        return [
            stage.guess(constants, begun, part * stage.fraction * h)
            for part in program.substeps
            for stage in program.stages
        ]

    found = evaluate(jax.vmap(of_step), states)
    z = np.concatenate([np.asarray(z).reshape(len(states.t), -1) for z in found], axis=1)
    return np.tile(z, (1, 1 + transcription.problem.path_points))


def _of_run(transcription: Transcription, run: Run) -> tuple[State, dict[str, np.ndarray]]:
    """The states of a run, and its inputs at all nodes, (N + 1, size), by their names."""
    records, problem = run.records, transcription.problem
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


def _simulated(transcription: Transcription) -> State:
    problem = transcription.problem
    try:
        run = simulate(
            problem.system, problem.start, dt=problem.dt, steps=problem.count, method=problem.method,
            inputs=guesses(problem.inputs),
            monitors=False, accuracy=False, progress=False,
        )  # fmt: skip
    except StepError as error:
        raise ArgumentError(
            f"The motion with the inputs' guesses, where the solver would begin, fails ({error.sentence}): give "
            "another `guess`, or a smaller dt."
        ) from error
    return run.records


def _interpolated(transcription: Transcription) -> State:
    problem = transcription.problem
    start, target = problem.start, end_state(problem)
    group, Q, V = problem.system.places
    tau = np.linspace(0.0, 1.0, problem.count + 1)
    s, speed = tau**2 * (3 - 2 * tau), 6 * tau * (1 - tau) / problem.length
    between = evaluate(lambda a, b: group.compose(group.inverse(a), b), start.g, target.g)
    turn = _logarithm(group, between)

    def element(s: Any) -> PyTree:
        return group.compose(start.g, group.exp(s * turn))

    given: dict[str, PyTree] = {
        "g": each(evaluate(jax.vmap(element), s)),
        "xi": each(speed[:, None] * turn),
    }
    if Q.dim(group):
        q, goal = np.asarray(start.q), np.asarray(target.q)
        if not Q.flat:
            raise ArgumentError('A curved space of q has no straight lines: take guess="simulate", or a run.')
        given["q"] = jax.tree.map(each, Q.given(group, q + s[:, None] * (goal - q)))
        given["qdot"] = jax.tree.map(each, Q.given(group, speed[:, None] * (goal - q)))
    if V.dim(group):
        given["a0"] = V.given(group, spatial(start))
    if start.internal is not None:
        given["internal"] = start.internal
    states = problem.system.state(**given, inputs=start.inputs)
    return states.replace(t=float(start.t) + problem.length * tau)


def _logarithm(group: LieGroup, F: Element) -> Array:
    """ξ with exp(ξ) = F, (dim G,); of half a turn that has no logarithm, that of an element near to it."""
    try:
        return group.log(F)
    except GroupError:
        aside = evaluate(lambda F, xi: group.compose(F, group.exp(xi)), F, np.full(group.dim, ASIDE))
        return group.log(aside)
