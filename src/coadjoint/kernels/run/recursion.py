"""A recursion x_{k+1} = f(x_k, u_k, c) as machine code, for many steps in one call."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np

from coadjoint.kernels.run.function import NAME, assembled
from coadjoint.kernels.run.machine import machine
from coadjoint.kernels.trace.tracer import Tracer, flat


class NativeRecursion:
    """x_{k+1} = function(x_k, u_k, c): x (n,), u (k,) and c (m,) are flat, and so is the value (n,).

    Raises Untraceable, naming the primitive, if the function is outside the tracer's language.
    """

    def __init__(self, function: Callable[[Any, Any, Any], Any], x: np.ndarray, u: np.ndarray, c: np.ndarray) -> None:
        tracer = Tracer()
        symbols = [tracer.symbols(name, values) for name, values in (("x", x), ("u", u), ("c", c))]
        value = flat(tracer.trace(function, *symbols))
        given = [(flat(symbols[0]), x.size), (flat(symbols[1]), u.size), (flat(symbols[2]), 0)]
        self._machine = machine(assembled(given, [(dict(enumerate(value)), x.size)]))
        self.code = self._machine.function(NAME, *[ctypes.c_void_p] * 4, ctypes.c_int64)

    def __call__(self, x: np.ndarray, u: np.ndarray, c: np.ndarray) -> np.ndarray:
        """x_0, x_1, …, (steps + 1, n), from x_0 = x with u (steps, k)."""
        u, c = np.ascontiguousarray(u, np.float64), np.ascontiguousarray(c, np.float64)
        found = np.empty((len(u) + 1, x.size))
        found[0] = x
        # What a step finds is where the next one reads.
        self.code(found.ctypes.data, u.ctypes.data, c.ctypes.data, found.ctypes.data + found.strides[0], len(u))
        return found
