"""The local error of single steps: one step of h against steps of parts of it, from the same record."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from coadjoint.kernels.run.probe import Probe
from coadjoint.mechanics.over_step import HELD
from coadjoint.mechanics.state import State
from coadjoint.methods.program import INPUTS_HELD, Constants
from coadjoint.simulation.accuracy.metric import Difference, differences, relative, sizes_of
from coadjoint.simulation.driver import Plan

HALVES = (0.5, 0.5)
UNEVEN = (0.382, 0.618)
"""Parts in no simple ratio: what repeats at h and at h/2 alike, such as a sampled signal, does not repeat here."""


class Errors(NamedTuple):
    """Local errors of steps, relative to the motion of the run over a step, a row each, and the part that is worst."""

    local: np.ndarray
    largest: np.ndarray
    """The larger of those by halves and by uneven parts."""
    part: list[str]
    good: np.ndarray


class Doubling:
    """Judges steps of a plan from records: inputs, noise and sampled controllers stay as they are over a step.

    An actuator that follows a command moves on between the parts of a step, as the rule of the internal state says.
    """

    def __init__(self, plan: Plan, state: State, axes: Any = None, count: int = 1):
        self.plan, self.order = plan, plan.program.method.order
        constants = plan.constants
        if constants.renewal is not None:
            constants = Constants(constants.system, constants.monitors, INPUTS_HELD)
        self.probe = Probe(plan.backend, plan.program, constants, state, plan.watches, axes, count)
        layout = self.probe.layout
        self.places: Any = layout.unpack(np.arange(layout.size))
        system = plan.program.skeleton
        variable = plan.program.method.variable
        self._memory = (
            [int(i) for leaf in jax.tree.leaves(self.places.memory) for i in np.ravel(leaf)] if variable else []
        )
        of = self.places.internal, self.places.internal_mean, self.places.internal_end
        self.courses = [following(place, system.internal) for place in of] if system.internal is not None else [[]] * 3
        self.following = [place for course in self.courses for place in course]

    def packed(self, records: State) -> np.ndarray:
        """Records with a leading axis as rows of numbers."""
        count = len(records.t)
        return np.concatenate([np.asarray(x, float).reshape(count, -1) for x in jax.tree.leaves(records)], axis=1)

    def over(self, rows: np.ndarray, h: np.ndarray, parts: Sequence[float], members: Any = None):
        """The rows after steps of the parts of h one after another, and whether all of them were solved."""
        due, memory = self.places.internal_due, self._memory
        if due is None and not memory and len(set(parts)) == 1:
            found = self.probe(rows, h * parts[0], len(parts), members)
            return found.after, found.code == 0
        good, begun = np.ones(len(rows), bool), rows
        for number, part in enumerate(parts):
            if number:
                rows = np.array(rows)
                rows[:, memory] = begun[:, memory]
            if due is not None and part != 1.0:
                rows = self._followed(rows, h * part, members)
            rows, _, code = self.probe(rows, h * part, 1, members)
            good &= code == 0
        return rows, good

    def _followed(self, rows: np.ndarray, h: np.ndarray, members: Any) -> np.ndarray:
        """The rows as records of steps of h, with the rule applied to what follows the motion or a command."""
        due, kept = self.places.internal_due, np.array(rows)
        if self.following:
            kept[:, due] = 1.0
            found = self.probe(kept, h, 1, members).record
            kept[:, self.following] = found[:, self.following]
        kept[:, due] = 0.0
        return kept

    def errors(
        self, rows: np.ndarray, h: np.ndarray, members: Any = None, sizes: Any = None, at_least: bool = False
    ) -> tuple[Errors, dict[str, float]]:
        """Local errors of the steps of h (rows,) from every row, and what they are relative to.

        These are `sizes`, by default those of these steps; `at_least`: or those of these steps, where larger.
        """
        whole, good = self.over(rows, h, (1.0,), members)
        by_halves, good_halves = self.over(rows, h, HALVES, members)
        by_uneven, good_uneven = self.over(rows, h, UNEVEN, members)
        good = good & good_halves & good_uneven
        if not good.any():
            return Errors(np.zeros(0), np.zeros(0), [], good), {}
        begun, one, parts = ((rows, rows), (whole, whole), (by_halves, by_uneven))
        found = self.compare(*(np.concatenate([x[good], y[good]]) for x, y in (begun, one, parts)))
        own = sizes_of(found) if sizes is None or at_least else {}
        sizes = own if sizes is None else {name: max(size, own.get(name, 0.0)) for name, size in sizes.items()}
        apart, parts = relative(found, sizes)
        count = len(apart) // 2
        local, other = apart[:count] / self._shrinks(HALVES), apart[count:] / self._shrinks(UNEVEN)
        part = [parts[i] if local[i] >= other[i] else parts[count + i] for i in range(count)]
        return Errors(local, np.maximum(local, other), part, good), sizes

    def compare(self, begun: np.ndarray, one: np.ndarray, other: np.ndarray) -> list[Difference]:
        """What separates rows."""
        return differences(*(self.probe.layout.unpack(rows) for rows in (begun, other, one)))

    def _shrinks(self, parts: Sequence[float]) -> float:
        """1 − Σ part^{p+1}: what the difference to steps of the parts is of the local error, of order p + 1."""
        order = min(self.order, 2) if self.following else self.order
        return 1.0 - sum(part ** (order + 1) for part in parts)


def following(places: Any, rule: Any) -> list[int]:
    """The numbers of an internal state that follow the motion or a command, rather than jump at nodes.

    What `co.sampled` advances jumps, and what the rule names in its attribute `jumping`, such as noise.
    """
    jumping = set(getattr(rule, "jumping", ()))
    found: list[int] = []

    def visit(tree: Any, name: str) -> None:
        if hasattr(tree, "asdict"):
            parts = tree.asdict()
            if parts.keys() >= HELD:
                return
            for key, part in parts.items():
                if name or key not in jumping:
                    visit(part, f"{name}.{key}")
        elif tree is not None:
            found.extend(int(i) for i in np.ravel(tree))

    visit(places, "")
    return found
