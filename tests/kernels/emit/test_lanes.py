"""Elementary functions of all lanes at once are those of the C library to three units in the last place."""

from __future__ import annotations

import ctypes
import math

import numpy as np
import pytest
from llvmlite import ir

from coadjoint.kernels.emit.lanes import LaneEmitter
from coadjoint.kernels.run.ensemble import lanes
from coadjoint.kernels.run.machine import machine

WIDTH = max(lanes(), 2)
random = np.random.default_rng(6)
ORDINARY = np.concatenate(
    [random.uniform(-10, 10, 4000), random.normal(size=4000) * 10.0 ** random.uniform(-20, 2, 4000)]
)
QUARTERS = np.arange(-63000, 63000, 37) * (np.pi / 2)
ASIDE = random.choice([-1, 1], len(QUARTERS)) * 10.0 ** random.uniform(-12, -1, len(QUARTERS))
NEAR_ZEROS = np.concatenate([QUARTERS, QUARTERS + ASIDE])
ANGLES = np.concatenate([ORDINARY, NEAR_ZEROS, random.uniform(-9e4, 9e4, 4000), [0.0, 1e7, 1e300, -3e5]])
ARGUMENTS = {
    "exp": np.concatenate([ORDINARY, random.uniform(-745, 709, 4000), [0.0, -708.5, -740.0, 709.7]]),
    "tanh": np.concatenate([ORDINARY, [0.0, 1.0, -1.0, np.nextafter(1.0, 0), 19.0, 400.0, -400.0]]),
    "sin": ANGLES,
    "cos": ANGLES,
}


def compiled(name: str):
    """x → function(x) on arrays, WIDTH numbers at a time."""
    module = ir.Module()
    pointer = ir.DoubleType().as_pointer()
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [pointer, pointer]), name="run")
    builder = ir.IRBuilder(function.append_basic_block())
    emit = LaneEmitter(module, builder, WIDTH)
    given, out = (builder.bitcast(argument, emit.number.as_pointer()) for argument in function.args)
    x = builder.load(given, align=8)
    value = emit._libm(name, x) if name == "tanh" else emit.intrinsic(name, x)
    builder.store(value, out, align=8)
    builder.ret_void()
    code = machine(str(module))
    run = code.function("run", ctypes.c_void_p, ctypes.c_void_p)

    def apply(values: np.ndarray) -> np.ndarray:
        rows = np.resize(values, (-(-len(values) // WIDTH), WIDTH))
        found = np.empty_like(rows)
        for row, result in zip(rows, found, strict=True):
            run(row.ctypes.data, result.ctypes.data)
        assert code is not None
        return found.ravel()[: len(values)]

    return apply


@pytest.mark.parametrize("name", list(ARGUMENTS))
def test_functions_of_lanes_are_those_of_the_c_library_to_three_units_in_the_last_place(name):
    """Also where sin and cos all but vanish: what is taken off an angle is exact until the third part of π/2."""
    x = ARGUMENTS[name]
    found, expected = compiled(name)(x), np.array([getattr(math, name)(each) for each in x])
    tiny = 1e-307
    error = np.abs(found - expected) / np.maximum(np.abs(expected), tiny) / np.finfo(float).eps
    worst = np.argmax(error)
    print(f"{name}: {error[worst]:.2f} units at {x[worst]!r}")
    assert np.all(error <= 3.0)


def test_infinities_and_what_is_no_number_are_what_they_are():
    odd = np.array([np.inf, -np.inf, np.nan, 1000.0, -1000.0])
    np.testing.assert_array_equal(compiled("exp")(odd), [np.inf, 0.0, np.nan, np.inf, 0.0])
    np.testing.assert_array_equal(compiled("tanh")(odd), [1.0, -1.0, np.nan, 1.0, -1.0])
    assert np.all(np.isnan(compiled("sin")(odd[:3])))
    assert np.all(np.isnan(compiled("cos")(odd[:3])))
