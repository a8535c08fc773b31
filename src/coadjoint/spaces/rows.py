"""Rows of arrays that stand for links: those of some links, and those of all that a user gives."""

from __future__ import annotations

from typing import cast

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.errors import GroupError
from coadjoint.groups import LieGroup, Power
from coadjoint.kernels.trace.evaluate import traced

MANY = 4
"""The most stretches of rows, each one after the other, that are taken as slices."""


class LinkRows:
    """Rows of an array, by their numbers: slices where they lie in few stretches, which XLA fuses."""

    def __init__(self, numbers: np.ndarray):
        self.numbers = numbers
        starts = np.flatnonzero(np.diff(numbers, prepend=numbers[:1] - 2) != 1)
        self.stretches = list(zip(starts, [*starts[1:], len(numbers)], strict=True)) if len(starts) <= MANY else []

    def of(self, array: Array) -> Array:
        """These rows of an array, (number of rows, …)."""
        if not self.stretches:
            return array[self.numbers]
        return jnp.concatenate([array[self.numbers[a] : self.numbers[a] + b - a] for a, b in self.stretches])

    def summed(self, values: Array, count: int) -> Array:
        """An array of shape (count, …): each row is the sum of the `values`, of shape (links, …), that belong to it."""
        if not self.stretches:
            return jnp.zeros((count, *values.shape[1:])).at[self.numbers].add(values)
        ends = [(0, 0)] * (values.ndim - 1)
        parts = (
            jnp.pad(values[a:b], [(self.numbers[a], count - self.numbers[a] - (b - a)), *ends])
            for a, b in self.stretches
        )
        return cast(Array, sum(parts))


def power_of(group: LieGroup) -> Power:
    """A group of links; raises GroupError for another one."""
    if not isinstance(group, Power):
        raise GroupError(f"Spaces of links need a group of links such as co.Power(co.SE3(), 10), but got {group!r}.")
    return group


def rows_of(value: object, count: int, size: int) -> Array | None:
    """The numbers (count, size) given for all links, end to end or by leaves; None where they are not given for all."""
    try:
        leaves = (
            [leaf if traced(leaf) else np.asarray(leaf, dtype=float) for leaf in jax.tree.leaves(value)]
            if not isinstance(value, list)
            else [np.asarray(value, dtype=float)]
        )
    except (TypeError, ValueError):
        return None
    if len(leaves) == 1 and leaves[0].shape == (count * size,):
        return leaves[0].reshape(count, size)
    if any(leaf.ndim < 2 or leaf.shape[0] != count for leaf in leaves):
        return None
    parts = [leaf.reshape(count, -1) for leaf in leaves]
    if sum(part.shape[1] for part in parts) != size:
        return None
    return jnp.concatenate(parts, axis=1) if traced(value) else np.concatenate(parts, axis=1)
