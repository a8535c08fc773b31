"""Sensitivities of an optimum to its data: parameters of the system, including weights of the cost, and the start."""

from __future__ import annotations

from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from scipy.sparse import csc_matrix

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.control.conditions import SolvedProgram, conditions
from coadjoint.control.numbers import known_parameter
from coadjoint.control.problem_data import ProblemData
from coadjoint.control.program import NonlinearProgram, nonlinear_program
from coadjoint.control.transcribe import transcribe
from coadjoint.control.transcription import Split, Transcription
from coadjoint.errors import ArgumentError
from coadjoint.simulation.run import Run

OF_THE_START = ("g", "q", "mu", "pi")
"""The parts of a start by which an optimum is differentiated."""


@dataclass(frozen=True)
class Sensitivity:
    """First derivatives of an optimum, by name of the datum θ; θ's own axes come last.

    cost: θ → dJ/dθ. duration: θ → dT/dθ, s. inputs: input → θ → (N, *shape, *θ). parameters: chosen parameter → θ →
    its derivative. states: θ → (N + 1, nx, *θ), in the order of `names`.
    """

    cost: dict[str, np.ndarray]
    duration: dict[str, np.ndarray]
    inputs: dict[str, dict[str, np.ndarray]]
    parameters: dict[str, dict[str, np.ndarray]]
    states: dict[str, np.ndarray]
    names: list[str]

    def __str__(self) -> str:
        rows = [
            f"{name:<18}dJ/dθ {np.array2string(value, precision=6, threshold=9)}" for name, value in self.cost.items()
        ]
        return "\n".join(["derivatives of the optimum", *rows])


def sensitivity(solution: SolvedProgram, run: Run, names: tuple[str, ...], start: tuple[str, ...]) -> Sensitivity:
    """The derivatives of an optimum, which `run` is; see `Optimum.sensitivity`."""
    problem = solution.problem
    _require(problem, names, start)
    values = {name: np.asarray(getattr(problem.system.parameters, name), float) for name in names}
    fixed = {name: (value, value) for name, value in values.items()}
    wider = replace(
        problem,
        duration=None,
        parameters={**problem.parameters, **fixed},
        changing=[name for name in problem.changing if name not in names],
    )
    transcription = transcribe(wider)
    program = nonlinear_program(transcription)
    w, multipliers, bounds = _taken_over(solution, run, transcription, values)
    data = _data(transcription, values, start)
    moved, slope = _derivatives(program, transcription, w, multipliers, bounds, np.concatenate(list(data.values()), 1))
    return _named(transcription, data, values, moved, slope)


def _require(problem: ProblemData, names: tuple[str, ...], start: PyTree) -> None:
    checks.instance(start, "start", (tuple, list), 'names of parts of a state, such as ("g", "mu")')
    for name in names:
        known_parameter(problem.system, name)
        if name in problem.parameters:
            raise ArgumentError(
                f"Parameter `{name}` is optimised with the motion, so that the optimum is not a function of it."
            )
    checks.all_known(start, OF_THE_START, "part", "Argument `start`: a state")
    if start and problem.free_start:
        raise ArgumentError("The start is optimised with the motion, so that the optimum is not a function of it.")
    if not names and not start:
        raise ArgumentError("Name the data by which the optimum is to be differentiated: parameters, or `start`.")
    if start and problem.start.from_velocities and (names or problem.parameters):
        raise ArgumentError(
            "Derivatives by parameters are those at the start's velocities, and derivatives by the start those at its "
            "momenta: ask for them one after the other."
        )


