"""How far two states are apart, part by part, each in its own scale."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import jax
import numpy as np

from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.mechanics.state import Places, State

NO_MOTION = 1e-12
"""A rotation (rad) or a length (m) over a step that counts as none; Newton's iteration stops at 1e-15."""

ROUND_OFF = 1e-9
"""A motion over a step, relative to where things are, or a momentum to another, that counts as none."""


class Difference(NamedTuple):
    """Of one part of the state, a row each: its name, how far two states are apart, and the size it is relative to."""

    name: str
    apart: np.ndarray
    size: np.ndarray
    least: float
    """A size that counts as none."""


def differences(begun: State, one: State, other: State) -> list[Difference]:
    """What separates `one` from `other`, both a step away from `begun`; each State has one leading axis.

    Group elements and positions q in space are relative to the way from `begun`; momenta μ and π to their own size.
    """
    places = begun.places
    group, Q, _ = places
    found = []
    names = () if begun.g is None else group.leaf_names
    leaves = zip(names, *(jax.tree.leaves(s.g) for s in (begun, one, other)), strict=True)
    for name, first, here, there in leaves:
        least = NO_MOTION + ROUND_OFF * _largest(first)
        found.append(Difference(f"configuration {name}", _norm(here - there), _norm(here - first), least))
    if Q.dim(group):
        first, here, there = _positions(begun, one, other)
        for name, part in Q.components(group, "q").items():
            least = NO_MOTION + ROUND_OFF * _largest(first[:, part])
            way = _norm(here[:, part] - first[:, part])
            found.append(Difference(f"position {name}", _norm(here[:, part] - there[:, part]), way, least))
    return found + _momenta(begun, one, other)


def _momenta(begun: State, one: State, other: State) -> list[Difference]:
    """Those of μ and π; one beside whose energy another's is round-off is none."""
    group, Q, _ = begun.places
    speeds = [_largest(begun.xi), _largest(begun.nu)]
    energies = [_largest(begun.mu) * speeds[0], _largest(begun.pi) * speeds[1]]
    kinds = [("momentum μ", slice(None), begun.mu, one.mu, other.mu, speeds[0])]
    kinds += [
        (f"momentum {name}", part, begun.pi, one.pi, other.pi, _largest(begun.nu[:, part]))
        for name, part in (Q.components(group, "pi") if Q.dim(group) else {}).items()
    ]
    found = []
    for name, part, first, here, there, speed in kinds:
        size = np.maximum(_norm(first[:, part]), _norm(here[:, part]))
        least = 1e3 * ROUND_OFF * sum(energies) / speed if speed > 0 else np.inf
        found.append(Difference(name, _norm(here[:, part] - there[:, part]), size, least))
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


def _norm(values: np.ndarray) -> np.ndarray:
    return np.sqrt(np.sum(np.reshape(values, (len(values), -1)) ** 2, axis=1))


def _largest(values: np.ndarray) -> float:
    return float(np.max(_norm(values), initial=0.0))


def _positions(*states: State) -> list[np.ndarray]:
    """q = g·n of every row."""
    rows = len(states[0].t)
    both = jax.tree.map(lambda *leaves: np.concatenate(leaves), *((s.g, s.n) for s in states))
    found = _acting(states[0].places, len(states) * rows)(*both)
    return [found[i * rows : (i + 1) * rows] for i in range(len(states))]


@lru_cache(maxsize=64)
def _acting(places: Places, rows: int) -> Any:
    """(g, n) ↦ g·n on rows, traced once."""
    group, Q, _ = places
    g = jax.tree.map(lambda leaf: np.zeros((rows, *leaf.shape)), jax.eval_shape(group.identity))
    return tabulate(jax.vmap(lambda g, n: Q.act(group, g, n)), g, np.zeros((rows, Q.ambient(group))))
