"""Residuals of printed equations: rows of a table, and the sizes that they are relative to."""

from __future__ import annotations

from typing import NamedTuple

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.theory.slopes import Slopes


class Residual(NamedTuple):
    """An equation, its text, its residual at every node or pair of steps, and the size that it is relative to.

    values: (nodes,).
    """

    equation: str
    statement: str
    values: np.ndarray
    scale: float

    @property
    def largest(self) -> float:
        """max |values| / scale, infinite where one is not a number."""
        found = float(np.max(np.abs(self.values), initial=0.0)) / self.scale
        return np.inf if np.isnan(found) else found


def largest(values: object) -> float:
    """The largest |number| in a PyTree of arrays, 0 without any."""
    return float(np.max([np.max(np.abs(leaf), initial=0.0) for leaf in jax.tree.leaves(values)], initial=0.0))


def pairs(tree: PyTree) -> tuple[PyTree, PyTree]:
    """All but the last row, and all but the first."""
    return jax.tree.map(lambda x: x[:-1], tree), jax.tree.map(lambda x: x[1:], tree)


def row(equation: str, statement: str, values: PyTree, scale: float) -> Residual:
    """A residual of arrays with an axis of nodes, the largest entry of each; a scale of 0 counts as 1."""
    flat = np.asarray(values).reshape(len(values), -1)
    return Residual(equation, statement, np.max(np.abs(flat), axis=1, initial=0.0), scale or 1.0)


def scales(slopes: Slopes) -> tuple[float, float]:
    """What round-off in μ and in π is relative to: the largest terms of (P42)."""
    lever = largest(slopes.along_s) * largest((slopes.link.n, slopes.link.s))
    return largest(slopes.right) + lever, largest((slopes.along_n, slopes.along_s))