def _taken_over(
    solution: SolvedProgram, run: Run, wider: Transcription, values: dict[str, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """w of the wider program with its multipliers: those of the program that was solved, and of the start's rows."""
    narrow = transcribe(solution.problem)
    parts = narrow.split(solution.w)
    x = wider.graph.numbers(run.records)[:, wider.live]
    at = [wider.live.index(i) for i in narrow.live]
    x[:, at] = parts.x
    count = len(parts.parameters) - len(wider.eta)
    chosen, eta = np.split(parts.parameters, [count])
    p = np.concatenate([chosen, *(value.ravel() for value in values.values()), eta])
    w = wider.joined(Split(x, parts.u, parts.z, p, parts.h, parts.slack))
    (nx, _, nz, _), few, steps = wider.sizes, len(narrow.live), wider.problem.count
    dynamics, others = np.split(solution.of_rows, [steps * (nz + few)])
    rows = np.zeros((steps, nz + nx))
    rows[:, [*range(nz), *(nz + i for i in at)]] = dynamics.reshape(steps, nz + few)
    before = narrow.split(solution.of_bounds)
    bounds = np.zeros_like(x)
    bounds[:, at] = before.x
    chosen, eta = np.split(before.parameters, [count])
    p = np.concatenate([chosen, np.zeros(sum(value.size for value in values.values())), eta])
    h = before.h if wider.problem.free_duration is not None else 0.0
    of_bounds = wider.joined(Split(bounds, before.u, before.z, p, h, before.slack))
    if wider.start and not narrow.start:
        ends = sum(len(of_end.lower) for of_end in wider.end)
        inner, outer = np.split(others, [len(others) - ends])
        others = np.concatenate([inner, np.zeros(len(wider.start[0].lower)), outer])
    return w, np.concatenate([rows.ravel(), others]), of_bounds


def _data(transcription: Transcription, values: dict[str, np.ndarray], start: tuple[str, ...]) -> dict[str, np.ndarray]:
    """θ → (n, size): the direct change of w with the data, all else being held."""
    size, sizes = len(transcription.joined(transcription.zeros())), transcription.sizes
    found, first = {}, sizes[3] - len(transcription.eta) - sum(v.size for v in values.values())
    for name, value in values.items():
        columns = np.zeros((size, value.size))
        for i in range(value.size):
            parts = transcription.zeros()
            parts.parameters[first + i] = 1.0
            columns[:, i] = transcription.joined(parts)
        found[name], first = columns, first + value.size
    for part in start:
        changes = _changes(transcription, part)
        columns = np.zeros((size, len(changes)))
        for i, change in enumerate(changes):
            parts = transcription.zeros()
            parts.x[0] = change
            columns[:, i] = transcription.joined(parts)
        found[f"start {part}"] = columns
    return found


def _changes(transcription: Transcription, part: str) -> np.ndarray:
    """(size, nx): the change of x_0 with a part of the start: g with η in g exp(η), others with their own numbers.

    q, a₀ and momenta stay while g changes, n = g⁻¹q and a = g⁻¹a₀.
    """
    state, system = transcription.beginning.state, transcription.beginning.system
    group, Q, V = system.places
    if part in ("q", "pi") and not (Q.flat and Q.dim(group)):
        what = "lies on a manifold" if Q.dim(group) else "has no numbers in this system"
        raise ArgumentError(f"The optimum is asked for its derivative by the start's {part}, which {what}.")
    size = Q.dim(group) if part in ("q", "pi") else group.dim

    def numbers(change: PyTree) -> PyTree:
        by = {name: change if name == part else 0.0 for name in OF_THE_START}
        g = group.compose(state.g, group.exp(change)) if part == "g" else state.g
        moved = {"g": g, "mu": state.mu + by["mu"], "pi": state.pi + by["pi"]}
        if Q.dim(group):
            moved["n"] = Q.act(group, group.inverse(g), Q.act(group, state.g, state.n) + by["q"])
        if V.dim(group):
            moved["a"] = V.act(group, group.inverse(g), V.act(group, state.g, state.a))
        leaves = transcription.graph.leaves(state.replace(**moved))
        return jnp.concatenate([jnp.ravel(jnp.asarray(leaf, float)) for leaf in leaves])

    return np.asarray(jax.jacfwd(numbers)(jnp.zeros(size))).T[:, transcription.live]


def _derivatives(
    program: NonlinearProgram, transcription: Transcription, w: np.ndarray, rows: np.ndarray, bounds: np.ndarray,
    data: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """dw/dθ and dJ/dθ: [H Aᵀ; A 0] (dw, dλ) = −(H D, A D), dJ = (∇f + Aᵀλ) D, with D the direct change of w with the
    data."""
    found = conditions(program, transcription, w, rows, bounds)
    moving = csc_matrix(data)
    right = -np.vstack([(part @ moving).toarray() for part in (found.hessian, found.slopes)])
    moved = data.copy()
    moved[found.free] += found.solved(right)[: len(found.free)]
    return moved, found.gradient @ data


def _named(
    transcription: Transcription, data: dict[str, np.ndarray], values: dict[str, np.ndarray],
    moved: np.ndarray, slope: np.ndarray,
) -> Sensitivity:  # fmt: skip
    cost, duration, states = {}, {}, {}
    inputs: dict[str, dict[str, np.ndarray]] = {name: {} for name in transcription.taken(transcription.zeros())}
    chosen: dict[str, dict[str, np.ndarray]] = {
        name: {} for name in transcription.problem.parameters if name not in values
    }
    begin = 0
    for name, columns in data.items():
        shape = values[name].shape if name in values else (columns.shape[1],)
        end = begin + columns.shape[1]
        each = [transcription.split(column) for column in moved[:, begin:end].T]
        cost[name], begin = slope[begin:end].reshape(shape), end

        def last(rows: list[np.ndarray], shape: tuple[int, ...] = shape) -> np.ndarray:
            return np.stack(rows, axis=-1).reshape((*rows[0].shape, *shape))

        free = transcription.problem.free_duration is not None
        times = [np.asarray(one.h * transcription.problem.count if free else 0.0) for one in each]
        duration[name] = last(times)
        states[name] = last([one.x for one in each])
        for own in inputs:
            inputs[own][name] = last([transcription.taken(one)[own] for one in each])
        for own in chosen:
            chosen[own][name] = last([transcription.chosen(one)[own] for one in each])
    names = [transcription.graph.names()[i] for i in transcription.live]
    return Sensitivity(cost, duration, inputs, chosen, states, names)
