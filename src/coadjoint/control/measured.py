"""Measurements at nodes: their misfit is a part of the cost, so that the optimum is the most likely motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.control.numbers import number
from coadjoint.errors import ArgumentError
from coadjoint.losses import Loss, require_loss
from coadjoint.spaces.measured import MeasuredSpace
from coadjoint.spaces.measured_spaces import measured_space


class Seen(NamedTuple):
    """Measurements: the nodes (K,), the numbers of the values (size, K), 1/σ of their errors (m, K), 0 where nothing
    was measured, and their space."""

    nodes: np.ndarray
    values: np.ndarray
    weights: np.ndarray
    space: MeasuredSpace


@dataclass(frozen=True, eq=False)
class Measured:
    """y_k = function(motion [, p]) with errors e_k at nodes, which adds ½ Σ_k |e_k/σ|² to the cost.

    Of vectors e = y − h, on a group e = log(h⁻¹y), or log(yh⁻¹), as of `co.estimation.Measurement`.

    function: of the `co.mechanics.NodeMotion` at a node, a number, an array or a value of `space`, written with
        `jax.numpy`.
    values: (K, …) of the function's shape, or (K, count) numbers in `coordinates`; NaN where nothing was measured; None
        for an estimator, which receives them one after the other.
    deviation: σ of e, a number or an array, of vectors of the function's shape, in its units.
    times: (K,) s, each at a node; by default all N + 1 nodes.
    space, error_side, coordinates, loss: as of `co.estimation.Measurement`; by default vectors and least squares.

    Raises ArgumentError for values other than numbers, or deviations that are not positive.
    """

    function: Callable[..., PyTree]
    values: Any
    deviation: Any
    times: Any = None
    space: Any = field(default=None, kw_only=True)
    error_side: str = field(default="body", kw_only=True)
    coordinates: Any = field(default=None, kw_only=True)
    loss: Loss | None = field(default=None, kw_only=True)

    def __post_init__(self):
        checks.function(self.function, "Argument `function` of co.control.Measured", "a function of the motion")
        names = [name for name in ("values", "times") if getattr(self, name) is not None]
        for name in (*names, "deviation"):
            object.__setattr__(self, name, number(getattr(self, name), name, nan=name == "values"))
        if self.values is not None and not self._finite():
            raise ArgumentError("Argument `values` of co.control.Measured must be (K, …) finite numbers, NaN for gaps.")
        if not np.all((self.deviation > 0) & np.isfinite(self.deviation)):
            raise ArgumentError("Argument `deviation` of co.control.Measured must be positive: a standard deviation.")
        require_loss(self.loss, "Argument `loss` of co.control.Measured")

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

    def space_of(self, value: PyTree, name: str) -> MeasuredSpace:
        """The space of a function that returns `value`, arrays of any kind; raises ArgumentError for other shapes."""
        space, shape = measured_space(self.space, value, self.error_side, self.coordinates, f"`{name}`"), np.shape
        fits = [(), (space.dim,)] if self.space is not None else [(), shape(value)]
        if self.deviation.shape not in fits:
            what = f"its function returns {shape(value)}" if self.space is None else f"its errors are ({space.dim},)"
            raise ArgumentError(
                f"`{name}` has a deviation of the shape {self.deviation.shape}, but {what}: give one number, or one "
                "for each."
            )
        if self.values is not None and self.space is None and self.values.shape[1:] != shape(value):
            raise ArgumentError(
                f"`{name}` has values of the shape {self.values.shape[1:]}, but its function returns {shape(value)}."
            )
        if self.values is not None and self.values.size != len(self.values) * space.size:
            raise ArgumentError(
                f"`{name}` has values of the shape {self.values.shape[1:]}, but on {space.title} they are {space.size} "
                "numbers."
            )
        return space

    def seen(self, space: MeasuredSpace, values: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (size, K) and 1/σ (m, K), 0 where nothing was measured, of values (K, …) of a space.

        Of vectors each number may be missing, of other values all or none.
        """
        values = values.reshape(len(values), space.size)
        space.require(values, f"`{name}`")
        known, each = np.isfinite(values), self.space is None
        values = np.where(known if each else known.all(axis=1, keepdims=True), values, space.origin)
        weight = np.broadcast_to(1 / np.broadcast_to(self.deviation.ravel(), (space.dim,)), (len(values), space.dim))
        return values.T, (weight * (known if each else known.all(axis=1, keepdims=True))).T
