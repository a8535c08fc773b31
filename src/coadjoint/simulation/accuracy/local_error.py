"""The distance of two states, part by part in the scale of each, and the local error of steps. NumPy alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.texts import Table

NO_MOTION = 1e-12
"""A rotation (rad) or a length (m) over a step that counts as none; Newton's iteration stops at 1e-15."""


ROUND_OFF = 1e-9
"""A motion over a step, relative to where things are, or a momentum to another, that counts as none."""


KEPT = "momentum "
"""The prefix of names of parts whose size does not shrink with the step."""

Numbers = tuple[int, ...]
"""The places of a quantity in a row of numbers."""


class Ruler(NamedTuple):
    """The positions of the parts of a state in a row of numbers, and the quantities measured from them.

    time: the position of t. configuration: the arrays of g by name. points: the parts of q by name, with their first
    and last positions. momenta: the parts of π likewise. q: rows (k, size) → g·n (k, ambient), None if unknown.
    turning: ξ (k, dim) → the largest frequency of ad_ξ (k,), rad/s.
    """

    time: int
    configuration: tuple[tuple[str, Numbers], ...]
    points: tuple[tuple[str, int, int], ...]
    momenta: tuple[tuple[str, int, int], ...]
    mu: Numbers
    pi: Numbers
    xi: Numbers
    nu: Numbers
    q: Callable[[np.ndarray], np.ndarray] | None
    turning: Callable[[np.ndarray], np.ndarray]


class Difference(NamedTuple):
    """The difference in one part of the state, row by row: its name, the distance of two states, and its scale."""

    name: str
    apart: np.ndarray
    size: np.ndarray
    least: float
    """A size that counts as zero."""


def differences(ruler: Ruler, begun: np.ndarray, one: np.ndarray, other: np.ndarray) -> list[Difference]:
    """The differences between rows `one` (k, size) and rows `other`, both one step after `begun`.

    Group elements and positions q in space are relative to the displacement from `begun`, momenta μ and π to their own
    size. If nothing else moves, as for a fluid whose method leaves g out, momenta are relative to their change.
    """
    found = []
    for name, numbers in ruler.configuration:
        first, here, there = (rows[:, list(numbers)] for rows in (begun, one, other))
        least = NO_MOTION + ROUND_OFF * _largest(first)
        found.append(Difference(f"configuration {name}", _norm(here - there), _norm(here - first), least))
    if ruler.points and ruler.q is not None:
        count = len(begun)
        places = ruler.q(np.concatenate([begun, one, other]))
        first, here, there = places[:count], places[count : 2 * count], places[2 * count :]
        for name, begin, end in ruler.points:
            part = slice(begin, end)
            least = NO_MOTION + ROUND_OFF * _largest(first[:, part])
            way = _norm(here[:, part] - first[:, part])
            found.append(Difference(f"position {name}", _norm(here[:, part] - there[:, part]), way, least))
    return found + _momenta(ruler, begun, one, other)


def _momenta(ruler: Ruler, begun: np.ndarray, one: np.ndarray, other: np.ndarray) -> list[Difference]:
    """The differences of μ and π; a momentum whose energy is round-off relative to the other's counts as zero."""
    mu, pi, xi, nu = (list(numbers) for numbers in (ruler.mu, ruler.pi, ruler.xi, ruler.nu))
    energies = [_largest(begun[:, p]) * _largest(begun[:, v]) for p, v in ((mu, xi), (pi, nu))]
    kinds = [(f"{KEPT}μ", mu, _largest(begun[:, xi]))]
    kinds += [(f"{KEPT}{name}", pi[begin:end], _largest(begun[:, nu[begin:end]])) for name, begin, end in ruler.momenta]
    found, alone = [], not (ruler.configuration or ruler.points)
    for name, part, speed in kinds:
        first, here, there = (rows[:, part] for rows in (begun, one, other))
        size = _norm(here - first) if alone else np.maximum(_norm(first), _norm(here))
        name = name.removeprefix(KEPT) if alone else name
        least = 1e3 * ROUND_OFF * sum(energies) / speed if speed > 0 else np.inf
        found.append(Difference(name, _norm(here - there), size, least))
    return found


