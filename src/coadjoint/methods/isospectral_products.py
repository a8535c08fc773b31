"""Products of momenta on U(n) for isospectral steps: five products of real matrices, and two passes around them.

The coordinates of U(n) by rows are a real matrix r: over the diagonal those of the skew part A of A + iB, below it and
on it those of the symmetric part B.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from contextlib import contextmanager
from typing import NamedTuple

import jax
import numpy as np
from llvmlite import ir

from coadjoint.arrays import Array, PyTree
from coadjoint.groups import Un
from coadjoint.groups.unitary import ComplexMatrix, product, sum_of_parts
from coadjoint.kernels.emit.emitter import Value
from coadjoint.kernels.emit.loops import DOUBLE, INT64, Loops
from coadjoint.kernels.emit.xla_call import Emit, xla_call
from coadjoint.kernels.run.xla_function import XlaFunction

HALF = 0.5**0.5

TILE = 8
"""The rows and columns of a tile, which is read with its mirror image."""

LEAST = 32
"""The least n at which the passes by machine code take less time than those by XLA."""


def _opened(p: Array, w: Array) -> tuple[Array, ...]:
    """R + J, A, R, J and A + B, (n, n) each, of P = R + iJ and W = A + iB by rows (n, n) both."""
    group = Un(p.shape[0])
    (R, J), (A, B) = group.parts(p.reshape(-1)), group.parts(w.reshape(-1))
    return R + J, A, R, J, A + B


def _closed(A: Array, B: Array, X: Array) -> tuple[Array, Array]:
    """Rows (n, n) of Z − Z†, Z = A + iB, and of the anti-Hermitian matrix with the skew and symmetric parts of X."""
    group, shape = Un(A.shape[0]), A.shape
    return (
        2 * group.coordinates(ComplexMatrix(A, B)).reshape(shape),
        group.coordinates(ComplexMatrix(X, X)).reshape(shape),
    )


def plain(P: ComplexMatrix, W: ComplexMatrix, hull: Un) -> tuple[Array, Array]:
    """Coordinates on U(n), shape (n²,), of [P, W] = PW − (PW)† and of PWP, which is anti-Hermitian."""
    Z = product(P, W)
    X = sum_of_parts(Z, P)
    return 2 * hull.coordinates(Z), hull.coordinates(ComplexMatrix(X, X))


@jax.custom_jvp
def products(p: Array, w: Array) -> tuple[Array, Array]:
    """Coordinates, shape (n²,), of [P, W] and of PWP, n ≥ TILE, of P and W by theirs, in either precision.

    Z = PW = RA − JB + i(RB + JA) = (R + J)A − J(A + B) + i((R + J)A + R(A + B)ᵀ),   ZP as in `sum_of_parts`
    """
    n = round(p.shape[0] ** 0.5)
    opened, closed = PASSES[np.dtype(p.dtype)]
    S, A, R, J, V = opened(p.reshape(n, n), w.reshape(n, n))
    both = S @ A
    real, imaginary = both - J @ V, both + R @ V.T
    odd, even = closed(real, imaginary, real @ S - imaginary @ S.T)
    return odd.reshape(-1), even.reshape(-1)


@products.defjvp
def _products_slope(primals: tuple[Array, Array], tangents: tuple[Array, Array]) -> PyTree:
    hull = Un(round(primals[0].shape[0] ** 0.5))
    return products(*primals), jax.jvp(lambda p, w: plain(hull.parts(p), hull.parts(w), hull), primals, tangents)[1]


def _emit_open(kind: ir.Type) -> Emit:
    def emit(module: ir.Module, name: str) -> None:
        numbers = kind.as_pointer()
        f = Loops(module, f"{name}_loops", ir.VoidType(), INT64, *[numbers] * 7)
        n, p, w, *found = f.args
        with _rows_of_tiles(f, kind, n, [p, w]) as rows:
            for row in rows:
                (R, J), (A, B) = row.parts(0), row.parts(1)
                values = f.b.fadd(R, J), A, R, J, f.b.fadd(A, B)
                for array, value in zip(found, values, strict=True):
                    row.put(array, value)
        f.b.ret_void()
        xla_call(module, name, f.function, [numbers] * 2, [numbers] * 5)

    return emit


def _emit_close(kind: ir.Type) -> Emit:
    def emit(module: ir.Module, name: str) -> None:
        numbers = kind.as_pointer()
        f = Loops(module, f"{name}_loops", ir.VoidType(), INT64, *[numbers] * 5)
        n, A, B, X, odd, even = f.args
        with _rows_of_tiles(f, kind, n, [A, B, X]) as rows:
            for row in rows:
                twice = row.coordinates(0, 1)
                row.put(odd, f.b.fadd(twice, twice))
                row.put(even, row.coordinates(2, 2))
        f.b.ret_void()
        xla_call(module, name, f.function, [numbers] * 3, [numbers] * 2)

    return emit


class _Row(NamedTuple):
    """TILE neighbours of a row of matrices, and the same entries of their transposes, as vectors.

    above, here: whether an entry is over the diagonal, and on it.
    """

    f: Loops
    kind: ir.Type
    place: Value
    above: Value
    here: Value
    entries: list[Value]
    mirrored: list[Value]

    @property
    def vector(self) -> ir.VectorType:
        return ir.VectorType(self.kind, TILE)

    def _all(self, number: float) -> Value:
        return ir.Constant(self.vector, [number] * TILE)

    def parts(self, k: int) -> tuple[Value, Value]:
        """A and B of the matrix with the coordinates k by rows: `Un.parts`."""
        b, r, across = self.f.b, self.entries[k], self.mirrored[k]
        half, other = (b.fmul(self._all(HALF), x) for x in (r, across))
        A = b.select(self.above, half, b.fneg(other))
        B = b.select(self.above, other, half)
        return b.select(self.here, self._all(0.0), A), b.select(self.here, r, B)

    def coordinates(self, k: int, l: int) -> Value:
        """The coordinates by rows of the matrix of parts k and l: `Un.coordinates`."""
        b = self.f.b
        A, B = b.fsub(self.entries[k], self.mirrored[k]), b.fadd(self.entries[l], self.mirrored[l])
        rows = b.fmul(self._all(HALF), b.select(self.above, A, B))
        return b.select(self.here, self.entries[l], rows)

    def put(self, array: Value, value: Value) -> None:
        self.f.b.store(value, self.f.block(array, self.place, self.vector), align=4)


@contextmanager
def _rows_of_tiles(f: Loops, kind: ir.Type, n: Value, matrices: list[Value]) -> Generator[Iterator[_Row]]:
    """All rows of all tiles of matrices (n, n), n ≥ TILE; the last tiles, which end with the matrix, overlap others."""
    vector, lanes = ir.VectorType(kind, TILE), ir.VectorType(INT64, TILE)
    tiles, furthest = f.b.sdiv(f.add(n, TILE - 1), INT64(TILE)), f.b.sub(n, INT64(TILE))

    def start(tile: Value) -> Value:
        wanted = f.times(tile, TILE)
        return f.b.select(f.b.icmp_signed("<", wanted, furthest), wanted, furthest)

    def tile_of(matrix: Value, top: Value, left: Value) -> list[Value]:
        places = (f.add(f.times(f.add(top, k), n), left) for k in range(TILE))
        return [f.b.load(f.block(matrix, place, vector), align=4) for place in places]

    with f.over(tiles) as across, f.over(tiles) as along:
        top, left = start(across), start(along)
        entries = [tile_of(matrix, top, left) for matrix in matrices]
        mirrored = [_transposed(f, tile_of(matrix, left, top)) for matrix in matrices]
        columns = f.b.add(f.spread(left, lanes), ir.Constant(lanes, list(range(TILE))))

        def rows() -> Iterator[_Row]:
            for k in range(TILE):
                i = f.add(top, k)
                row = f.spread(i, lanes)
                above, here = f.b.icmp_signed("<", row, columns), f.b.icmp_signed("==", row, columns)
                place = f.add(f.times(i, n), left)
                yield _Row(f, kind, place, above, here, [t[k] for t in entries], [t[k] for t in mirrored])

        yield rows()


def _transposed(f: Loops, rows: list[Value]) -> list[Value]:
    """The columns of a square tile: of each block the two beside its diagonal change places, from half the tile on."""
    rows, half = list(rows), len(rows) // 2
    while half:
        for k in range(len(rows)):
            if k & half:
                continue
            first, second = rows[k], rows[k + half]
            for to, other in ((k, 0), (k + half, half)):
                lanes = [lane + other if not lane & half else TILE + lane - half + other for lane in range(TILE)]
                mask = ir.Constant(ir.VectorType(ir.IntType(32), TILE), lanes)
                rows[to] = f.b.shuffle_vector(first, second, mask)
        half //= 2
    return rows


PASSES = {
    np.dtype(dtype): (
        XlaFunction(f"opened_{dtype}", _emit_open(kind), _opened),
        XlaFunction(f"closed_{dtype}", _emit_close(kind), _closed),
    )
    for dtype, kind in (("float64", DOUBLE), ("float32", ir.FloatType()))
}
"""Type of numbers → the passes before and after the products."""
