"""Where episodes begin: starts and parameters that are drawn for each of them, some of them ahead of time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import Prepared, legendre, replace_parameters, tabulate
from coadjoint.groups import attitude
from coadjoint.mechanics import State
from coadjoint.mechanics.members import each, stacked
from coadjoint.spaces import Named
from coadjoint_vehicles.environments.nested import nested
from coadjoint_vehicles.environments.simulated import Simulated
from coadjoint_vehicles.model.craft import Craft

AHEAD, FEW, BLOCK = 4, 64, 256
"""How many episodes of each member are drawn at a time, how many in all at least, because many together cost hardly
more than one, and how many starts are begun together."""
LARGEST = 2**31
"""Seeds of random currents are below."""
KEYS = ("position", "euler_zyx", "velocity", "speed", "angular_velocity")


class Episodes:
    """The episodes of `count` members; every member has independent random numbers."""

    def __init__(self, simulated: Simulated):
        self.simulated = simulated
        self.count = 1 if simulated.members is None else simulated.members
        self.ahead = max(AHEAD, FEW // self.count)
        """How many episodes of each member are drawn at a time."""
        self.random: list[np.random.Generator | None] = [None] * self.count
        self.varying: list[np.random.Generator | None] = [None] * self.count
        self.begun = np.zeros(self.count, np.int64)
        """How many episodes of each member have begun, and how many are prepared."""
        self.ready = np.zeros(self.count, np.int64)
        self._states, self._parameters = np.zeros((0, 0)), None
        self._started: Callable[..., State] | None = None

    def __getstate__(self) -> dict[str, object]:
        """The state without the function that is traced again."""
        return {**self.__dict__, "_started": None}

    def seed(self, member: int, random: np.random.Generator, varying: np.random.Generator) -> None:
        """Restart the random numbers of a member: those of starts, and those of parameters."""
        self.random[member], self.varying[member] = random, varying
        self.ready[member] = self.begun[member]

    def begin(self, members: np.ndarray) -> None:
        """The next episodes of these members begin."""
        if np.any(self.ready[members] == self.begun[members]):
            self._prepare()
        rows = members * self.ahead + self.begun[members] % self.ahead
        self.simulated.stepper.begin(Prepared(self._states, self._parameters), rows, members)
        self.begun[members] += 1

    def begin_at(self, members: np.ndarray, given: object) -> None:
        """Episodes begin at one start that is given, as `Task.start` gives it, with parameters that are drawn."""
        drawn = [(self._checked(given), self._drawn(int(m))) for m in members]
        for first in range(0, len(members), self.block):
            part = self._block(drawn[first : first + self.block], members[first : first + self.block])
            here = members[first : first + self.block]
            self.simulated.stepper.begin(part, np.arange(len(here)), here)

    @property
    def block(self) -> int:
        return min(BLOCK, self.count * self.ahead)

    def _prepare(self) -> None:
        """Draw episodes for all members until each has self.ahead of them."""
        slots = [
            (member, number)
            for member in np.flatnonzero(self.ready < self.begun + self.ahead)
            if self.random[member] is not None
            for number in range(self.ready[member], self.begun[member] + self.ahead)
        ]
        for first in range(0, len(slots), self.block):
            part = slots[first : first + self.block]
            drawn = [(self._start(int(member)), self._drawn(int(member))) for member, _ in part]
            made = self._block(drawn, np.array([member for member, _ in part]))
            rows = np.array([member * self.ahead + number % self.ahead for member, number in part])
            self._keep(rows, made)
        self.ready = np.where([one is not None for one in self.random], self.begun + self.ahead, self.ready)

    def _keep(self, rows: np.ndarray, made: Prepared) -> None:
        size = self.count * self.ahead
        if not len(self._states):
            self._states = np.zeros((size, made.states.shape[1]))
            self._parameters = None if made.parameters is None else np.zeros((size, made.parameters.shape[1]))
        self._states[rows] = made.states[: len(rows)]
        if self._parameters is not None and made.parameters is not None:
            self._parameters[rows] = made.parameters[: len(rows)]

    def _start(self, member: int) -> dict[str, PyTree]:
        random = self.random[member]
        assert random is not None
        return self._checked(self.simulated.task.start(random))

    def _drawn(self, member: int) -> tuple[dict[str, PyTree], int]:
        """Parameters by paths, and the seed of a random current."""
        random, varying = self.random[member], self.varying[member]
        assert random is not None and varying is not None
        found = dict(self.simulated.task.parameters(random)) if self.simulated.drawn else {}
        seed = int(random.integers(LARGEST)) if self.simulated.craft.water.start() else 0
        return {**found, **(self.simulated.uncertain(varying) if self.simulated.uncertain else {})}, seed

    def _checked(self, given: Any) -> dict[str, PyTree]:
        """Position, attitude, velocity through the water and ω of a start; raises ArgumentError."""
        checks.instance(given, "A start", Mapping, f"a dictionary of {', '.join(KEYS)}")
        checks.all_known(given, KEYS, "key", "A start")
        if "speed" in given and "velocity" in given:
            raise ArgumentError("A start has one of `speed` and `velocity`, not both.")
        found = {name: _three(given.get(name, (0.0, 0.0, 0.0)), name) for name in KEYS if name != "speed"}
        if "speed" in given:
            found["velocity"] = _three((given["speed"], 0.0, 0.0), "speed")
        return found

    def _block(
        self, drawn: list[tuple[dict[str, PyTree], tuple[dict[str, PyTree], int]]], members: np.ndarray
    ) -> Prepared:
        """The starts of these episodes, begun; the rest of the block is like the last."""
        craft, stepper = self.simulated.craft, self.simulated.stepper
        filled = drawn + drawn[-1:] * (self.block - len(drawn))
        starts = {name: np.array([start[name] for start, _ in filled]) for name in filled[0][0]}
        parameters = craft.parameters
        paths = filled[0][1][0]
        if paths:
            values = {path: each(np.array([found[path] for _, (found, _) in filled])) for path in paths}
            parameters = parameters.replace(**nested(values))
        seeds = np.array([seed for _, (_, seed) in filled])
        states = self._states_of(parameters, starts, seeds)
        return stepper.prepared(states, parameters if paths else None)

    def _states_of(self, parameters: PyTree, starts: dict[str, np.ndarray], seeds: np.ndarray) -> State:
        craft, base = self.simulated.craft, self.simulated.base
        R = attitude.zyx(*starts["euler_zyx"].T)
        internal = base.internal
        if internal is not None:
            internal = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (self.block, *np.shape(leaf))).copy(), internal)
            internal = craft.rule.seeded(internal, seeds) if craft.water.start() else internal
        values, axes = stacked(parameters)
        given = values, R, starts["position"], starts["velocity"], starts["angular_velocity"], internal
        if self._started is None:
            function = jax.vmap(starting(craft, base), in_axes=(axes, 0, 0, 0, 0, None if internal is None else 0))
            self._started = tabulate(function, *given)
        return self._started(*given)


def starting(craft: Craft, base: State) -> Callable[..., State]:
    """(p, R, position, velocity through the water, ω, internal) → the state of `Craft.start`, in jax.numpy."""
    group, Q, V = craft.system.places
    a0 = np.asarray(V.act(group, base.g, base.a))

    def start(p: PyTree, R: Array, position: PyTree, velocity: PyTree, omega: Array, internal: Named) -> State:
        memory = internal.water if craft.water.start() else None
        back = group.inverse(R)
        n, a = Q.act(group, back, position), V.act(group, back, a0)
        nu = velocity + back @ craft.water.current(position, base.t, memory, p.water)
        here = replace_parameters(craft.system, p)
        mu, pi = legendre(here, omega, n, nu, a, base.t, base.inputs, internal)
        ends = None if base.internal_mean is None else internal
        return base.replace(
            g=R, n=n, a=a, mu=mu, pi=pi, xi=omega, nu=nu, internal=internal, internal_mean=ends, internal_end=ends
        )

    return start


def _three(value: object, name: str) -> np.ndarray:
    try:
        found = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        found = np.asarray(None)
    fits = found.shape == (3,) and all(map(math.isfinite, found.tolist()))
    checks.expect(fits, value, f"`{name}` of a start", "three finite numbers")
    return found
