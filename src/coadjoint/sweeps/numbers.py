"""The varied numbers of a sweep, and the values of its members."""

from __future__ import annotations

import hashlib
import inspect
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial, reduce
from typing import Any

import numpy as np

from coadjoint import checks, sections
from coadjoint.arrays import PyTree, Scalar
from coadjoint.checks import number as finite
from coadjoint.checks import positive, whole
from coadjoint.errors import ArgumentError, shown
from coadjoint.sections import key

SAMPLINGS = ("grid", "list", "random", "latin_hypercube", "sobol")
"""The choices of members."""
DRAWN = SAMPLINGS[2:]
"""Those that need `members`."""
BLOCK = 4096
"""The size of blocks in which random members are drawn, each with its own generator."""
MOST = 10**9
"""The most members of a sweep."""
DIGEST = "sha256:"
"""The number of values that are written."""
_WAYS = "{ from = …, to = … }, { values = […] } or { mean = …, deviation = … }"


@dataclass(frozen=True)
class Number:
    """A number that varies: evenly `between` two, among `values`, (k, …), or with a normal (mean, deviation).

    name: its section and key as in `parameters.mass_kg`, with its places in an array as in `initial.position_m[2]`.
    count: of a grid. even: in the logarithm where False.
    """

    name: str
    between: tuple[float, float] | None = None
    count: int | None = None
    even: bool = True
    values: np.ndarray | None = None
    normal: tuple[float, float] | None = None

    def at(self, u: np.ndarray) -> np.ndarray:
        """The values at shares u of all, (n,), 0 ≤ u < 1: by the inverse of the distribution function."""
        if self.values is not None:
            return self.values[np.minimum((u * len(self.values)).astype(int), len(self.values) - 1)]
        if self.normal is not None:
            from scipy.special import ndtri

            return self.normal[0] + self.normal[1] * ndtri(np.clip(u, 2.0**-54, 1 - 2.0**-53))
        assert self.between is not None
        low, high = self.between
        return low + u * (high - low) if self.even else low * (high / low) ** u

    def on_grid(self) -> np.ndarray:
        """The values of a grid; raises ArgumentError where it has none."""
        if self.values is not None:
            return self.values
        if self.count is None or self.between is None:
            raise ArgumentError(
                f"[vary] {self.name} has no values of a grid: give {{ from = …, to = …, count = … }} or "
                "{ values = […] }, or choose another sampling than a grid."
            )
        found = self.at(np.linspace(0.0, 1.0, self.count))
        found[[0, -1]] = self.between  # to the bit
        return found


@dataclass(frozen=True)
class Varied:
    """A key of a file with its numbers: `template` is a Number, or lists of numbers with Numbers in them."""

    keys: tuple[str, ...]
    template: Any

    @property
    def numbers(self) -> list[Number]:
        """Those that vary, in their order."""
        return list(_leaves(self.template))

    def value(self, rows: Mapping[str, object]) -> PyTree:
        """The value of one member, in the form of a file. rows: the values of its numbers, by name."""
        return _filled(self.template, rows)

    def values(self, rows: Mapping[str, np.ndarray], count: int) -> np.ndarray:
        """The values of `count` members, (count, …)."""
        columns = {number.name: rows[number.name] for number in self.numbers}
        if isinstance(self.template, Number):
            return columns[self.template.name]
        shape = np.shape(_filled(self.template, dict.fromkeys(columns, 0.0)))
        found = np.empty((count, *shape))
        for place in np.ndindex(*shape):
            inner = reduce(lambda held, i: held[i], place, self.template)
            found[(slice(None), *place)] = columns[inner.name] if isinstance(inner, Number) else inner
        return found


def read(table: Mapping[str, Any], keys: tuple[str, ...] = ()) -> list[Varied]:
    """The varied numbers of a section [vary]; raises ArgumentError."""
    found: list[Varied] = []
    for name, value in table.items():
        here = (*keys, name)
        if isinstance(value, Mapping) and not _is_number(value):
            found += read(value, here)
        elif not keys:
            raise ArgumentError(f"[vary] needs the section of `{name}`, as in [vary.parameters].")
        else:
            made = Varied(here, _template(value, ".".join(here)))
            if not made.numbers:
                raise ArgumentError(f"[vary] {'.'.join(here)} must vary, as in {_WAYS}, but is {shown(value)}.")
            found.append(made)
    return found


def _is_number(value: Any) -> bool:
    return bool({"from", "to", "values", "mean", "deviation"} & {*value}) and not any(
        isinstance(inner, Mapping) for inner in value.values()
    )


def _template(value: Any, name: str) -> PyTree:
    if isinstance(value, list):
        return [_template(inner, f"{name}[{place}]") for place, inner in enumerate(value)]
    if isinstance(value, Mapping):
        return number(value, name)
    if hasattr(value, "member"):
        return Number(name, values=np.asarray(value.values, dtype=float))
    return value


def _values(given: object, name: str) -> np.ndarray:
    if isinstance(given, str) and given.startswith(DIGEST):  # of values that a call from Python had
        return np.zeros(0)
    try:
        found = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        found = np.zeros(0)
    fits = found.ndim != 0 and len(found) and np.all(np.isfinite(found)) and (not isinstance(given, (bool, int, float)))
    checks.expect(fits, given, name, "a list of finite numbers, not empty")
    return found


