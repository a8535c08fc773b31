"""The equations of a chain without joints by blocks: the Jacobian of the residual, and chords by its factors.

With S_i = D_i − L_i W_{i−1} and W_i = S_i⁻¹U_i an increment δ of J δ = −r is y_i = −S_i⁻¹r_i − S_i⁻¹L_i y_{i−1} from
the first link to the last, and δ_i = y_i − W_i δ_{i+1} back.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from coadjoint.kernels.emit.link_symbols import ShortChain
from coadjoint.kernels.expressions import elimination
from coadjoint.kernels.expressions.differentiation import forward
from coadjoint.kernels.expressions.elimination import Matrix, dot
from coadjoint.kernels.expressions.expression import Expr
from coadjoint.kernels.expressions.graph import Graph
from coadjoint.kernels.untraceable import NotLinked

NEAR = (-1, 0, 1)
"""A link and its neighbours."""


class Blocks:
    """L, D, U of the residual (count, b) of a short chain: `rows` of each of its positions, 3 b² each.

    filled: which entries are not zero at some link.
    """

    def __init__(self, chain: ShortChain, residual: np.ndarray, collect: Callable[[list[Expr]], list[Expr]]) -> None:
        graph, self.size = chain.graph, residual.shape[1]
        unknowns = list(chain.z[chain.z_places.ravel()])
        self.rows: dict[int, list[Expr]] = {}
        for i in chain.positions:
            derivatives = forward(graph, list(residual[i]), unknowns)
            if any(abs(j // self.size - i) > 1 for row in derivatives for j in row):
                raise NotLinked("links act on others than their neighbours")
            places = [(row, (i + o) * self.size) for o in NEAR for row in derivatives]
            self.rows[i] = collect([row.get(first + k, graph.zero) for row, first in places for k in range(self.size)])
        entries = zip(*self.rows.values(), strict=True)
        self.filled = [any(x is not graph.zero for x in places) for places in entries]


class ChordSweep(NamedTuple):
    """Factors of the blocks, and an increment by them.

    blocks: symbols of L, D, U of a link, or zero. before: of W₋. factors: S⁻¹L, S⁻¹, W. known: their symbols, and those
    of r. behind: of y₋. ahead: y. here: symbols of W and y. beyond: of δ₊. back: δ.
    """

    blocks: list[Expr]
    before: list[Expr]
    factors: list[Expr]
    known: list[Expr]
    behind: list[Expr]
    ahead: list[Expr]
    here: list[Expr]
    beyond: list[Expr]
    back: list[Expr]


def chord_sweep(graph: Graph, given: Blocks) -> ChordSweep:
    """The sweeps over these blocks."""
    m, square = given.size, given.size**2

    def symbols(name: str, count: int) -> list[Expr]:
        return [graph.symbol(f"{name}{k}") for k in range(count)]

    def matrix(values: list[Expr]) -> Matrix:
        return [values[k * m : (k + 1) * m] for k in range(m)]

    blocks = [x if there else graph.zero for x, there in zip(symbols("block", 3 * square), given.filled, strict=True)]
    L, D, U = (matrix(blocks[k * square : (k + 1) * square]) for k in range(3))
    filled = [any(row[j] is not graph.zero for row in U) for j in range(m)]
    before = [x if filled[k % m] else graph.zero for k, x in enumerate(symbols("before", square))]
    S = [[graph.sub(D[i][j], dot(graph, L[i], [w[j] for w in matrix(before)])) for j in range(m)] for i in range(m)]
    units = [[graph.one if i == j else graph.zero for i in range(m)] for j in range(m)]
    inverse = elimination.solve(graph, S, units)  # columns
    rows = [list(row) for row in zip(*inverse, strict=True)]
    left, right = ([dot(graph, row, [x[j] for x in part]) for row in rows for j in range(m)] for part in (L, U))
    factors = [*left, *(x for row in rows for x in row), *right]
    known = [graph.zero if x is graph.zero else y for x, y in zip(factors, symbols("known", 3 * square), strict=True)]
    known, behind = [*known, *symbols("right", m)], symbols("behind", m)
    A, B = matrix(known[:square]), matrix(known[square : 2 * square])
    r, nothing = known[3 * square :], graph.zero
    ahead = [graph.sub(graph.sub(nothing, dot(graph, B[i], r)), dot(graph, A[i], behind)) for i in range(m)]
    here, beyond = [*known[2 * square : 3 * square], *symbols("here", m)], symbols("beyond", m)
    back = [graph.sub(here[square + i], dot(graph, matrix(here[:square])[i], beyond)) for i in range(m)]
    return ChordSweep(blocks, before, factors, known, behind, ahead, here, beyond, back)
