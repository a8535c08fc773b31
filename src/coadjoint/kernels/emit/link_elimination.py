"""The equations of a chain of joints by blocks: the Schur complement of the bodies, and its elimination.

With u_i the unknowns of body i and λ_i the multipliers of its joint, a Newton iteration solves

    K_i δu_i + Σ_j G_ij δλ_j = −r_i,    Σ_j C_ij δu_j + E_ij δλ_j = −c_i,    j = i − 1, i, i + 1,

by S δλ = −c + C K⁻¹r with the block tridiagonal S = E − C K⁻¹G, and δu = −K⁻¹(r + G δλ).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from coadjoint.kernels.emit.link_symbols import ShortChain
from coadjoint.kernels.expressions import elimination
from coadjoint.kernels.expressions.differentiation import forward
from coadjoint.kernels.expressions.elimination import Matrix, dot
from coadjoint.kernels.expressions.expression import Expr, reachable
from coadjoint.kernels.expressions.graph import Graph, substitute
from coadjoint.kernels.newton.increments import linear_solve
from coadjoint.kernels.untraceable import NotLinked

NEAR = (-1, 0, 1)
"""A link and its neighbours."""

Collect = Callable[[list[Expr]], list[Expr]]


class BlockSweep(NamedTuple):
    """Block elimination: W = (D − L W₋)⁻¹U and y = (D − L W₋)⁻¹(r − L y₋) from the first link to the last, then
    x = y − W x₊ back.

    rows: symbols of L, D, U, r of a link. before: of (W₋, y₋). forward: (W, y). here: their symbols. ahead: of x₊.
    backward: x.
    """

    rows: list[Expr]
    before: list[Expr]
    forward: list[Expr]
    here: list[Expr]
    ahead: list[Expr]
    backward: list[Expr]


def sweep(graph: Graph, m: int) -> BlockSweep:
    """The sweeps over blocks of m unknowns."""

    def symbols(name: str, count: int) -> list[Expr]:
        return [graph.symbol(f"{name}{k}") for k in range(count)]

    rows, before = symbols("row", 3 * m**2 + m), symbols("before", m**2 + m)
    L, D, U = (_square(rows[k * m**2 : (k + 1) * m**2], m) for k in range(3))
    columns, y = list(zip(*_square(before[: m**2], m), strict=True)), before[m**2 :]
    pivot = [[graph.sub(D[i][j], dot(graph, L[i], columns[j])) for j in range(m)] for i in range(m)]
    right = [graph.sub(rows[3 * m**2 + i], dot(graph, L[i], y)) for i in range(m)]
    *new, value = elimination.solve(graph, pivot, [*map(list, zip(*U, strict=True)), right])
    forward = [*(new[j][i] for i in range(m) for j in range(m)), *value]
    here, ahead = symbols("here", m**2 + m), symbols("ahead", m)
    W = _square(here[: m**2], m)
    back = [graph.sub(here[m**2 + i], dot(graph, W[i], ahead)) for i in range(m)]
    return BlockSweep(rows, before, forward, here, ahead, back)


def _square(values: list[Expr], m: int) -> Matrix:
    return [values[k * m : (k + 1) * m] for k in range(m)]


class Schur:
    """One Newton iteration of the residual (count, b) of a short chain, link by link.

    across, back, inside: the neighbours whose blocks of G, Cᵀ and E are not zero.
    """

    def __init__(self, chain: ShortChain, residual: np.ndarray, collect: Collect) -> None:
        self.chain, self.graph, self.residual, self.collect = chain, chain.graph, residual, collect
        self.derivatives = forward(self.graph, list(residual.ravel()), list(chain.z[chain.z_places.ravel()]))
        self.b, count = residual.shape[1], chain.count
        bodies, joints = range(chain.base), range(chain.base, self.b)
        self._require_separate()
        self.K = {i: self._block(i, bodies, i, bodies) for i in range(count)}
        self.G, self.C, self.E = (
            {(i, d): self._block(i, rows, i + d, columns) for i in range(count) for d in NEAR if 0 <= i + d < count}
            for rows, columns in ((bodies, joints), (joints, bodies), (joints, joints))
        )
        self.across, self.inside = ([d for d in NEAR if self._filled(part, d)] for part in (self.G, self.E))
        self.back = [d for d in NEAR if self._filled(self.C, d)]
        # Row i of C has the unknowns of link k = i + d, whose K⁻¹G has a column of j = k + e.
        self.keys = [(d, e) for d in self.back for e in self.across]
        if not self.keys or any(d + e not in NEAR for d, e in self.keys):
            raise NotLinked("its joints act on more than two links")

    def solved(self, k: int) -> tuple[list[Expr], list[Expr]]:
        """Of link k: K⁻¹r and the columns of K⁻¹G, neighbour after neighbour; c and its contributions C K⁻¹r and
        C K⁻¹G to other rows, with its own E."""
        graph, m, base = self.graph, self.chain.joint, self.chain.base
        nothing = [[graph.zero] * m for _ in range(base)]
        columns = [list(column) for e in self.across for column in zip(*self.G.get((k, e), nothing), strict=True)]
        found = _solved(graph, self.K[k], [list(self.residual[k, :base]), *columns], set(self.chain.address))
        parts: list[Expr] = list(self.residual[k, base:])
        for d in self.back:
            rows = self.C.get((k - d, d))
            parts += [graph.zero] * m if rows is None else [dot(graph, row, found[0]) for row in rows]
        for d, e in self.keys:
            rows, start = self.C.get((k - d, d)), 1 + m * self.across.index(e)
            there = rows is not None and (k, e) in self.G
            X = found[start : start + m]
            parts += [dot(graph, row, x) for row in rows or () for x in X] if there else [graph.zero] * m**2
        for e in self.inside:
            parts += [x for row in self.E.get((k, e), nothing[:1] * m) for x in row]
        return [x for column in found for x in column], parts

    def rows(self, i: int, q: list[list[Expr]]) -> list[Expr]:
        """L, D, U and the right side of row i of S, from the contributions q of links."""
        graph, m, blocks = self.graph, self.chain.joint, list[Expr]()
        first = m * (1 + len(self.back))
        for o in NEAR:
            total = [graph.zero] * m**2
            if o in self.inside and 0 <= i + o < self.chain.count:
                start = first + m**2 * (len(self.keys) + self.inside.index(o))
                total = q[i][start : start + m**2]
            for n, (d, e) in enumerate(self.keys):
                if d + e == o and 0 <= i + d < self.chain.count and 0 <= i + o < self.chain.count:
                    part = q[i + d][first + m**2 * n : first + m**2 * (n + 1)]
                    total = [graph.sub(x, y) for x, y in zip(total, part, strict=True)]
            blocks += total
        right = [graph.neg(x) for x in q[i][:m]]
        for n, d in enumerate(self.back, 1):
            if 0 <= i + d < self.chain.count:
                right = [graph.add(x, y) for x, y in zip(right, q[i + d][m * n : m * (n + 1)], strict=True)]
        return [*blocks, *right]

    def increment(self, k: int, x: list[Expr]) -> list[Expr]:
        """(δu, δλ) of link k, from its K⁻¹r and K⁻¹G, x, and the δλ of its neighbours."""
        chain, graph, base, m = self.chain, self.graph, self.chain.base, self.chain.joint
        total = [graph.neg(value) for value in x[:base]]
        for n, e in enumerate(self.across):
            if 0 <= k + e < self.chain.count:
                columns = np.array(x[base * (1 + n * m) : base * (1 + (n + 1) * m)], object).reshape(m, base).T
                moved = list(chain.d[chain.d_places[k + e]])
                total = [
                    graph.sub(value, dot(graph, list(row), moved)) for value, row in zip(total, columns, strict=True)
                ]
        return [*total, *chain.d[chain.d_places[k]]]

    def _block(self, i: int, rows: range, j: int, columns: range) -> Matrix:
        width, zero = len(columns), self.graph.zero
        derivatives = [self.derivatives[i * self.b + row] for row in rows]
        entries = self.collect([row.get(j * self.b + column, zero) for row in derivatives for column in columns])
        return [entries[k * width : (k + 1) * width] for k in range(len(rows))]

    def _filled(self, blocks: dict[tuple[int, int], Matrix], d: int) -> bool:
        found = [block for (_, e), block in blocks.items() if e == d]
        return any(x is not self.graph.zero for block in found for row in block for x in row)

    def _require_separate(self) -> None:
        """Raise NotLinked where bodies act on each other by more than the multipliers, or on links further away."""
        for number, row in enumerate(self.derivatives):
            i, slot = divmod(number, self.b)
            others = {j // self.b for j in row if j % self.b < self.chain.base} - {i}
            if any(abs(j // self.b - i) > 1 for j in row) or (slot < self.chain.base and others):
                raise NotLinked("links act on each other by more than the reactions of joints")


def closing(chain: ShortChain, rate: np.ndarray, collect: Collect) -> dict[int, list[Expr]]:
    """L, D, U and the right side of φ̇(½hλ′) = 0 of each of its positions, which is affine; rate: φ̇ (count, m)."""
    graph, m = chain.graph, chain.joint
    symbols = list(chain.d[chain.d_places.ravel()])
    nothing, found = dict.fromkeys(symbols, graph.zero), {}
    for i in chain.positions:
        derivatives = forward(graph, list(rate[i]), symbols)
        if any(node in nothing for node in reachable(x for row in derivatives for x in row.values())):
            raise NotLinked("the velocities of a node are not affine in the momenta")
        if any(abs(j // m - i) > 1 for row in derivatives for j in row):
            raise NotLinked("its joints act on more than two links")
        places = [(row, (i + o) * m + column) for o in NEAR for row in derivatives for column in range(m)]
        right = [graph.neg(x) for x in substitute(graph, list(rate[i]), nothing)]
        found[i] = collect([*(row.get(place, graph.zero) for row, place in places), *right])
    return found


def _solved(graph: Graph, K: Matrix, sides: Iterable[list[Expr]], changing: set[Any]) -> list[list[Expr]]:
    """K⁻¹ of each side, in the order that the zeros of K allow; with pivots where that may lose digits."""
    sides = list(sides)
    found = [linear_solve(graph, K, side, changing, False) for side in sides]
    if all(one.always_safe for one in found):
        return [[graph.neg(x) for x in one.delta] for one in found]
    return elimination.solve(graph, K, sides)
