"""Measurements at nodes: their misfit is a part of the cost, so that the optimum is the most likely motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.control.numbers import number
from coadjoint.errors import ArgumentError


@dataclass(frozen=True, eq=False)
class Measured:
    """y_k = function(motion [, p]) + noise at nodes, which adds ½ Σ_k |(function − y_k)/σ|² to the cost.

    function: of the `co.mechanics.NodeMotion` at a node, a number or an array, written with `jax.numpy`.
    values: (K, …) of the function's shape; NaN where nothing was measured; None for an estimator, which receives them
        one after the other.
    deviation: σ, a number or an array of the function's shape, in its units.
    times: (K,) s, each at a node; by default all N + 1 nodes.

    Raises ArgumentError for values other than numbers, or deviations that are not positive.
    """

    function: Callable[..., PyTree]
    values: Any
    deviation: Any
    times: Any = None

    def __post_init__(self):
        checks.function(self.function, "Argument `function` of co.control.Measured", "a function of the motion")
        names = [name for name in ("values", "times") if getattr(self, name) is not None]
        for name in (*names, "deviation"):
            object.__setattr__(self, name, number(getattr(self, name), name, nan=name == "values"))
        if self.values is not None and not self._finite():
            raise ArgumentError("Argument `values` of co.control.Measured must be (K, …) finite numbers, NaN for gaps.")
        if not np.all((self.deviation > 0) & np.isfinite(self.deviation)):
            raise ArgumentError("Argument `deviation` of co.control.Measured must be positive: a standard deviation.")

    def _finite(self) -> bool:
        return self.values.ndim > 0 and not np.any(np.isinf(self.values)) and bool(np.any(np.isfinite(self.values)))

    def nodes(self, name: str, begin: float, h: float, steps: int) -> np.ndarray:
        """The nodes at which it was measured, (K,); raises ArgumentError for times away from the nodes."""
        if self.values is None:
            return np.zeros(0, int)
        if self.times is None:
            if len(self.values) != steps + 1:
                raise ArgumentError(
                    f"`{name}` has {len(self.values)} values, but there are {steps + 1} nodes: give `times`, or a "
                    "value for each node, NaN where nothing was measured."
                )
            return np.arange(steps + 1)
        if np.shape(self.times) != (len(self.values),):
            raise ArgumentError(
                f"`{name}` has {len(self.values)} values, but times of the shape {np.shape(self.times)}."
            )
        places = (self.times - begin) / h
        nodes = np.rint(places).astype(int)
        if len(np.unique(nodes)) < len(nodes):
            raise ArgumentError(f"`{name}` has two values at one node.")
        if np.any((nodes < 0) | (nodes > steps)):
            raise ArgumentError(
                f"`{name}` was measured outside of the motion from {begin:g} to {begin + steps * h:g} s."
            )
        worst = int(np.argmax(np.abs(places - nodes)))
        if abs(places[worst] - nodes[worst]) > 1e-6:
            raise ArgumentError(
                f"`{name}` was measured at {self.times[worst]:g} s, between two nodes: choose dt so that all times are "
                "nodes, or interpolate the values."
            )
        return nodes

    def weights(self, shape: tuple[int, ...], name: str) -> tuple[np.ndarray, np.ndarray]:
        """Values and 1/σ, (m, K) each, 0 where nothing was measured, of a function with values of this shape."""
        if self.values is not None and self.values.shape[1:] != shape:
            raise ArgumentError(
                f"`{name}` has values of the shape {self.values.shape[1:]}, but its function returns {shape}."
            )
        if self.deviation.shape not in ((), shape):
            raise ArgumentError(
                f"`{name}` has a deviation of the shape {self.deviation.shape}, but its function returns {shape}: give "
                "one number, or one for each."
            )
        values = np.zeros((0, *shape)) if self.values is None else self.values
        known, size = np.isfinite(values), (len(values), int(np.prod(shape)))
        weight = known / np.broadcast_to(self.deviation, shape)
        return np.where(known, values, 0.0).reshape(size).T, weight.reshape(size).T
