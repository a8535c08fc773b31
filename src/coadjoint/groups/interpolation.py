"""Curves through elements of a group: the geodesic between two, and the cubic spline through many."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.groups.element_statistics import logarithms, stacked
from coadjoint.groups.group import Element, LieGroup
from coadjoint.kernels.trace.evaluate import evaluate, tabulate, traced

_ITERATIONS = 30
_SOLVED = 1e-12


def geodesic(group: LieGroup, start: Element, end: Element, s: Array) -> Element:
    """γ(s) = g exp(s log(g⁻¹h)) from g at s = 0 to h at s = 1, with the constant body velocity log(g⁻¹h).

    It is a one-parameter subgroup, translated, and the same from either side; on groups with a bi-invariant metric the
    shortest curve, on SE(3) a screw motion.

    group: that of the elements. start, end: g and h, elements. s: a number, or an array of any shape, which may leave
    [0, 1]. Returns an element, with the axes of `s` first. Raises GroupError where g⁻¹h has no logarithm, as
    `group.log`.
    """
    along = group.log(group.compose(group.inverse(start), end)) if traced(start, end) else None
    if along is None:
        along = group.log(evaluate(lambda g, h: group.compose(group.inverse(g), h), start, end))

    def at(s: Array, g: Element, along: Array) -> Element:
        curve: Callable[[Array], Element] = lambda one: group.compose(g, group.exp(one * along))  # noqa: E731
        for _ in range(jnp.ndim(s)):
            curve = jax.vmap(curve)
        return curve(s)

    return evaluate(at, s if traced(s) else np.asarray(s, float), start, along)


class Spline:
    """The cubic spline g(t) through elements at given times, twice continuously differentiable.

        g(t) = g_k exp(φ_k(t)),  t_k ≤ t ≤ t_{k+1},

    with cubic polynomials φ_k in 𝔤, φ_k(t_k) = 0 and exp(φ_k(t_{k+1})) = g_k⁻¹g_{k+1}, such that the body velocity
    g⁻¹ġ and its derivative are continuous. On ℝⁿ it is the usual cubic spline. It is carried by translations from the
    left, h g_k ↦ h g(t), and does not depend on a basis.

    group: G. times: (count,), strictly increasing, s, two or more. elements: of G, one for each time, an element whose
    leaves have a leading axis, or a list of elements. velocities: the body velocities at the first and the last node,
    (2, dim G); by default its derivative is 0 there (the natural spline).
    Raises ArgumentError for other times, numbers or velocities, GroupError where g_k⁻¹g_{k+1} has no logarithm.
    """

    def __init__(self, group: LieGroup, times: ArrayLike, elements: PyTree, velocities: ArrayLike | None = None):
        self.group = group
        self.elements = stacked(group, elements)
        count = len(jax.tree.leaves(self.elements)[0])
        self.times = _times(times, count)
        before, after = (jax.tree.map(lambda leaf, s=s: leaf[s], self.elements) for s in (slice(-1), slice(1, None)))
        self._increments = evaluate(jax.vmap(lambda g, h: group.compose(group.inverse(g), h)), before, after)
        self._logarithms = logarithms(group, self._increments)
        ends = None if velocities is None else _ends(velocities, group.dim)
        self.velocities, arrivals = self._solved(ends)
        """The body velocities at the nodes, (count, dim G)."""
        h = np.diff(self.times)[:, None]
        self._slopes = h * self.velocities[:-1], h * arrivals

    def __call__(self, t: Array) -> Element:
        """g(t) at times t, a number or an array of any shape, in s; an element with the axes of `t` first.

        Raises ArgumentError for a time outside those of the spline. Under jit, vmap and grad the end segments go on.
        """
        return self._along(self._element, t)

    def velocity(self, t: Array) -> Array:
        """The body velocity g⁻¹ġ at times t, as for the elements: (…, dim G), 1/s."""

        def at(t: Array) -> Array:
            g = self._element(t)
            slope = jax.jvp(lambda t: self.group.matrix(self._element(t)), (t,), (jnp.ones_like(t),))[1]
            return self.group.vee(self.group.matrix(self.group.inverse(g)) @ slope)

        return self._along(at, t)

    def _along(self, function: Callable[[Array], PyTree], t: Array) -> Any:
        if not traced(t):
            t = np.asarray(t, float)
            if not np.all((t >= self.times[0]) & (t <= self.times[-1])):
                raise ArgumentError(
                    f"Times must be from {self.times[0]:g} to {self.times[-1]:g} s, those of the spline, but are "
                    f"{shown(t)}."
                )
        for _ in range(jnp.ndim(t)):
            function = jax.vmap(function)
        return evaluate(function, t)

    def _element(self, t: Array) -> Element:
        k = jnp.clip(jnp.sum(t >= self.times) - 1, 0, len(self.times) - 2)
        start = jax.tree.map(lambda leaf: jnp.asarray(leaf)[k], self.elements)
        L, a, b = (jnp.asarray(part)[k] for part in (self._logarithms, *self._slopes))
        times = jnp.asarray(self.times)
        s = (t - times[k]) / (times[k + 1] - times[k])
        phi = s * (a + s * (3 * L - 2 * a - b + s * (a + b - 2 * L)))
        return self.group.compose(start, self.group.exp(phi))

    def _solved(self, ends: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        """ξ of the nodes, (count, dim G), and φ̇ at the ends of segments, (count − 1, dim G), by Newton's iteration.

        With ξ = T(φ)φ̇ and its derivative T(φ)φ̈ + B(φ, φ̇), where B is quadratic in φ̇, and φ = L, φ̇ = η at the end of a
        segment, all nodes but the ends have T (2ξ_{k−1} + 4η − 6L/h)/h + B(L, η) = (6L₊/h₊ − 4ξ_k − 2η₊)/h₊.
        """
        L, h = self._logarithms, np.diff(self.times)[:, None]
        rates = L / h
        xi = np.concatenate([rates[:1], 0.5 * (rates[1:] + rates[:-1]), rates[-1:]])
        curvature = tabulate(jax.vmap(lambda phi, slope: _curvature(self.group, phi, slope)), L, rates)
        T = curvature(L, rates)[0]
        back = np.linalg.inv(T)
        size = max(float(np.max(np.abs(rates), initial=0.0)), 1e-300)
        for _ in range(_ITERATIONS):
            eta = np.einsum("kij,kj->ki", back, xi[1:])
            _, B, slope = curvature(L, eta)
            step = _solve_blocks(*_equations(xi, eta, L, h, T, back, B, slope, ends))
            xi = xi - step
            if not np.all(np.isfinite(xi)):
                break
            if np.max(np.abs(step), initial=0.0) <= _SOLVED * size:
                return xi, np.einsum("kij,kj->ki", back, xi[1:])
        raise ArgumentError(
            f"The spline through {len(xi)} elements of {self.group!r} was not found, because neighbours are too far "
            "apart: give more nodes."
        )


def _curvature(group: LieGroup, phi: Array, slope: Array) -> tuple[Array, Array, Array]:
    """T(φ), (dim, dim), B(φ, φ̇), (dim,), and its derivative by φ̇, (dim, dim): T(φ)χ = exp(−φ) Dexp(φ)·χ."""

    def velocity(phi: Array, chi: Array) -> Array:
        moved = jax.jvp(lambda x: group.matrix(group.exp(x)), (phi,), (chi,))[1]
        return group.vee(group.matrix(group.exp(-phi)) @ moved)

    def bent(slope: Array) -> Array:
        return jax.jvp(lambda x: velocity(x, slope), (phi,), (slope,))[1]

    T = jax.vmap(lambda chi: velocity(phi, chi), out_axes=1)(jnp.eye(group.dim))
    return T, bent(slope), jax.jacfwd(bent)(slope)


def _equations(
    xi: np.ndarray, eta: np.ndarray, L: np.ndarray, h: np.ndarray, T: np.ndarray, back: np.ndarray, B: np.ndarray,
    slope: np.ndarray, ends: np.ndarray | None,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """The equations of all nodes, (count, dim), and their derivatives by neighbours, (count, dim, 3, dim)."""
    arriving = np.einsum("kij,kj->ki", T, 2 * xi[:-1] + 4 * eta - 6 * L / h) / h + B
    departing = (6 * L / h - 4 * xi[:-1] - 2 * eta) / h
    one, h = np.eye(xi.shape[1]), h[..., None]
    value, derivative = np.zeros_like(xi), np.zeros((*xi.shape, 3, xi.shape[1]))
    value[1:] += arriving
    derivative[1:, :, 0] += 2 * T / h
    derivative[1:, :, 1] += 4 * one / h + slope @ back
    value[:-1] -= departing
    derivative[:-1, :, 1] += 4 * one / h
    derivative[:-1, :, 2] += 2 * back / h
    if ends is not None:
        value[[0, -1]] = xi[[0, -1]] - ends
        derivative[[0, -1]] = 0.0
        derivative[[0, -1], :, 1] = one
    return value, derivative


def _solve_blocks(value: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """x (count, d) with Σ_j slope_kj x_{k+j−1} = value_k: value (count, d), slope (count, d, 3, d)."""
    from scipy.linalg import solve_banded  # a tenth of what a set-up takes

    count, d = value.shape
    width = 2 * d - 1
    banded = np.zeros((2 * width + 1, count * d))
    k, row, side, column = np.indices(slope.shape)
    i, j = k * d + row, (k + side - 1) * d + column
    inside = (j >= 0) & (j < count * d)
    banded[(width + i - j)[inside], j[inside]] = slope[inside]
    return solve_banded((width, width), banded, value.ravel(), check_finite=False).reshape(count, d)


def _times(times: ArrayLike, count: int) -> np.ndarray:
    try:
        t = np.asarray(times, dtype=float)
    except (TypeError, ValueError):
        t = np.zeros(0)
    fits = t.shape == (count,) and count >= 2 and np.all(np.diff(t) > 0) and np.all(np.isfinite(t))
    checks.expect(fits, times, "times", f"strictly increasing, one for each of two or more elements, here {count}")
    return t


def _ends(velocities: ArrayLike, dim: int) -> np.ndarray:
    try:
        found = np.asarray(velocities, dtype=float)
    except (TypeError, ValueError):
        found = np.zeros(0)
    fits = found.shape == (2, dim) and np.all(np.isfinite(found))
    checks.expect(fits, velocities, "velocities", f"those of the first and the last node, shape (2, {dim})")
    return found
