"""How far two states are apart, part by part, each in its own scale. Knows NumPy only, for saved steppers."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

NO_MOTION = 1e-12
"""A rotation (rad) or a length (m) over a step that counts as none; Newton's iteration stops at 1e-15."""

ROUND_OFF = 1e-9
"""A motion over a step, relative to where things are, or a momentum to another, that counts as none."""

KEPT = "momentum "
"""How the names of parts begin whose size does not shrink with the step."""

Numbers = tuple[int, ...]
"""Which numbers of a row something is."""


class Ruler(NamedTuple):
    """Where the parts of a state are in a row of numbers, and what is measured of them.

    time: that of t. configuration: the arrays of g by name. points: the parts of q by name, first and last number.
    momenta: those of π likewise. q: rows (k, size) → g·n (k, ambient), None where it is not known. turning: ξ (k, dim)
    → the largest frequency of ad_ξ (k,), rad/s.
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
    """Of one part of the state, a row each: its name, how far two states are apart, and the size it is relative to."""

    name: str
    apart: np.ndarray
    size: np.ndarray
    least: float
    """A size that counts as none."""


def differences(ruler: Ruler, begun: np.ndarray, one: np.ndarray, other: np.ndarray) -> list[Difference]:
    """What separates rows `one` (k, size) from rows `other`, both a step away from `begun`.

    Group elements and positions q in space are relative to the way from `begun`; momenta μ and π to their own size, or
    to the way from `begun` where nothing else moves, as of a fluid whose method leaves g out.
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
    """Those of μ and π; one beside whose energy another's is round-off is none."""
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
    return np.sqrt(np.sum(np.reshape(values, (len(values), -1)) ** 2, axis=1))


def _largest(values: np.ndarray) -> float:
    return float(np.max(_norm(values), initial=0.0))
