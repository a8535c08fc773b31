"""Products of matrices in machine code."""

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
    """Both products, (C, A, B, rows, inner, columns, strides of C, A, B, factor), with the machine that owns them."""
    module = ir.Module(name="products")
    algebra = dense(module)
    for name in ("product", "full"):
        f = Loops(module, f"outer_{name}", VOID, *[NUMBERS] * 3, *[INT64] * 6, DOUBLE, inside=False)
        f.b.call(getattr(algebra, name), f.args)
        f.b.ret_void()
    made = machine(str(module))
    given = [*[ctypes.c_void_p] * 3, *[ctypes.c_int64] * 6, ctypes.c_double]
    return made, {name: made.function(f"outer_{name}", *given) for name in ("product", "full")}


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
