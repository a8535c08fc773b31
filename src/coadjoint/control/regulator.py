"""The linear-quadratic regulator about a state at rest, in the directions of its group: a terminal cost and set.

    ½ eᵀVe = min Σ_k ½ w_kᵀ H w_k,  w = (e, δu),  e_{k+1} = A e_k + B δu_k,  e = (log g_*⁻¹g, x − x_*),

with the Jacobians A, B of a step at the state and the second derivative H of the cost of a step. V solves the discrete
Riccati equation, and δu = −K e.

Source: D. Q. Mayne, J. B. Rawlings, C. V. Rao, P. O. M. Scokaert, *Constrained model predictive control: stability and
optimality*, Automatica 36 (2000).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import jax
import jax.numpy as jnp
import numpy as np
from scipy.linalg import solve_discrete_are

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.control.expansion import Expanding, limits_of
from coadjoint.control.functions import of_columns
from coadjoint.control.linearised import Simulated, Tables
from coadjoint.control.problem_data import ProblemData
from coadjoint.control.problem_parts import Input
from coadjoint.control.requirements import require_controllable
from coadjoint.control.stage import PARTS, numbers_of, parts_of
from coadjoint.control.transcribe import transcribe
from coadjoint.control.transcription import Transcription
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.trace.tracer import Tracer
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.simulation.arguments import require_places

STILL = 1e-8
"""The largest motion of a step from a state at rest, and slope of the cost there, of the size of its numbers."""


NEUTRAL = 1e-9
"""The distance of a pole from 1 that counts as none."""


@dataclass(frozen=True, eq=False)
class Regulator:
    """The regulator of a problem about a state at rest; `co.control.Problem.regulator` makes it.

    at: the state. inputs: name → the command that holds it. gain: K (inputs, directions). cost: V (directions,
    directions). poles: the eigenvalues of A − B K. level: the largest c for which δu = −K e keeps the bounds of all
    inputs where ½ eᵀVe ≤ c, infinite without bounds. within: c of the terminal set ½ eᵀVe ≤ c of a problem with this
    regulator, by default infinite.

    regulator(state) are the commands u_* − K e, between the bounds of the inputs: a `fallback` of a controller.
    """

    at: State
    inputs: dict[str, np.ndarray]
    gain: np.ndarray
    cost: np.ndarray
    poles: np.ndarray
    level: float
    directions: DirectionsFromRest
    bounds: tuple[np.ndarray, np.ndarray]
    within: float = field(default=np.inf)

    def inside(self, level: float | None = None) -> Regulator:
        """With the terminal set ½ eᵀVe ≤ level, by default that in which the inputs keep their bounds."""
        chosen = self.level if level is None else level
        return replace(self, within=checks.positive(chosen, "level"))

    def __call__(self, state: State) -> dict[str, np.ndarray]:
        """The commands for a state, (shape of the input) each."""
        begun = np.concatenate([np.ravel(one) for one in self.inputs.values()])
        u = np.clip(begun - self.gain @ self.directions.of(state), *self.bounds)
        sizes = np.cumsum([one.size for one in self.inputs.values()])[:-1]
        parts = zip(self.inputs.items(), np.split(u, sizes), strict=True)
        return {name: own.reshape(np.shape(one)) for (name, one), own in parts}

    def value(self, state: State) -> float:
        """½ eᵀVe of a state."""
        e = self.directions.of(state)
        return 0.5 * float(e @ self.cost @ e)


@dataclass(frozen=True, eq=False)
class DirectionsFromRest:
    """e of a state: log g_*⁻¹g where the motion depends on all of g, and the differences of its other numbers.

    like: the state g_*, x_*. back: g_*⁻¹, None if the numbers of g are among the others. rest: the places of the
    others. there: their values.
    """

    system: System
    like: State
    back: PyTree
    rest: np.ndarray
    there: np.ndarray

    def __call__(self, system: System, state: State) -> Array:
        leaves = jax.tree_util.tree_leaves(parts_of(state))
        numbers = jnp.concatenate([jnp.ravel(jnp.asarray(leaf)) for leaf in leaves])
        others = numbers[self.rest] - self.there
        if self.back is None:
            return others
        group = system.group
        return jnp.concatenate([group.log(group.compose(self.back, state.g)), others])

    def __getstate__(self) -> dict[str, object]:
        return {name: one for name, one in self.__dict__.items() if name != "_table"}

    def of(self, state: State) -> np.ndarray:
        """e, (directions,); raises ArgumentError for a state of another system."""
        checks.instance(state, "state", State, "a co.State of the regulator's system")
        require_places(state, self.system.places, "state")
        if np.ndim(state.t):
            raise ArgumentError("Argument `state` must be of one member, but has many.")
        return self._table(numbers_of(parts_of(state)))[0][0].copy()

    @cached_property
    def _table(self) -> Tables:
        def function(parts: tuple[PyTree, ...]) -> Array:
            return self(self.system, self.like.replace(**dict(zip(PARTS, parts, strict=True))))

        return Tables(of_columns(Tracer(), "The directions", function, {"state": parts_of(self.like)}), 1)


def regulator(problem: ProblemData, at: State | None, inputs: Mapping[str, object] | None) -> Regulator:
    """The regulator of a problem; the arguments are those of `Problem.regulator`."""
    require_controllable(problem)
    if any(getattr(one, "course", "") == "linear" for one in problem.inputs.values()):
        raise ArgumentError("A regulator chooses inputs that are held over each step: leave out linear ones.")
    held = _held(problem, inputs)
    start = problem.start if at is None else checks.instance(at, "at", State, "a co.State of the problem's system")
    chosen = {name: replace(one, guess=held[name], previous=None, rate=np.inf, change_cost=0.0)
              if isinstance(one, Input) else one for name, one in problem.inputs.items()}  # fmt: skip
    bare = replace(
        problem, duration=None, steps=1, start=start, inputs=chosen, path={}, end=None, final_cost=None, terminal=None
    )
    transcription = transcribe(bare)
    expanding = Expanding(transcription, floor=0.0)
    A, B, H = _linear(transcription, expanding)
    K, V = _riccati(A, B, H)
    bounds = limits_of(transcription, "lower"), limits_of(transcription, "upper")
    u = np.concatenate([np.ravel(held[name]) for name, _ in transcription.inputs])
    gain = expanding.scale[:, None] * K
    level = _level(gain, V, np.minimum(bounds[1] - u, u - bounds[0]))
    names = {name: held[name] for name, _ in transcription.inputs}
    poles = np.linalg.eigvals(A - B @ K)
    return Regulator(start, names, gain, V, poles, level, _directions(transcription, expanding), bounds)


def _held(problem: ProblemData, inputs: Mapping[str, object] | None) -> dict[str, np.ndarray]:
    """The commands that hold the state, by default the guesses."""
    known = {name: one for name, one in problem.inputs.items() if isinstance(one, Input)}
    given = {} if inputs is None else inputs
    checks.mapping(given, "inputs", "a dictionary of name → command")
    checks.all_known(given, known, "co.control.Input", "The problem")
    found = {}
    for name, one in known.items():
        value = given.get(name, one.guess)
        found[name] = np.broadcast_to(checks.array(value, f"Argument `inputs`, `{name}`,", (), one.shape), one.shape)
    return found


def _linear(transcription: Transcription, expanding: Expanding) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A, B and H of a step from the state; raises ArgumentError unless it is at rest and the cost least there."""
    problem, nz = transcription.problem, transcription.sizes[2]
    x = transcription.graph.numbers(transcription.beginning.state)[transcription.live]
    u, p = limits_of(transcription, "guess"), transcription.numbers(np.zeros(0))
    found = Simulated(transcription)(x, u, np.zeros(nz), p, problem.dt)
    moved = np.inf if found is None else float(np.max(np.abs(found[0] - x), initial=0.0))
    if found is None or moved > STILL * (1.0 + np.max(np.abs(x), initial=0.0)):
        raise ArgumentError(
            f"A regulator holds a state at rest, but this one moves by {moved:.2g} in a step: give a state without "
            "velocities, and `inputs` that balance the forces there."
        )
    rows = np.stack([x, x])
    stages = expanding(rows, u[None], found[1][None], p, u, 1).stages
    nx, M = expanding.width, stages.M[0]
    g, H = stages.g[0] + M.T @ stages.last_g, stages.H[0] + M.T @ stages.last_H @ M
    if np.max(np.abs(g), initial=0.0) > STILL * max(1.0, float(np.max(np.abs(H), initial=0.0))):
        raise ArgumentError(
            f"A regulator needs a `cost` that is least at the state, but its slope there is {np.max(np.abs(g)):.2g}: "
            "let the cost count from this state, and from the commands that hold it."
        )
    return M[:, :nx], M[:, nx:], H


