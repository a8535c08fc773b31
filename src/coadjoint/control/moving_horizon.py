"""Estimation on a moving horizon: the most likely motion given the last measurements and a prior from earlier ones.

Source: C. V. Rao, J. B. Rawlings, D. Q. Mayne, *Constrained state estimation for nonlinear discrete-time systems:
stability and moving horizon approximations*, IEEE Trans. Automat. Control 48 (2003).
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.control.arrival_cost import Arrival, Quadratic
from coadjoint.control.horizon_limits import HorizonLimits
from coadjoint.control.linearised import Simulated
from coadjoint.control.numbers import number
from coadjoint.control.problem_data import ProblemData
from coadjoint.control.requirements import prior_directions, require_convex, require_estimable
from coadjoint.control.resolution import JudgedMotions
from coadjoint.control.transcribe import transcribe
from coadjoint.control.window import HorizonMotion, SeenAtNode, Window
from coadjoint.errors import ArgumentError, OptimumError, shown
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.mechanics.internal_state import at_node
from coadjoint.mechanics.state import State
from coadjoint.portable import Remade

SETTLED = 1e-11
"""A change of all numbers after which no further iteration is taken."""


@dataclass(frozen=True, eq=False)
class StateEstimate:
    """The estimate at the time of the last measurement.

    t: s. nodes: (n + 1, nx), the numbers of the states of the horizon, in the order of the estimator's `names`; the
    last is that of t. inputs: name → (n, *shape), of its steps. iterations: the count. seconds: of the call.
    state: the `co.State` at t. covariance: (width, width), of its changes by the estimator's `directions`, infinite if
    unknown; deviations: the roots of its diagonal, by their names.
    """

    t: float
    nodes: np.ndarray
    inputs: dict[str, np.ndarray]
    iterations: int
    seconds: float
    directions: tuple[str, ...]
    _state: Callable[[np.ndarray], State] = field(repr=False)
    _cost: Quadratic = field(repr=False)
    _last: np.ndarray = field(repr=False)

    @cached_property
    def state(self) -> State:
        """The estimated state, with its momenta."""
        return self._state(self.nodes[-1])

    @cached_property
    def covariance(self) -> np.ndarray:
        """Of the changes of the state at t."""
        root, blind, units = self._cost.spread()
        found = self._last @ root
        found = found @ found.T
        last = self._last / units
        most = 1e-7 * np.linalg.norm(last, axis=1)
        unknown = np.max(np.abs(last @ blind), axis=1, initial=0.0) > most
        found[unknown] = found[:, unknown] = np.inf
        return found

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations by the names of the directions."""
        return dict(zip(self.directions, np.sqrt(np.maximum(np.diag(self.covariance), 0.0)).tolist(), strict=True))