def relative(found: list[Difference], sizes: dict[str, float]) -> tuple[np.ndarray, list[str]]:
    """The largest part of every row, relative to the sizes given, and its name; 0 for a part that does not move."""
    names, rows = [], []
    for part in found:
        size = sizes.get(part.name, 0.0)
        names.append(part.name)
        rows.append(part.apart / size if size > part.least else np.zeros(len(part.apart)))
    errors = np.stack(rows)
    return errors.max(axis=0), [names[i] for i in errors.argmax(axis=0)]


def sizes_of(found: list[Difference]) -> dict[str, float]:
    """The largest size of each part over all rows."""
    return {part.name: float(np.max(part.size, initial=0.0)) for part in found}


def larger(sizes: dict[str, float], others: dict[str, float]) -> dict[str, float]:
    """The larger of two sizes of each part."""
    return {name: max(sizes.get(name, 0.0), others.get(name, 0.0)) for name in {**sizes, **others}}


def _norm(values: np.ndarray) -> np.ndarray:
    rows = values.reshape(len(values), -1)
    return np.sqrt(np.add.reduce(rows * rows, axis=1))


def _largest(values: np.ndarray) -> float:
    return float(np.max(_norm(values), initial=0.0))


HALVES = (0.5, 0.5)


UNEVEN = (0.382, 0.618)
"""Parts in no simple ratio: a signal that repeats at both h and h/2, such as a sampled one, does not repeat here."""


class StepTaker(Protocol):
    """A function that takes steps: it gives the states reached, one row each, the record of the first step, and 0 where
    all steps succeeded; members: the members whose parameters the rows have."""

    def __call__(
        self, rows: np.ndarray, h: np.ndarray, steps: int = 1, members: PyTree = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]: ...


class InternalPlaces(NamedTuple):
    """The places of an internal state in a row: whether its rule is due, None without a rule; the numbers that follow
    the motion or a command, at the node, on the mean of the step and at its end; the numbers that jump at the node,
    there and at the end; and all means and ends."""

    due: int | None = None
    begin: Numbers = ()
    mean: Numbers = ()
    end: Numbers = ()
    jumping: Numbers = ()
    jumping_end: Numbers = ()
    over_step: Numbers = ()

    @property
    def following(self) -> list[int]:
        """All numbers that follow."""
        return [*self.begin, *self.mean, *self.end]


def recorded(rows: np.ndarray, after: np.ndarray, course: InternalPlaces) -> np.ndarray:
    """The rows with the internal state of the steps that led to `after`: its course, and the values that jumped."""
    if course.due is None:
        return rows
    record = rows.copy()
    record[:, course.due] = 0.0
    record[:, [*course.over_step, *course.jumping]] = after[:, [*course.over_step, *course.jumping_end]]
    return record


class Errors(NamedTuple):
    """Local errors of steps, relative to the motion of the run over a step, a row each, and the part that is worst."""

    local: np.ndarray
    largest: np.ndarray
    """The larger of the errors from halves and from uneven parts."""
    part: list[str]
    good: np.ndarray