def _riccati(A: np.ndarray, B: np.ndarray, H: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """K and V; raises ArgumentError if there is none."""
    nx, poles = len(A), np.ones(1)
    K, V = np.zeros((B.shape[1], nx)), np.zeros_like(A)
    try:
        V = solve_discrete_are(A, B, H[:nx, :nx], H[nx:, nx:], s=H[:nx, nx:])
        K = np.linalg.solve(H[nx:, nx:] + B.T @ V @ B, B.T @ V @ A + H[nx:, :nx])
        poles = np.linalg.eigvals(A - B @ K)
    except (np.linalg.LinAlgError, ValueError):
        pass
    if not np.max(np.abs(poles), initial=0.0) < 1 - NEUTRAL:
        raise ArgumentError(
            "No regulator holds this state: `cost` must grow with every command, and each unstable or neutral motion "
            "must be seen by `cost` and moved by an input."
        )
    return K, 0.5 * (V + V.T)


def _level(gain: np.ndarray, V: np.ndarray, room: np.ndarray) -> float:
    """The largest c with |K_i e| ≤ room_i for all e of ½ eᵀVe ≤ c."""
    reach = np.einsum("ij,ji->i", gain, np.linalg.solve(V, gain.T))
    bounded = np.isfinite(room) & (reach > 0)
    return float(np.min(room[bounded] ** 2 / (2 * reach[bounded]), initial=np.inf))


def _directions(transcription: Transcription, expanding: Expanding) -> DirectionsFromRest:
    state, tangents = transcription.beginning.state, expanding.tangents
    places = np.array(transcription.live)[tangents.rest]
    there = transcription.graph.numbers(state)[places]
    back = evaluate(transcription.problem.system.group.inverse, state.g) if tangents.dim else None
    return DirectionsFromRest(transcription.problem.system, state, back, places, there)
