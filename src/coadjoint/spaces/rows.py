"""Rows of an array, which stand for links, by their numbers."""

from __future__ import annotations

from typing import cast

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array

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