class PartsOfSteps:
    """Compares steps with parts of them: inputs, noise and sampled controllers stay constant over a step.

    An actuator that follows a command moves between the parts of a step by the rule of the internal state. probe: the
    function that takes steps. order: of the method. memory: the numbers that a method of variable steps remembers.
    """

    def __init__(self, probe: StepTaker, ruler: Ruler, course: InternalPlaces, order: int, memory: Sequence[int] = ()):
        self.probe, self.ruler, self.course, self.order = probe, ruler, course, order
        self._memory, self._following = list(memory), course.following

    def over(self, rows: np.ndarray, h: np.ndarray, parts: Sequence[float], members: PyTree = None):
        """The rows after steps of the parts of h one after another, and whether all of them were solved."""
        due, memory = self.course.due, self._memory
        if due is None and not memory and len(set(parts)) == 1:
            after, _, code = self.probe(rows, h * parts[0], len(parts), members)
            return after, code == 0
        good, begun = np.ones(len(rows), bool), rows
        for number, part in enumerate(parts):
            if number:
                rows = np.array(rows)
                rows[:, memory] = begun[:, memory]
            if part != 1.0:
                rows = self.followed(rows, h * part, members)
            rows, _, code = self.probe(rows, h * part, 1, members)
            good &= code == 0
        return rows, good

    def followed(self, rows: np.ndarray, h: np.ndarray, members: PyTree) -> np.ndarray:
        """The rows as records of steps of h, with the rule applied to numbers that follow the motion or a command."""
        if self.course.due is None:
            return rows
        due, kept = self.course.due, np.array(rows)
        if self._following:
            kept[:, due] = 1.0
            _, found, _ = self.probe(kept, h, 1, members)
            kept[:, self._following] = found[:, self._following]
        kept[:, due] = 0.0
        return kept

    def errors(
        self, rows: np.ndarray, h: np.ndarray, members: PyTree = None, sizes: PyTree = None, at_least: bool = False
    ) -> tuple[Errors, dict[str, float]]:
        """Local errors of the steps of h (rows,) from every row, and the sizes to which they are relative.

        sizes: by default those of these steps. at_least: whether larger sizes of these steps replace the given ones.
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
        sizes = own if sizes is None else larger(sizes, own) if at_least else sizes
        apart, parts = relative(found, sizes)
        count = len(apart) // 2
        local, other = apart[:count] / self.shrinks(HALVES), apart[count:] / self.shrinks(UNEVEN)
        part = [parts[i] if local[i] >= other[i] else parts[count + i] for i in range(count)]
        return Errors(local, np.maximum(local, other), part, good), sizes

    def compare(self, begun: np.ndarray, one: np.ndarray, other: np.ndarray) -> list[Difference]:
        """The differences between rows."""
        return differences(self.ruler, begun, other, one)

    def shrinks(self, parts: Sequence[float]) -> float:
        """1 − Σ part^{p+1}: the difference to steps of the parts, divided by the local error of order p + 1."""
        order = min(self.order, 2) if self._following else self.order
        return 1.0 - sum(part ** (order + 1) for part in parts)


class Bilinear(NamedTuple):
    """q = g·n of rows by T, q_i = T_ijk (1, g)_j (1, n)_k."""

    tensor: np.ndarray
    g: Numbers
    n: Numbers

    def __call__(self, rows: np.ndarray) -> np.ndarray:
        one = np.ones((len(rows), 1))
        g, n = (np.concatenate([one, rows[:, list(numbers)]], axis=1) for numbers in (self.g, self.n))
        return np.einsum("ijk,rj,rk->ri", self.tensor, g, n)


class Frequencies(NamedTuple):
    """The largest frequency of ad_ξ by structure constants, [ξ, η]_i = c_ijk ξ_j η_k; of copies of a group its own."""

    constants: np.ndarray
    copies: int = 1

    def __call__(self, xi: np.ndarray) -> np.ndarray:
        if not self.constants.any():
            return np.zeros(len(xi))
        each = xi.reshape(len(xi) * self.copies, -1)
        ad = np.einsum("ijk,rj->rik", self.constants, each)
        return np.max(np.abs(np.linalg.eigvals(ad).imag), axis=1).reshape(len(xi), self.copies).max(axis=1)


def to_plain(parts: PartsOfSteps, ruler: Ruler) -> Table:
    """The values for `from_plain`, as JSON; ruler: one whose functions are those above."""
    found = {name: value for name, value in ruler._asdict().items() if name not in ("q", "turning")}
    for name in ("q", "turning"):
        made: Any = getattr(ruler, name)
        found[name] = None if made is None else [np.asarray(part).tolist() for part in made]
    return {"ruler": found, "course": list(parts.course), "order": parts.order}


def from_plain(given: Mapping[str, Any], probe: StepTaker) -> PartsOfSteps:
    """The comparison of steps that `probe` takes."""
    known = dict(given["ruler"])
    for name in ("configuration", "points", "momenta"):
        known[name] = tuple((one[0], *map(_numbers, one[1:])) for one in known[name])
    for name in ("mu", "pi", "xi", "nu"):
        known[name] = _numbers(known[name])
    q, (constants, copies) = known["q"], known["turning"]
    known["q"] = None if q is None else Bilinear(np.asarray(q[0], float), _numbers(q[1]), _numbers(q[2]))
    known["turning"] = Frequencies(np.asarray(constants, float), int(copies))
    due, *courses = given["course"]
    return PartsOfSteps(probe, Ruler(**known), InternalPlaces(due, *map(_numbers, courses)), int(given["order"]))


def _numbers(given: Any) -> PyTree:
    """Lists of a JSON file as tuples."""
    return tuple(int(i) for i in given) if isinstance(given, list) else int(given)
