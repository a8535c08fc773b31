"""Reduction of members while they step: a sink that drops records after evaluating them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.groups.attitude import UNIT
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.mechanics.copies import replace_parameters, replaced
from coadjoint.mechanics.internal_rule import InternalRule
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.simulation.dataset import Variables, reported, variables
from coadjoint.simulation.derived import Derivation
from coadjoint.simulation.sinks import Memory
from coadjoint.sweeps.sketch import Sketch
from coadjoint.texts import Table

USUAL = ("q", "euler_angles", "xi", "nu")
"""The variables whose results are kept by default."""
ANGLES = "euler_angles"
KINDS = {"final": "at the end", "least": "least", "largest": "largest", "mean": "mean"}
"""Results of a variable, over the saved nodes of a member."""
COURSE_CENTROIDS = 64
"""The number of centroids that a shard keeps for each number at each node."""
BLOCK_BYTES = 64 << 20
"""The memory for nodes of all members that are evaluated together."""
KEPT = 64
"""The most nodes whose internal states are kept."""
TOGETHER = 64
"""Members that are evaluated together. Always this many, so that no value depends on the division of members."""


class Observer:
    """The chosen variables of records, (members, …) each; traced once for every number of members."""

    def __init__(self, system: System, chosen: Sequence[str]):
        self.system, self.chosen = system, tuple(chosen)
        self._plain = replaced(system, internal=None, inputs=None)
        self._derive = Derivation(replace_parameters(system, None), TOGETHER)
        self._report: dict[int, Any] = {}

    def __call__(self, records: State, members: np.ndarray | None = None) -> Variables:
        """members: the member of each record, by default all of them in order."""
        count = len(records.t)
        members = np.arange(count) if members is None else members
        named = self._without(records, self._derive(self.system.parameters, records, members))
        if not set(self.chosen) <= {*named} and isinstance(self.system.internal, InternalRule):
            if count not in self._report:
                self._report[count] = tabulate(self._reported, records)
            for name, values in self._report[count](records).items():
                named[name] = (("time", *(f"{name}_{axis}" for axis in range(values.ndim - 1))), values)
        return {name: (named[name][0][1:], named[name][1]) for name in self.chosen}

    def _without(self, records: State, found: Mapping[str, Any]) -> Variables:
        """Warnings that are suppressed. Angles are NaN where there is no rotation, as in members that failed."""
        rotation = found.get("rotation")
        if rotation is None:
            return variables(self._plain, records, {}, lambda _: dict(found))
        good = _are_rotations(rotation)
        turned = np.where(good[:, None, None], rotation, np.eye(3))
        made = variables(self._plain, records, {}, lambda _: {**found, "rotation": turned})
        dims, angles = made[ANGLES]
        return {**made, ANGLES: (dims, np.where(good[:, None], angles, np.nan))}

    def _reported(self, records: State) -> dict[str, object]:
        assert isinstance(self.system.internal, InternalRule)
        report = self.system.internal.report

        def one(s: State) -> Table:
            return report(self.system.motion_at(s, s.inputs), self.system.parameters)

        return jax.vmap(one)(records)


def _are_rotations(R: np.ndarray) -> np.ndarray:
    """Which of these matrices, (n, 3, 3), are rotations, (n,)."""
    with np.errstate(invalid="ignore", over="ignore"):
        defect = np.max(np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)), axis=(-2, -1))
        return (defect <= UNIT) & (np.linalg.det(R) > 0)


def known(system: System, records: State) -> Variables:
    """All variables whose results can be kept, of some records."""
    derive = partial(Derivation(replace_parameters(system, None), len(records.t)), system.parameters)
    plain = replaced(system, internal=None, inputs=None)
    return {**variables(plain, records, {}, derive), **reported(system, records)}


def choose(chosen: Sequence[str], there: Mapping[str, object]) -> list[str]:
    """The variables whose results are kept; raises ArgumentError for one that a run does not have."""
    for name in chosen:
        checks.known(name, there, "variable", "[results] variables: a run")
    return list(chosen) or [name for name in USUAL if name in there] or list(there)[:1]


class Reduction(Memory):
    """A sink that keeps of every member the final, least, largest and mean value of each variable.

    courses: whether the spread over members at every node is kept as well; whole: whether all values at every node are.
    Every node is processed separately, so that results do not depend on the division of nodes into chunks.
    """

    def __init__(self, observer: Observer, states: State, courses: bool, whole: bool):
        super().__init__()
        self.observer, self.courses, self.whole = observer, courses, whole
        self.last: Any = None
        self.values: dict[str, dict[str, np.ndarray]] = {}
        self.nodes: dict[str, list[Any]] = {}
        self.rows: dict[str, list[np.ndarray]] = {}
        self.taken = np.zeros(len(states.t))
        self.internal: list[Any] = []
        self._seen, self._every = 0, 1
        size = sum(np.asarray(leaf).nbytes for leaf in jax.tree.leaves(states))
        self._length = max(int(BLOCK_BYTES // size), 1)

    @property
    def length(self) -> int:
        return self._length

    def append(self, steps: np.ndarray, records: State, monitors: Mapping[str, np.ndarray]) -> None:
        """Process the nodes at these steps, one after another."""
        self.steps.append(np.asarray(steps))
        self.monitors = self.monitors or [{}]
        for place in range(len(steps)):
            self.take(jax.tree.map(lambda rows, place=place: rows[place], records))

    def take(self, records: State) -> None:
        """Process one node of all members; failed or ended members are NaN."""
        good = np.isfinite(records.t)
        self._keep(records.internal)
        found = self.observer(records)
        for name, (_, values) in found.items():
            self._member_values(name, values, good)
            if self.courses or self.whole:
                values = np.where(_as(good, values), self.values[name]["final"], np.nan)
            if self.courses:
                self.nodes.setdefault(name, []).append(Sketch.of(values[good], COURSE_CENTROIDS))
            if self.whole:
                self.rows.setdefault(name, []).append(values)
        self.taken = self.taken + good

    def _keep(self, internal: PyTree) -> None:
        """Keep the internal states of at most KEPT nodes, evenly spaced, by which the rule judges the run."""
        if internal is not None and self._seen % self._every == 0:
            self.internal.append(jax.tree.map(lambda rows: np.asarray(rows)[None], internal))
            if len(self.internal) > KEPT:
                self.internal, self._every = self.internal[::2], 2 * self._every
        self._seen += 1

    def _member_values(self, name: str, values: np.ndarray, good: np.ndarray) -> None:
        """Angles continue over turns."""
        if name not in self.values:
            blank = np.full(values.shape, np.nan)
            self.values[name] = dict.fromkeys(("final", "least", "largest"), blank)
            self.values[name]["mean"] = np.zeros(values.shape)
        held, here = self.values[name], _as(good, values)
        if name == ANGLES:
            before = np.where(np.isfinite(held["final"]), held["final"], values)
            values = values + 2 * np.pi * np.round((before - values) / (2 * np.pi))
        held["final"] = np.where(here, values, held["final"])
        held["least"] = np.fmin(held["least"], np.where(here, values, np.nan))
        held["largest"] = np.fmax(held["largest"], np.where(here, values, np.nan))
        held["mean"] = held["mean"] + np.where(here, values, 0.0)

    def end(self, members: Sequence[int], records: State) -> None:
        """Process the nodes at which events ended members; their mean is over the previous nodes."""
        if not len(members):
            return
        taken, good = np.zeros(len(self.taken), bool), np.array(members)
        taken[good] = True
        for name, (_, values) in Observer(self.observer.system, self.observer.chosen)(records, good).items():
            spread = np.full((len(taken), *values.shape[1:]), np.nan)
            spread[good] = values
            mean = self.values[name]["mean"]
            self._member_values(name, spread, taken)
            self.values[name]["mean"] = mean

    def results(self, failed: np.ndarray) -> dict[str, np.ndarray]:
        """`final_q` … by name, (members, …): NaN of members that failed."""
        found = {}
        for name, kinds in self.values.items():
            for kind, values in kinds.items():
                values = values / np.maximum(_as(self.taken, values), 1) if kind == "mean" else values
                found[f"{kind}_{name}"] = np.where(_as(failed, values), np.nan, values)
        return found


def _as(flags: np.ndarray, values: np.ndarray) -> np.ndarray:
    return flags.reshape(-1, *(1 for _ in values.shape[1:]))
