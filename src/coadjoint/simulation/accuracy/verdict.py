"""The accuracy of a run, and the reasons against the length of some of its steps. NumPy alone."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numpy as np

from coadjoint.arrays import PyTree, Scalar
from coadjoint.simulation.accuracy.local_error import KEPT, Errors, PartsOfSteps, larger, sizes_of
from coadjoint.texts import Table


@dataclass(frozen=True, repr=False)
class Accuracy:
    """The accuracy of a run at the judged steps, one row each.

    `steps` are their indices, `times` in s, `local_errors` relative to the motion of the run over a step (empty if a
    finished run was read again); `count` is their number, `median` and `worst` are of the errors, `part` of the state
    and time `when` belong to the worst; `turn` is the largest h‖ξ‖ as an angle, rad; `rate` is h times the fastest
    excited rate of the linearised motion, if known; `resolving` is a dt that resolves the motion, None if dt does;
    `reasons` say why dt does not. With accuracy="full": `trajectory` is the largest error of the trajectory, relative
    to the extent of the motion, and `holds` the time up to which it is below 10 %, None if it always is.

    `turn` and `rate` may be computed when first read, as no warning of a run depends on them: `postponed`.
    """

    count: int
    median: float
    worst: float
    part: str
    when: float
    turn: float
    rate: float | None
    resolving: float | None = None
    reasons: tuple[str, ...] = ()
    trajectory: float | None = None
    holds: float | None = None
    steps: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    times: np.ndarray = field(default_factory=lambda: np.zeros(0))
    local_errors: np.ndarray = field(default_factory=lambda: np.zeros(0))

    def postponed(self, **later: Callable[[], float | None]) -> Accuracy:
        """The same with some numbers that these functions give when they are first read."""
        made = copy.copy(self)
        for name in later:
            del made.__dict__[name]
        made.__dict__["_later"] = later
        return made

    def __getattr__(self, name: str) -> float | None:
        """A number that was postponed."""
        later = self.__dict__.get("_later", {})
        if name not in later:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        value = self.__dict__[name] = later[name]()
        return value

    def __getstate__(self) -> Table:
        """All numbers, for a copy in another process."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @property
    def resolved(self) -> bool:
        """Whether dt resolves the motion."""
        return not self.reasons

    def __repr__(self) -> str:
        if not self.resolved:
            return f"<Accuracy: unresolved: {'; '.join(self.reasons)}; dt = {self.resolving:.2g} would do>"
        return f"<Accuracy: local error {self.worst:.1e} at most, median {self.median:.1e}, of {self.count} steps>"

    def numbers(self) -> Table:
        """The values for a summary and a file, under plain names."""
        found = {key: getattr(self, name) for name, key in NAMES.items() if getattr(self, name) is not None}
        return {**found, "unresolved": "; ".join(self.reasons), "resolved": int(self.resolved)}


NAMES = {
    "count": "local_error_steps",
    "median": "local_error_median",
    "worst": "local_error_max",
    "part": "local_error_part",
    "when": "local_error_time",
    "turn": "turn_max",
    "rate": "fastest_rate",
    "resolving": "dt_resolving",
    "trajectory": "trajectory_error_max",
    "holds": "trajectory_holds_until",
}
"""The names of the fields of an `Accuracy` in a summary."""


def accuracy_from(numbers: Mapping[str, Any]) -> Accuracy | None:
    """The accuracy that `Accuracy.numbers` wrote; None if `numbers` lack it."""
    if "local_error_max" not in numbers:
        return None
    reasons = tuple(filter(None, str(numbers.get("unresolved", "")).split("; ")))
    known = {name: numbers[key] for name, key in NAMES.items() if key in numbers}
    return Accuracy(**{"rate": None, **known}, reasons=reasons)


TOO_MUCH, TOO_MUCH_OF_ORDER_ONE = 0.05, 0.1
"""The local error, relative to the motion over a step, above which a motion is not resolved."""


ENVELOPE = 1.0
"""The angle, rad, by which a step may turn a body (the supported envelope), unless its local error is small."""


EXACT = 0.02
"""The local error, relative to the limit, below which a step may turn further: about a fixed axis, or of high order."""


HALVINGS = 24
"""How often dt is halved at most in search of one that resolves the motion."""


class Verdict(NamedTuple):
    """The worst of some steps: its local error, the part of the state with this error, its time, and its index among
    the good steps; the largest turn of a step, rad, None if no reason depends on it; the reasons against dt, and for
    each reason a dt that avoids it."""

    size: float
    part: str
    when: float
    worst: int
    turn: float | None
    reasons: list[str]
    fine: list[float]


def verdict(
    parts: PartsOfSteps, rows: np.ndarray, h: np.ndarray, members: PyTree, errors: Errors, sizes: PyTree, dt: Scalar
) -> Verdict:
    """The verdict about steps of h (k,) from rows (k, size), by their errors, which are relative to sizes by name."""
    good, order = errors.good, parts.order
    worst = int(np.argmax(errors.largest))
    limit = TOO_MUCH if order > 1 else TOO_MUCH_OF_ORDER_ONE
    size, part, when = float(errors.largest[worst]), errors.part[worst], float(rows[good][worst, parts.ruler.time])
    reasons, fine = [], []
    turn = largest_turn(parts, rows, h) if size > EXACT * limit else None
    if not size < limit:
        reasons.append(f"one step is off by {size:.0%} of what it moves ({part}, t = {when:.4g} s)")
        given = rows[good][[worst]], h[good][[worst]], whose(members, good, worst)
        fine.append(_resolving(parts, *given, limit, sizes))
    if turn is not None and turn > ENVELOPE:
        reasons.append(f"a step turns by {turn:.2g} rad")
        fine.append(abs(dt) * 0.25 * ENVELOPE / turn)
    return Verdict(size, part, when, worst, turn, reasons, fine)


