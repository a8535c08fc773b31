"""Turns between elements of a group and the way along them, for guesses: traced once for each group."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any

import jax
import numpy as np

from coadjoint.arrays import Array
from coadjoint.control.functions import of_columns
from coadjoint.control.linearised import Tables
from coadjoint.control.stage import numbers_of
from coadjoint.errors import GroupError, LagrangianError
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.kernels.trace.tracer import Tracer

ASIDE = -1e-3
"""The distance of a guess from half a turn, in 𝔤."""


class Geodesics:
    """log a⁻¹b, and a exp(s ξ) at `count` numbers s, of one group."""

    def __init__(self, group: LieGroup, count: int):
        self._group, self._count = group, count
        self._turn: Tables | None = None
        self._way: Any = None

    def turn(self, a: Element, b: Element) -> np.ndarray:
        """log a⁻¹b, (dim G,); of half a turn, which has none, that of an element near to it."""
        group = self._group
        self._turn = self._turn or Tables(_between(group), 1)
        turn = self._turn(numbers_of(a), numbers_of(b))[0][0].copy()
        if np.all(np.isfinite(turn)):
            return turn
        F = evaluate(lambda a, b: group.compose(group.inverse(a), b), a, b)
        try:
            return np.asarray(group.log(F))
        except GroupError:
            aside = evaluate(lambda F, xi: group.compose(F, group.exp(xi)), F, np.full(group.dim, ASIDE))
            return np.asarray(group.log(aside))

    def along(self, a: Element, turn: Array, s: np.ndarray) -> Element:
        """a exp(s turn), a leading axis for s."""
        self._way = self._way or self._way_of()
        return self._way(a, np.asarray(turn), s)

    def _way_of(self) -> Any:
        group, count = self._group, self._count
        try:
            table = Tables(_along(group), count)
        except LagrangianError:  # a group whose exponential has no scalar expressions
            one = evaluate(group.identity), np.zeros(group.dim), np.zeros(count)
            return tabulate(jax.vmap(partial(_way, group), in_axes=(None, None, 0)), *one)

        def way(a: Element, turn: np.ndarray, s: np.ndarray) -> Element:
            rows = table(numbers_of(a), turn, s[:, None])[0].copy()
            leaves, structure = jax.tree.flatten(a)
            parts = np.split(rows, np.cumsum([np.size(leaf) for leaf in leaves])[:-1], axis=1)
            shaped = [part.reshape(count, *np.shape(leaf)) for part, leaf in zip(parts, leaves, strict=True)]
            return jax.tree.unflatten(structure, shaped)

        return way


@lru_cache(maxsize=32)
def _between(group: LieGroup) -> Any:
    """log a⁻¹b as a function of CasADi of the numbers of a and b."""
    one = evaluate(group.identity)

    def log(a: Element, b: Element) -> Array:
        return group.log(group.compose(group.inverse(a), b))

    return of_columns(Tracer(), "The logarithm", log, {"a": one, "b": one})


@lru_cache(maxsize=32)
def _along(group: LieGroup) -> Any:
    """a exp(s ξ) as a function of CasADi of the numbers of a, of ξ and of s."""

    trees = {"a": evaluate(group.identity), "xi": np.zeros(group.dim), "s": np.zeros(())}
    return of_columns(Tracer(), "The exponential", partial(_way, group), trees)


def _way(group: LieGroup, a: Element, xi: Array, s: Array) -> Element:
    return group.compose(a, group.exp(s * xi))
