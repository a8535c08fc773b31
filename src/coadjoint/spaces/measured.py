"""Spaces in which measurements live: the difference of an expected value h from a measured one y, by the logarithm.

    body: y = h exp(e), h ⊖ y = log(y⁻¹h) = −e;    space: y = exp(e) h, h ⊖ y = log(h y⁻¹) = −e

On a group; on the sphere h ⊖ y = Bᵀ Log_y(h), with an orthonormal basis B of the tangent plane at y, and (π, 0) for
opposite directions; of vectors h − y, and of angles the same within half a turn. The derivative of h ⊖ y by h is the
inverse of the trivialised differential, dlog = (dexp)⁻¹, at the actual y, so that a residual is linearised where it is.

Source: J. Solà, J. Deray, D. Atchuthan, *A micro Lie theory for state estimation in robotics* (2018), sections II, III.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.groups import SO3, LieGroup, UnitQuaternion
from coadjoint.groups.rotation_vector import of_quaternion
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces.charts import Chart, along_bearing, bearing, bearing_frame, wrapped
from coadjoint.spaces.sphere import Sphere

OPPOSITE = 1e-6
"""The distance from −y, rad, within which a direction counts as opposite to y."""
OFF = 1e-2
"""The largest distance of a measured element from its group."""


class MeasuredSpace(ABC):
    """The space of a measurement. size: of the numbers y of a value. dim: of the noise. angles: which are in rad."""

    size: int
    dim: int
    title: str
    angles: np.ndarray
    everywhere: bool = False
    """Whether all numbers are values."""

    @property
    def curvature(self) -> np.ndarray:
        """Ric (dim, dim) in the axes of the noise: 0 of vectors; −¼ tr(ad ad) of a group, ½ of SO(3); 1 of S²."""
        return np.zeros((self.dim, self.dim))

    @abstractmethod
    def difference(self, h: PyTree, y: Array) -> Array:
        """h ⊖ y, (dim,), of an expected value and numbers (size,)."""

    @property
    def origin(self) -> np.ndarray:
        """The numbers (size,) of a value, where none was measured."""
        return np.zeros(self.size)

    @abstractmethod
    def value(self, y: Array) -> PyTree:
        """The value of numbers (size,)."""

    @abstractmethod
    def moved(self, h: PyTree, e: Array) -> PyTree:
        """The value at h with the error e (dim,), as h."""

    @abstractmethod
    def numbers(self, h: PyTree) -> Array:
        """The numbers (size,) of a value."""

    def off(self, values: np.ndarray) -> np.ndarray:
        """How far numbers (k, size) are from the space, (k,); 0 of vectors."""
        return np.zeros(len(values))

    def require(self, values: np.ndarray, what: str) -> None:
        """Raise ArgumentError where numbers (k, size), NaN aside, are no values of the space."""
        known = np.flatnonzero(np.all(np.isfinite(values), axis=1))
        off = self.off(values[known])
        if len(off) and not np.max(off) <= OFF:
            k = int(np.argmax(~(off <= OFF)))
            raise ArgumentError(
                f"{what} must be on {self.title}: number {known[k] + 1} of {len(values)}, "
                f"{shown(values[known[k]].tolist())}, is off it by {off[k]:.2g}. Check order and scale, and give NaN "
                "where nothing was measured."
            )


class Vectors(MeasuredSpace):
    """h − y of vectors, or of angles in rad within half a turn; h of any shape, flat."""

    def __init__(self, shape: tuple[int, ...], turning: bool = False):
        self.size = self.dim = int(np.prod(shape, dtype=int))
        self.angles, self.everywhere = np.full(self.size, turning), True
        self.title = "SO(2), by its angle" if turning else f"ℝ{self.size}"
        self._shape, self._turning = shape, turning

    def difference(self, h: PyTree, y: Array) -> Array:
        found = self.numbers(h) - y
        return wrapped(found) if self._turning else found

    def value(self, y: Array) -> PyTree:
        return jnp.reshape(y, self._shape)

    def moved(self, h: PyTree, e: Array) -> PyTree:
        return h + jnp.reshape(e, self._shape)

    def numbers(self, h: PyTree) -> Array:
        return jnp.ravel(jnp.asarray(h, dtype=float))


class Elements(MeasuredSpace):
    """Elements of a group with errors on a side, by their arrays end to end, or the rotation in them by a chart."""

    def __init__(self, group: LieGroup, side: str, chart: Chart | None):
        self._group, self._chart = group, chart
        self._body, self.dim = side == "body", group.dim
        leaves, self._structure = jax.tree.flatten(evaluate(group.identity))
        self._shapes = [leaf.shape for leaf in leaves]
        sizes = [int(np.prod(shape, dtype=int)) for shape in self._shapes]
        angles = np.zeros(sum(sizes), bool)
        if chart is not None:
            sizes[0], angles = chart.size, np.concatenate([chart.angles, angles[sizes[0] :]])
        self._ends, self.size, self.angles = np.cumsum(sizes).tolist(), sum(sizes), angles
        self.title = repr(group) if chart is None else f"{group!r}, by {chart.words}"

    @property
    def origin(self) -> np.ndarray:
        return np.asarray(evaluate(lambda: self.numbers(self._group.identity())))

    def value(self, y: Array) -> PyTree:
        parts = [y[a:b] for a, b in zip([0, *self._ends[:-1]], self._ends, strict=True)]
        leaves = [jnp.reshape(part, shape) for part, shape in zip(parts[1:], self._shapes[1:], strict=True)]
        first = jnp.reshape(parts[0], self._shapes[0]) if self._chart is None else self._chart.element(parts[0])
        return jax.tree.unflatten(self._structure, [first, *leaves])

    def difference(self, h: PyTree, y: Array) -> Array:
        group, back = self._group, self._group.inverse(self.value(y))
        turn = group.compose(back, h) if self._body else group.compose(h, back)
        # q and −q are one attitude.
        turn = jnp.where(turn[0] < 0, -turn, turn) if type(group) is UnitQuaternion else turn
        return group.log(turn)

    @property
    def curvature(self) -> np.ndarray:
        each = np.eye(self.dim)
        ad = evaluate(jax.vmap(jax.vmap(self._group.ad, (None, 0), 1), (0, None)), each, each)
        return -0.25 * np.einsum("ikl,jlk->ij", ad, ad)

    def moved(self, h: PyTree, e: Array) -> PyTree:
        turn = self._group.exp(e)
        return self._group.compose(h, turn) if self._body else self._group.compose(turn, h)

    def numbers(self, h: PyTree) -> Array:
        first, *leaves = jax.tree.leaves(h)
        first = first if self._chart is None else self._chart.numbers(first)
        return jnp.concatenate([jnp.ravel(leaf) for leaf in (first, *leaves)])

    def off(self, values: np.ndarray) -> np.ndarray:
        if self._chart is not None:
            return self._chart.off(values[:, : self._chart.size])
        group = self._group
        return np.asarray(evaluate(jax.vmap(lambda y: jnp.asarray(group.outside(self.value(y)))), values))


class Directions(MeasuredSpace):
    """Directions on S², of vectors (3,) of any length, or by bearing and elevation.

    The basis is `co.Sphere().frame` at y, and by bearing and elevation those along the bearing and up.
    """

    dim, title = 2, "the sphere, by a vector (3,) that is not zero"

    def __init__(self, by_bearing: bool):
        self._bearing = by_bearing
        self.size, self.angles = (2, np.ones(2, bool)) if by_bearing else (3, np.zeros(3, bool))

    def _frame(self, y: Array) -> tuple[Array, Array]:
        """y as a unit vector, and B (3, 2)."""
        if self._bearing:
            return along_bearing(y), bearing_frame(y)
        y = _unit(y)
        return y, Sphere().frame(SO3(), y)

    def difference(self, h: PyTree, y: Array) -> Array:
        y, B = self._frame(y)
        h = _unit(h)
        w, v = y @ h, h @ B
        # The logarithm of opposite directions has no value: the angle is π, and the axis and the slopes are chosen.
        opposite = (w < 0) & (v @ v < OPPOSITE**2)
        # An angle φ about an axis is that of the quaternion (cos φ, sin φ) halved.
        turn = jnp.concatenate([w[None], jnp.where(opposite, np.eye(2)[0], v), jnp.zeros(1)])
        return jnp.where(opposite, np.pi * np.eye(2)[0] - v, 0.5 * of_quaternion(turn)[:2])

    @property
    def origin(self) -> np.ndarray:
        return np.eye(self.size)[0]

    def value(self, y: Array) -> PyTree:
        return along_bearing(y) if self._bearing else y

    @property
    def curvature(self) -> np.ndarray:
        return np.eye(2)

    def moved(self, h: PyTree, e: Array) -> PyTree:
        h = _unit(h)
        B = bearing_frame(bearing(h)) if self._bearing else Sphere().frame(SO3(), h)
        v = B @ e
        return SO3().exp(jnp.cross(h, v)) @ h

    def numbers(self, h: PyTree) -> Array:
        return bearing(h) if self._bearing else _unit(h)

    def off(self, values: np.ndarray) -> np.ndarray:
        return np.zeros(len(values)) if self._bearing else np.where(np.linalg.norm(values, axis=1) > 0, 0.0, 1.0)


class MeasuredTogether(MeasuredSpace):
    """A product: the parts end to end."""

    def __init__(self, parts: Sequence[MeasuredSpace]):
        self._parts = list(parts)
        self.size, self.dim = sum(one.size for one in parts), sum(one.dim for one in parts)
        self.angles = np.concatenate([one.angles for one in parts])
        self._values = np.cumsum([0, *(one.size for one in parts)]).tolist()
        self._errors = np.cumsum([0, *(one.dim for one in parts)]).tolist()
        self.title = " × ".join(one.title for one in parts)

    def difference(self, h: PyTree, y: Array) -> Array:
        ends = zip(self._values, self._values[1:], strict=False)
        return jnp.concatenate([p.difference(x, y[a:b]) for p, x, (a, b) in zip(self._parts, h, ends, strict=True)])

    @property
    def origin(self) -> np.ndarray:
        return np.concatenate([part.origin for part in self._parts])

    @property
    def curvature(self) -> np.ndarray:
        found = np.zeros((self._errors[-1], self._errors[-1]))
        for part, a, b in zip(self._parts, self._errors, self._errors[1:], strict=False):
            found[a:b, a:b] = part.curvature
        return found

    def value(self, y: Array) -> PyTree:
        ends = zip(self._values, self._values[1:], strict=False)
        return tuple(part.value(y[a:b]) for part, (a, b) in zip(self._parts, ends, strict=True))

    def moved(self, h: PyTree, e: Array) -> PyTree:
        ends = zip(self._errors, self._errors[1:], strict=False)
        return tuple(p.moved(x, e[a:b]) for p, x, (a, b) in zip(self._parts, h, ends, strict=True))

    def numbers(self, h: PyTree) -> Array:
        return jnp.concatenate([part.numbers(x) for part, x in zip(self._parts, h, strict=True)])

    def off(self, values: np.ndarray) -> np.ndarray:
        ends = zip(self._values, self._values[1:], strict=False)
        each = [part.off(values[:, a:b]) for part, (a, b) in zip(self._parts, ends, strict=True)]
        return np.max(each, axis=0, initial=0.0)


def _unit(x: PyTree) -> Array:
    x = jnp.ravel(jnp.asarray(x, dtype=float))
    return x / jnp.sqrt(x @ x)
