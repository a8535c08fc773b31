"""Products of matrices, and solutions of linear equations, in machine code."""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np
import pytest
from llvmlite import ir

from coadjoint.kernels.emit.dense import VOID, dense
from coadjoint.kernels.emit.loops import DOUBLE, INT64, NUMBERS, Loops
from coadjoint.kernels.run.machine import machine


@cache
def products() -> tuple[Any, dict[str, Any]]:
    """Both products, (C, A, B, rows, inner, columns, strides of C, A, B, factor), and `solve`, (A, B, rows, columns,
    strides of A, B), with the machine that owns them."""
    module = ir.Module(name="products")
    algebra = dense(module)
    for name in ("product", "full"):
        f = Loops(module, f"outer_{name}", VOID, *[NUMBERS] * 3, *[INT64] * 6, DOUBLE, inside=False)
        f.b.call(getattr(algebra, name), f.args)
        f.b.ret_void()
    f = Loops(module, "outer_solve", VOID, *[NUMBERS] * 2, *[INT64] * 4, inside=False)
    f.b.call(algebra.solve, f.args)
    f.b.ret_void()
    made = machine(str(module))
    given = [*[ctypes.c_void_p] * 3, *[ctypes.c_int64] * 6, ctypes.c_double]
    found = {name: made.function(f"outer_{name}", *given) for name in ("product", "full")}
    return made, found | {"solve": made.function("outer_solve", *given[:2], *given[3:7])}


@pytest.mark.parametrize("name", ["product", "full"])
@pytest.mark.parametrize("columns", [3, 7, 8, 9, 15, 16, 23])
def test_a_product_adds_to_its_columns_alone_for_any_width(name: str, columns: int):
    random = np.random.default_rng(columns)
    rows, inner, strides = 4, 6, (columns + 2, 9, columns + 1)
    C, A, B = (random.normal(size=(n, stride)) for n, stride in zip((rows, rows, inner), strides, strict=True))
    A[1, 2] = 0.0
    wanted = C.copy()
    wanted[:, :columns] -= 0.5 * A[:, :inner] @ B[:, :columns]
    products()[1][name](*(M.ctypes.data for M in (C, A, B)), rows, inner, columns, *strides, -0.5)
    np.testing.assert_allclose(C, wanted, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(C[:, columns:], wanted[:, columns:])


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (2, 3), (5, 2), (6, 9)])
def test_equations_are_solved_with_the_largest_pivots_and_leave_other_columns(rows: int, columns: int):
    random = np.random.default_rng(rows)
    A, B = random.normal(size=(rows, rows + 2)), random.normal(size=(rows, columns + 1))
    A[0, 0] *= 1e-17  # useless as a pivot where there is another one
    wanted = np.linalg.solve(A[:, :rows], B[:, :columns])
    kept = B[:, columns].copy()
    products()[1]["solve"](A.ctypes.data, B.ctypes.data, rows, columns, rows + 2, columns + 1)
    np.testing.assert_allclose(B[:, :columns], wanted, rtol=1e-12)
    np.testing.assert_array_equal(B[:, columns], kept)
