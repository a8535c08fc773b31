"""Links that act on each other in pairs: an order in which their equations are block tridiagonal, and colours."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np


@dataclass(frozen=True, eq=False)
class LinkOrder:
    """How the derivatives of links' equations are computed, and their places in the matrix.

    colours: their number. colour: that of each link, (N,); no equation has two unknown links of one colour. width: how
    many links a block of the block tridiagonal matrix holds. place: (3, M, w, w), which of the derivatives stands in
    the lower, the diagonal and the upper block: colour · N + row, then colours · N for zero and colours · N + 1 for
    one. position: (N,), where each link stands among the M·w of the blocks.
    """

    colours: int
    colour: np.ndarray
    width: int
    place: np.ndarray
    position: np.ndarray

    @property
    def rows(self) -> int:
        """M, the number of blocks of rows."""
        return self.place.shape[1]


@lru_cache(maxsize=64)
def layout(count: int, pairs: tuple[tuple[int, int], ...]) -> LinkOrder:
    """The layout of N links with these pairs."""
    near: list[list[int]] = [[i] for i in range(count)]
    for i, j in pairs:
        near[i].append(j)
        near[j].append(i)
    colour = _coloured(near)
    ends = np.array(pairs, int).reshape(-1, 2)
    position = np.arange(count)
    width = _bandwidth(position, ends)
    if width > 1:
        other = _reordered(count, ends)
        if _bandwidth(other, ends) < width:
            position, width = other, _bandwidth(other, ends)
    rows, colours = -(-count // width), int(colour.max()) + 1
    place = np.full((3, rows, width, width), colours * count)
    for spare in range(count, rows * width):
        place[1, spare // width, spare % width, spare % width] = colours * count + 1
    for i in range(count):
        block, inside = divmod(position[i], width)
        for j in near[i]:
            other_block, other_inside = divmod(position[j], width)
            place[other_block - block + 1, block, inside, other_inside] = colour[j] * count + i
    return LinkOrder(colours, colour, width, place, position)


def _reordered(count: int, ends: np.ndarray) -> np.ndarray:
    """The positions of links in the reversed order of Cuthill and McKee, (N,)."""
    from scipy.sparse import coo_matrix  # a tenth of the set-up time
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    graph = coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    position = np.empty(count, int)
    position[reverse_cuthill_mckee((graph + graph.T).tocsr(), symmetric_mode=True)] = np.arange(count)
    return position


def _coloured(near: list[list[int]]) -> np.ndarray:
    """A colour for every link, different from those of all links that share an equation with it."""
    colour = np.full(len(near), -1)
    for i in range(len(near)):
        taken = {int(colour[k]) for j in near[i] for k in near[j]}
        colour[i] = next(c for c in range(len(near) + 1) if c not in taken)
    return colour


def _bandwidth(position: np.ndarray, ends: np.ndarray) -> int:
    return int(np.max(np.abs(position[ends[:, 0]] - position[ends[:, 1]]), initial=1))
