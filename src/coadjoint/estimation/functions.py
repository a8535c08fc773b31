"""Functions of rows of numbers with their Jacobians: machine code where they can be traced, XLA otherwise."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from coadjoint.kernels.run.backend import fall_back
from coadjoint.kernels.run.function import NativeFunction
from coadjoint.kernels.untraceable import Untraceable


class RowFunction:
    """function(x, y), x (m,) and y (k,) flat, with its derivatives by x, for many rows together.

    x, y: values of their shapes, for tracing.
    """

    def __init__(self, function: Callable[[Any, Any], Any], x: np.ndarray, y: np.ndarray):
        try:
            self.native: NativeFunction | None = NativeFunction(function, x, y)
            self._call: Callable[..., Any] = self.native
        except Untraceable as reason:
            fall_back(reason, "auto")
            self.native, self._call = None, _by_xla(function)

    def __call__(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (rows, n) and Jacobians (rows, n, m) at x (rows, m), y (rows, k)."""
        return self._call(x, y)


def _by_xla(function: Callable[[Any, Any], Any]) -> Callable[..., Any]:
    both = jax.jit(jax.vmap(lambda x, y: (function(x, y), jax.jacfwd(function)(x, y))))

    def call(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        with jax.enable_x64(True):
            value, slopes = both(x, y)
        return np.array(value), np.array(slopes)

    return call