def largest_turn(parts: PartsOfSteps, rows: np.ndarray, h: np.ndarray) -> float:
    """The largest h‖ξ‖ as an angle, rad; it costs eigenvalues of large groups."""
    return float((np.abs(h) * parts.ruler.turning(rows[:, list(parts.ruler.xi)])).max())


def whose(members: PyTree, good: np.ndarray, worst: int) -> Any:
    """The member of the worst step, as a row; None of a run."""
    return None if members is None else np.asarray(members)[good][[worst]]


def sentence(dt: Scalar, reasons: PyTree, resolving: float | None) -> str:
    """The text of the warning."""
    return (
        f"dt = {dt:g} does not resolve this motion: {'; '.join(reasons)}. Take dt = {resolving:.2g} or less. "
        "Conserved quantities cannot show this."
    )


def _resolving(parts: PartsOfSteps, row, h, member, limit: float, sizes: dict[str, float]) -> float:
    """The largest dt = h/2^j whose local error, and that of the half of it, is under half the limit."""
    well = 0
    for halving in range(1, HALVINGS):
        step = h / 2**halving
        begun = parts.followed(row, step, member)
        errors, _ = parts.errors(begun, step, member, _local_sizes(sizes, halving), at_least=True)
        well = well + 1 if errors.good.all() and errors.largest[0] < 0.5 * limit else 0
        if well == 2:
            return float(abs(2 * step[0]))
    return float(abs(h[0]) / 2**HALVINGS)


def _local_sizes(sizes: dict[str, float], halving: int) -> dict[str, float]:
    """The sizes for halved steps: displacements over a step shrink with it, momenta do not."""
    return {name: size if name.startswith(KEPT) else size / 2**halving for name, size in sizes.items()}


FIRST, LAST = 3, 4096
"""The number of first steps that are all judged, and the number of steps after which none is judged."""


AHEAD = (4, 32)
"""How many steps ahead the judgement looks to find how far a step moves."""


MEMBERS = 8
"""How many members are judged, spread evenly over all."""


class SampledSteps:
    """The knowledge from steps that are judged one by one; `count` steps have been taken.

    ahead: by how many steps the judgement looks ahead, by default `AHEAD`.
    """

    def __init__(self, parts: PartsOfSteps, ahead: tuple[int, ...] = AHEAD):
        self.parts, self._ahead = parts, ahead
        self.count, self.next = 0, 0
        self._sizes: dict[str, float] = {}

    def copy(self) -> SampledSteps:
        """The same knowledge for a clone."""
        made = SampledSteps(copy.copy(self.parts), self._ahead)
        made.count, made.next, made._sizes = self.count, self.next, dict(self._sizes)
        return made

    @property
    def over(self) -> bool:
        """Whether the sample is complete."""
        return self.next > LAST

    def due(self) -> bool:
        """Whether the next step belongs to the sample; a call that returns True moves on to the next one."""
        if self.count < self.next:
            return False
        self.next = self.count + 1 if self.count + 1 < FIRST else 1 << max(self.count, 2).bit_length()
        return True

    def judge(self, rows: np.ndarray, h: Scalar, members: PyTree = None) -> str | None:
        """The warning about steps of size h from rows (k, size); None if h resolves them."""
        length = np.full(len(rows), float(h))
        with np.errstate(all="ignore"):
            self._look_ahead(rows, length, members)
            errors, sizes = self.parts.errors(self.records(rows, length, members), length, members, self._sizes, True)
            if not errors.good.any() or not np.all(np.isfinite(errors.largest)):
                return None
            self._sizes = larger(self._sizes, sizes)
            found = verdict(self.parts, rows, length, members, errors, sizes, h)
        if not found.reasons:
            return None
        return sentence(h, found.reasons, min(found.fine))

    def records(self, rows: np.ndarray, h: np.ndarray, members: PyTree = None) -> np.ndarray:
        """The rows with the course of the internal state over the step that starts at them."""
        if self.parts.course.due is None:
            return rows
        _, record, code = self.parts.probe(rows, h, 1, members)
        return np.where((code == 0)[:, None], record, rows)

    def _look_ahead(self, rows: np.ndarray, h: np.ndarray, members: PyTree) -> None:
        """Find how far later steps under the same commands move."""
        place, taken, begun, ended = rows, 0, [rows[:0]], [rows[:0]]
        for steps in self._ahead:
            place, _, code = self.parts.probe(place, h, steps - taken, members)
            later, _, last = self.parts.probe(place, h, 1, members)
            taken, good = steps, (code == 0) & (last == 0) & np.isfinite(later).all(axis=1)
            begun.append(place[good])
            ended.append(later[good])
        begun, ended = np.concatenate(begun), np.concatenate(ended)
        if len(begun):
            self._sizes = larger(self._sizes, sizes_of(self.parts.compare(begun, ended, ended)))
