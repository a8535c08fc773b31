"""PyTrees of parameters and states as rows of named numbers."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

Shapes = dict[str, tuple[int, ...]]


def shapes_of(tree: Any) -> Shapes:
    """Name → shape of every leaf, in their order: `internal.rudder`, `g[0]`, …"""
    leaves = jax.tree_util.tree_leaves_with_path(tree)
    return {jax.tree_util.keystr(path).lstrip("."): np.shape(leaf) for path, leaf in leaves}


def rows_of(tree: Any, count: int) -> np.ndarray:
    """Numbers (count, size) of a tree whose leaves have a leading axis."""
    return np.concatenate(
        [np.zeros((count, 0)), *(np.reshape(leaf, (count, -1)) for leaf in jax.tree.leaves(tree))], axis=1
    )


def rows_where(tree: Any, axes: Any) -> np.ndarray:
    """Numbers (members, size) of a tree whose leaves have an axis of members where `axes` is 0; (1, size) of none."""
    flags = [] if tree is None else [axis == 0 for axis in jax.tree.leaves(axes, is_leaf=lambda x: x is None)]
    pairs = list(zip(jax.tree.leaves(tree), flags, strict=True))
    count = next((len(leaf) for leaf, flag in pairs if flag), 1)
    return rows_of([leaf if flag else np.broadcast_to(leaf, (count, *np.shape(leaf))) for leaf, flag in pairs], count)


def spread(tree: Any, lead: tuple[int, ...]) -> Any:
    """A tree of one member for each member."""
    return jax.tree.map(lambda leaf: np.broadcast_to(leaf, (*lead, *np.shape(leaf))).copy(), tree)