class Estimator(Remade):
    """The most likely motion of a horizon; `co.control.Problem.estimator` makes it, and one call per node advances it.

    Over n ≤ N steps up to now, with V the prior of the first node,

        min V(x_j) + Σ_k h/2 (L(x_k, w_k) + L(x_{k+1}, w_k)) + ½ Σ_k |(h(x_k) − y_k)/σ|²,  x_{k+1} = Φ(x_k, w_k).

    When a node leaves the horizon, V moves to the next one: V(x_{j+1}) is the least cost of x_j and w_j that lead
    there, of the problem linearised about the estimate, on the tangent space of the group. Its root is propagated, and
    a direction without measurements keeps no information at all: the estimate does not move along it. In the linear
    normal case this is Kalman's filter, and his smoother inside the horizon.
    """

    STANDING = ("_motion", "_seen", "_arrival", "_t")

    def __init__(self, problem: ProblemData, steps: int, known: tuple[str, ...], iterations: int):
        self.problem, self.steps, self.known, self.iterations = problem, steps, known, iterations
        require_estimable(problem, known)
        self._transcription = transcription = transcribe(problem, wanted=lambda graph: graph.symbols.state)
        self.names = tuple(transcription.graph.names())
        columns = {one.name: one for one in transcription.columns}
        free = [range(one.begin.start, one.begin.stop) for name, one in columns.items() if name not in known]
        self._columns, self._free = columns, np.array(list(chain.from_iterable(free)), int)
        self._window = Window(transcription, steps, self._free)
        require_convex(self._window)
        self._limits = HorizonLimits(self._window)
        self._simulated = Simulated(transcription)
        self._judged = JudgedMotions(transcription, self._simulated) if problem.accuracy else None
        tangents = self._window.tangents
        self.directions = (
            *(f"eta[{i}]" for i in range(tangents.dim)),
            *(self.names[i] for i in range(len(self.names)) if not tangents.dim or i not in tangents.moved),
        )
        self._at_node: Callable[[State], State] | None = None
        self.reset()

    def _state(self, numbers: np.ndarray) -> State:
        """A state of the problem's system by its numbers, with the velocities of its momenta."""
        start, system = self.problem.start, self._transcription.beginning.system
        there = self._transcription.graph.filled(start, numbers).replace(from_velocities=False)
        if self._at_node is None:
            self._at_node = tabulate(lambda state: at_node(system, state), there)
        return self._at_node(there)

    def reset(self) -> None:
        """Forget all measurements: the next call begins at the start of the problem."""
        w, start = self._window, self._transcription.graph.numbers(self._transcription.beginning.state)
        self._motion = HorizonMotion(start[None, :].copy(), np.zeros((0, w.nu)), np.zeros((0, w.nz)))
        self._seen: list[SeenAtNode] = []
        self._arrival = self._prior(start)
        self._t = float(self.problem.start.t)

    def __call__(
        self, measured: Mapping[str, PyTree] | None = None, inputs: Mapping[str, PyTree] | None = None
    ) -> StateEstimate:
        """The estimate at the next node; the first call is at the start.

        measured: name → the measurement there, NaN or left out if there was none. inputs: name → value of each input
        declared as `known`, held over the step that ended there; none at the first call. Raises ArgumentError for other
        names and shapes, OptimumError if the model has no step from the estimate.
        """
        began = time.perf_counter()
        seen = self._read({} if measured is None else measured)
        row = self._row({} if inputs is None else inputs)
        try:
            with np.errstate(all="ignore"):
                if self._seen:
                    self._go_on(row)
                self._seen.append(seen)
                count, cost, last = self._iterate()
        except np.linalg.LinAlgError:
            raise OptimumError(
                f"The equations of a step have no slope about the estimate at {self._t:g} s: `reset` forgets it."
            ) from None
        w, motion = self._window, self._motion
        if self._judged is not None:
            self._judged.judge(self._t - motion.steps * self.problem.dt, *motion, w.p)
        named = self._transcription.commands(motion.u) if motion.steps else {}
        return StateEstimate(
            self._t, motion.x.copy(), named, count, time.perf_counter() - began, self.directions,
            self._state, cost, last if len(last) else np.zeros((w.tangents.width, 0)),
        )  # fmt: skip

    def _read(self, measured: Mapping[str, PyTree]) -> SeenAtNode:
        checks.mapping(measured, "measured", "a dictionary of measurements")
        values, weights = {}, {}
        for name, given in measured.items():
            checks.known(name, self.problem.measured, "measurement", "The problem")
            if given is None:
                continue
            space = self._transcription.data[name].space
            found, size = number(given, name, nan=True), space.size
            if found.size != size or np.any(np.isinf(found)):
                raise ArgumentError(f"The measurement `{name}` must be {size} finite numbers, NaN for gaps.")
            value, weight = self.problem.measured[name].seen(space, found.reshape(1, size), name)
            values[name], weights[name] = value[:, 0], weight[:, 0]
        return SeenAtNode(values, weights)

    def _row(self, inputs: Mapping[str, object]) -> np.ndarray:
        """The inputs of the step that ended: those that are known, and the guesses of the others."""
        checks.mapping(inputs, "inputs", "a dictionary of known inputs")
        expected = set(self.known) if self._seen else set()
        if set(inputs) != expected:
            names = ", ".join(f"`{name}`" for name in self.known) or "none"
            when = "" if self._seen else ", from the second call on"
            raise ArgumentError(
                f"Argument `inputs` must give the inputs that are known, {names}{when}, but gives "
                f"{shown(list(inputs))}."
            )
        row = np.zeros(self._window.nu)
        for name, one in self._columns.items():
            value = number(inputs[name], name) if name in inputs else one.given.guess
            if value.size != one.given.guess.size or not np.all(np.isfinite(value)):
                raise ArgumentError(f"Input `{name}` must be finite numbers of the shape {one.given.shape}.")
            row[one.begin] = value.ravel()
        return row

    def _go_on(self, row: np.ndarray) -> None:
        """Append a step of the model; the first node leaves a full horizon."""
        if self._motion.steps == self.steps:
            self._arrival = self._window.passed_on(self._motion, self._seen, self._arrival)
            self._motion, self._seen = HorizonMotion(*(rows[1:] for rows in self._motion)), self._seen[1:]
        x, u, z = self._motion
        guess = z[-1] if len(z) else np.zeros(self._window.nz)
        found = self._simulated(x[-1], row, guess, self._window.p, self.problem.dt)
        if found is None:
            raise OptimumError(
                f"The model has no step from the estimate at {self._t:g} s: take a smaller dt, or `reset`."
            )
        self._t += self.problem.dt
        self._motion = HorizonMotion(np.vstack([x, found[0]]), np.vstack([u, row]), np.vstack([z, found[1]]))

    def _iterate(self) -> tuple[int, Quadratic, np.ndarray]:
        """Gauss–Newton steps; returns their count, the cost of the last one, and G of the last node."""
        count, largest = 0, math.inf
        cost, last = Quadratic.of_root(np.zeros((0, 0)), np.zeros(0)), np.zeros((0, 0))
        while count < self.iterations and largest > SETTLED:
            cost, last, largest = self._step()
            count += 1
        return count, cost, last

    def _step(self) -> tuple[Quadratic, np.ndarray, float]:
        """One Gauss–Newton step; returns its cost, G of the last node, and the largest change of any number."""
        w, motion = self._window, self._motion
        e = w.expanded(motion, self._seen)
        cost, nodes = w.joined(e, motion, self._arrival, motion.steps, True)
        v = self._limits.solved(cost, nodes, motion)
        y = np.array([a + G @ v for a, G in nodes])
        du = np.zeros_like(motion.u)
        du[:, self._free] = v[self._arrival.K.shape[1] :].reshape(motion.steps, len(self._free))
        self._move(e.steps, e.T, y, du)
        return cost, nodes[-1][1], max(float(np.max(np.abs(part), initial=0.0)) for part in (y, du))

    def _move(self, steps: Any, T: np.ndarray, y: np.ndarray, du: np.ndarray) -> None:
        w, (_, u, z) = self._window, self._motion
        dx = (T @ y[:, :, None])[:, :, 0]
        if len(u):
            z = z - ((steps.E @ np.concatenate([dx[:-1], du], axis=1)[:, :, None])[:, :, 0] + steps.e)
        self._motion = HorizonMotion(w.moved(self._motion, y), u + du, z)

    def _prior(self, start: np.ndarray) -> Arrival:
        """The prior of the start: its changes with η, by its deviations."""
        w = self._window
        _, inverses = w.directions(*w.padded(self._motion)[:2])
        K, weights = prior_directions(self._transcription, start, inverses[0])
        prior = Quadratic.of_root(np.diag(np.sqrt(weights)), np.zeros(len(weights)))
        return Arrival(start.copy(), inverses[0].copy(), np.zeros(len(K)), K, prior)
