"""The numbers of a point of a space link by link, and the space of a shorter chain."""

from __future__ import annotations

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.groups import Power
from coadjoint.spaces import RelativePoses, Several, Space

NONE = -1.0
"""Stands for a number that a link does not have."""

Pair = tuple[int, int]


def rows_by_links(space: Space, group: Power, x: Array) -> list[Array]:
    """x (ambient,) as arrays with a row for each link, (N, …), which is NONE where a link has no such number.

    A pose between links belongs to the larger number of its pair.
    """
    return _by_links(space, group, space.view(group, x))


def _by_links(space: Space, group: Power, view: PyTree) -> list[Array]:
    if isinstance(space, Several):
        parts = zip(space.names, space.factors, strict=True)
        return [leaf for name, one in parts for leaf in _by_links(one, group, getattr(view, name))]
    leaves = jax.tree.leaves(view)
    if not isinstance(space, RelativePoses):
        return leaves
    return [placed_by_links(leaf, [max(pair) for pair in space.of(group)], group.count) for leaf in leaves]


def placed_by_links(rows: Array, owners: list[int], count: int) -> Array:
    """Rows (M, …) by the links that own them, shape (N, k, …) with k the most rows of a link."""
    of_link: list[list[int]] = [[] for _ in range(count)]
    for row, link in enumerate(owners):
        of_link[link].append(row)
    most = max(map(len, of_link))
    places = np.array([[*own, *[len(owners)] * (most - len(own))] for own in of_link], int)
    return jnp.concatenate([rows, jnp.full((1, *rows.shape[1:]), NONE)])[places]


def shortened(space: Space, count: int, to: int) -> Space:
    """The space of the first and the last links of a chain of `count`, `to` in all."""
    if isinstance(space, Several):
        named = zip(space.names, space.factors, strict=True)
        return Several({name: shortened(one, count, to) for name, one in named})
    if not isinstance(space, RelativePoses) or space.pairs is None:
        return space
    less = count - to
    pairs = [pair for pair in space.pairs if max(pair) < to - 1 or max(pair) == count - 1]
    return replace(space, pairs=tuple(_moved(pair, less) if max(pair) == count - 1 else pair for pair in pairs))


def _moved(pair: Pair, less: int) -> Pair:
    i, j = (link - less if link >= 0 else link for link in pair)
    return i, j
