"""PyTrees of numbers as flat float64 arrays and back."""

from __future__ import annotations

import math
from functools import cache
from itertools import accumulate
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.untraceable import Untraceable


class Layout(NamedTuple):
    """The structure and the leaf shapes of a PyTree: hashable, a part of cache keys."""

    structure: PyTree
    shapes: tuple[tuple[int, ...], ...]

    @property
    def size(self) -> int:
        """How many numbers the PyTree holds."""
        return sum(map(math.prod, self.shapes))

    @property
    def places(self) -> PyTree:
        """The PyTree whose leaves are the places of their numbers in a row."""
        return self.unpack(np.arange(self.size))

    def unpack(self, numbers: np.ndarray) -> PyTree:
        """The PyTree of arrays (*lead, …) from numbers (*lead, size)."""
        if numbers.ndim == 1:
            return self.views(numbers.copy())
        return jax.tree.map(lambda leaf: leaf.copy(), self.views(numbers))

    def views(self, numbers: np.ndarray | jax.Array) -> PyTree:
        """The same as views into the numbers, also of traced ones: for long rows that are copied later anyway."""
        lead, leaves = numbers.shape[:-1], []
        for start, end, shape in _places(self.shapes):
            leaf = numbers[..., start:end]
            leaves.append(leaf if len(shape) == 1 else leaf.reshape(lead + shape))
        return self.structure.unflatten(leaves)


@cache
def _places(shapes: tuple[tuple[int, ...], ...]) -> list[tuple[int, int, tuple[int, ...]]]:
    """Where the numbers of each leaf begin and end in a row, and its shape."""
    ends = list(accumulate(map(math.prod, shapes)))
    return list(zip([0, *ends], ends, shapes, strict=False))


def layout(tree: PyTree) -> Layout:
    """The layout of a PyTree of arrays or shapes."""
    leaves, structure = jax.tree_util.tree_flatten(tree)
    return Layout(structure, tuple(tuple(np.shape(leaf)) for leaf in leaves))


def pack(tree: PyTree) -> tuple[Layout, np.ndarray]:
    """The layout of a PyTree and its numbers (size,). Untraceable for leaves other than real numbers."""
    leaves, structure = jax.tree_util.tree_flatten(tree)
    arrays = [np.asarray(leaf) for leaf in leaves]
    for array in arrays:
        if array.dtype.kind not in "fi":
            raise Untraceable("convert_element_type", f"a leaf has type {array.dtype}, not float64")
    shapes = tuple([array.shape for array in arrays])
    return Layout(structure, shapes), np.concatenate(arrays or [[]], axis=None, dtype=np.float64)


def flattened(tree: PyTree) -> jax.Array:
    """The numbers of a PyTree end to end, (size,), for tracing."""
    return jnp.concatenate([jnp.ravel(leaf) for leaf in jax.tree.leaves(tree)])


def rows(tree: PyTree, count: int | None = None) -> np.ndarray:
    """The numbers of a PyTree whose leaves have a common first axis: (count, numbers).

    count: needed where the PyTree may have no leaves.
    """
    leaves = [np.asarray(leaf, float) for leaf in jax.tree.leaves(tree)]
    count = len(leaves[0]) if count is None else count
    return np.concatenate([np.zeros((count, 0)), *(leaf.reshape(count, -1) for leaf in leaves)], axis=1)
