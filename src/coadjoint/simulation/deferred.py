"""Arrays that are computed when their values are first read."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from operator import itemgetter
from typing import Any

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.trace.evaluate import Mapped, evaluate, tabulate


class Deferred:
    """An array of a known shape and type that `make` computes when its values are first read."""

    def __init__(self, shape: tuple[int, ...], dtype: np.dtype, make: Callable[[], np.ndarray]):
        self.shape, self.dtype = shape, dtype
        self._make: Callable[[], np.ndarray] | None = make
        self._values: Any = None

    @property
    def ndim(self) -> int:
        return len(self.shape)

    @property
    def values(self) -> np.ndarray:
        """The numbers, which stay in memory from now on."""
        if (make := self._make) is not None:
            self._values = make()
            self._make = None  # it may hold much that is not needed any more
        return self._values

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self.values, dtype, copy=True) if copy else np.asarray(self.values, dtype)

    def __getitem__(self, key: Any) -> Deferred:
        return self._view(itemgetter(key))

    def reshape(self, *shape: int) -> Deferred:
        return self._view(lambda array: array.reshape(*shape))

    def _view(self, view: Callable[[np.ndarray], np.ndarray]) -> Deferred:
        return Deferred(view(blank(self.shape, self.dtype)).shape, self.dtype, lambda: view(self.values))

    def of_xarray(self) -> tuple[PyTree, PyTree]:
        """The array as xarray takes it, still computed when its values are first read, and no encoding."""
        from coadjoint.simulation.of_xarray import computed

        return computed(self), None

    def __reduce__(self) -> tuple[object, ...]:
        return _known, (self.values,)


def _known(values: np.ndarray) -> Deferred:
    """An array that has been computed."""
    return Deferred(values.shape, values.dtype, lambda: values)


def blank(shape: tuple[int, ...], dtype: Any) -> np.ndarray:
    """Zeros that take no memory, for what asks for shapes and types alone."""
    return np.broadcast_to(np.zeros((), dtype), shape)


def are_deferred(tree: PyTree) -> bool:
    """Whether leaves of a PyTree are computed when they are first read."""
    return any(isinstance(leaf, Deferred) for leaf in jax.tree.leaves(tree))


def after(array: Any, shape: tuple[int, ...], function: Callable[[np.ndarray], np.ndarray]) -> Any:
    """function(array), an array of this shape; deferred if `array` is."""
    if not isinstance(array, Deferred):
        return function(array)
    return Deferred(shape, array.dtype, lambda: function(array.values))


def together(shapes: PyTree, make: Callable[[], PyTree]) -> PyTree:
    """The PyTree that one call makes, with leaves of these shapes: all are computed when one of them is first read."""
    leaves, structure = jax.tree.flatten(shapes)
    made = cache(lambda: jax.tree.leaves(make()))

    def one(index: int) -> np.ndarray:
        return made()[index]

    return structure.unflatten(
        [Deferred(tuple(leaf.shape), np.dtype(leaf.dtype), partial(one, i)) for i, leaf in enumerate(leaves)]
    )


def of_each(function: Callable[..., PyTree], *records: PyTree) -> PyTree:
    """A function of each of the records; deferred if they are."""
    if not are_deferred(records):
        return evaluate(Mapped(function), *records)
    made = tabulate(Mapped(function), *jax.tree.map(lambda leaf: blank(leaf.shape, leaf.dtype), records))
    return together(made.shapes, lambda: made(*jax.tree.map(np.asarray, records)))