@dataclass(frozen=True)
class RangeSection:
    """A number between two others."""

    from_: Scalar = key("least value", check=finite)
    to: Scalar = key("greatest value", check=finite)
    count: Scalar | None = key("number of values in a grid", check=partial(whole, least=2), default=None)
    scale: str = key("whether equal shares have equal differences or ratios", words=("linear", "log"), default="linear")

    def number(self, name: str) -> Number:
        """The number of this name; raises ArgumentError for an empty range."""
        low, high = float(self.from_), float(self.to)
        if not low < high:
            raise ArgumentError(f"[vary.{name}] is an empty range: `from`, {low:g}, must be less than `to`, {high:g}.")
        if self.scale == "log" and low <= 0:
            raise ArgumentError(f'[vary.{name}] from must be positive with the scale "log", but is {low:g}.')
        count = None if self.count is None else int(self.count)
        return Number(name, between=(low, high), count=count, even=self.scale == "linear")


@dataclass(frozen=True)
class ValuesSection:
    """A number with given values."""

    values: PyTree = key("values, numbers or arrays of one shape", check=_values)

    def number(self, name: str) -> Number:
        """The number of this name."""
        return Number(name, values=self.values)


@dataclass(frozen=True)
class NormalSection:
    """A number with a normal distribution."""

    mean: Scalar = key("mean", check=finite)
    deviation: Scalar = key("standard deviation", check=positive)

    def number(self, name: str) -> Number:
        """The number of this name."""
        return Number(name, normal=(float(self.mean), float(self.deviation)))


def number(given: Mapping[str, object], name: str) -> Number:
    """A number in the form of [vary]; raises ArgumentError."""
    normal = {"mean", "deviation"} & {*given}
    kind = ValuesSection if "values" in given else NormalSection if normal else RangeSection
    return sections.read(kind, f"vary.{name}", given).number(name)


def _leaves(template: PyTree) -> Iterator[Number]:
    if isinstance(template, Number):
        yield template
    elif isinstance(template, list):
        for inner in template:
            yield from _leaves(inner)


def _filled(template: PyTree, rows: Mapping[str, object]) -> PyTree:
    if isinstance(template, list):
        return [_filled(inner, rows) for inner in template]
    if isinstance(template, Number):
        value = rows[template.name]
        return value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value
    return template


Design = dict[str, np.ndarray]
"""The values of every number by its name, (members, …)."""


def design(numbers: Sequence[Number], sampling: str, members: int | None, seed: int) -> tuple[Design, int]:
    """The values of all members, and their number.

    Member i of a random sweep gets its numbers from (seed, i) alone, for any number of members; those of Latin
    hypercubes and Sobol' points depend on all. Raises ArgumentError.
    """
    if sampling == "grid":
        axes = [number.on_grid() for number in numbers]
        count = int(np.prod([len(axis) for axis in axes], dtype=float))
        _require_few(count)
        places = np.unravel_index(np.arange(count), [len(axis) for axis in axes])
        return {n.name: axis[place] for n, axis, place in zip(numbers, axes, places, strict=True)}, count
    if sampling == "list":
        return _listed(numbers)
    assert members is not None
    _require_few(members)
    u = shares(sampling, members, len(numbers), seed)
    return {number.name: number.at(u[:, place]) for place, number in enumerate(numbers)}, members


def _require_few(count: float) -> None:
    if count > MOST:
        raise ArgumentError(f"A sweep has at most {MOST:,} members, but this one would have {count:,}.")


def _listed(numbers: Sequence[Number]) -> tuple[Design, int]:
    lengths = {number.name: len(number.on_grid()) for number in numbers if number.values is not None}
    for number in numbers:
        if number.values is None:
            raise ArgumentError(f"[vary] {number.name} must be {{ values = […] }} in a list.")
    if len({*lengths.values()}) > 1:
        told = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise ArgumentError(f"All numbers of a list need equally many values, but have: {told}.")
    return {number.name: number.on_grid() for number in numbers}, next(iter(lengths.values()))


def shares(sampling: str, members: int, dimensions: int, seed: int) -> np.ndarray:
    """Points of the unit cube, (members, dimensions): independent, a Latin hypercube, or Sobol' points, scrambled."""
    if sampling == "random":
        blocks = [np.random.default_rng([seed, b]).random((BLOCK, dimensions)) for b in range(-(-members // BLOCK))]
        return np.concatenate(blocks)[:members]
    from scipy.stats import qmc

    cls: Any = qmc.LatinHypercube if sampling == "latin_hypercube" else qmc.Sobol
    word = "rng" if "rng" in inspect.signature(cls).parameters else "seed"
    with warnings.catch_warnings():  # of numbers of points that are no powers of 2
        warnings.simplefilter("ignore", UserWarning)
        return cls(dimensions, **{word: np.random.default_rng(seed)}).random(members)


def side_by_side(made: Mapping[str, np.ndarray], names: Sequence[str]) -> np.ndarray:
    """The values of some numbers, a row of each member."""
    return np.concatenate([made[name].reshape(len(made[name]), -1) for name in names], axis=1)


def digest(made: Design) -> str:
    """The SHA-256 of the values of all members."""
    found = hashlib.sha256()
    for name, values in made.items():
        found.update(name.encode())
        found.update(np.ascontiguousarray(values, dtype=float).tobytes())
    return found.hexdigest()
