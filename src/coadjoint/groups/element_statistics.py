"""Many elements of a group, as they are measured: their coordinates at a reference, and their mean."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, GroupError, shown
from coadjoint.groups.group import Element, LieGroup, require_solution
from coadjoint.kernels.trace.evaluate import evaluate, tabulate

_ITERATIONS = 200
_SOLVED = 1e-13
"""The size of a step, in units of the basis and of the largest deviation, at which an iteration has converged."""


def mean(group: LieGroup, elements: PyTree, weights: ArrayLike | None = None) -> Element:
    """The mean m of elements g_i with Σ w_i log(m⁻¹g_i) = 0, by m ↦ m exp(Σ w_i log(m⁻¹g_i)/Σ w_i).

    It is carried by translations from either side and by inversion, mean(hg_ik) = h mean(g_i) k. On groups with a
    bi-invariant metric, as SO(n), U(n) and unit quaternions, it is the Riemannian centre of mass (Karcher, Fréchet):
    the least Σ w_i |log(m⁻¹g_i)|²; on the others, such as SE(3), it is the bi-invariant mean.

    group: that of the elements. elements: an element whose leaves have a leading axis, as `run.records.g`, or a list of
    elements. weights: (count,), not negative, by default equal. Returns an element. Raises GroupError where an element
    is so far from the mean that m⁻¹g_i has no logarithm, ArgumentError for other weights and where the elements are too
    far apart for a mean.
    Source: X. Pennec, V. Arsigny (2013), Exponential barycenters of the canonical Cartan connection and invariant means
    on Lie groups.
    """
    g = stacked(group, elements)
    count = len(jax.tree.leaves(g)[0])
    w = np.ones(count) if weights is None else _weights(weights, count)
    m = jax.tree.map(lambda leaf: leaf[np.argmax(w)], g)

    def moved(m: Element, along: Any) -> Element:
        return group.compose(m, group.exp(along))

    step = np.zeros(group.dim)
    deviate, move = tabulate(lambda m, g: _between(group, m, g), m, g), tabulate(moved, m, step)
    for _ in range(_ITERATIONS):
        xi = deviate(m, g)
        if not np.all(np.isfinite(xi)):
            _require_near(group, m, g, xi)
        step = w @ xi / np.sum(w)
        m = move(m, step)
        if np.max(np.abs(step), initial=0.0) <= _SOLVED * max(1.0, np.max(np.abs(xi), initial=0.0)):
            _require_near(group, m, g, deviate(m, g))
            return m
    raise ArgumentError(
        f"The {count} elements of {group!r} are too far apart for a mean: the iteration still moves by "
        f"{np.max(np.abs(step)):.1e} after {_ITERATIONS} steps; take elements nearer to each other."
    )


def logarithms(group: LieGroup, elements: PyTree) -> np.ndarray:
    """log g_i of every element, (count, dim G).

    elements: an element whose leaves have a leading axis, or a list of elements. Raises GroupError as `group.log`, and
    names the element.
    """
    g = stacked(group, elements)
    xi = evaluate(jax.vmap(group.log), g)
    _require_near(group, evaluate(group.identity), g, xi)
    return xi


def stacked(group: LieGroup, elements: PyTree) -> Element:
    """Elements as one PyTree of NumPy's arrays with a leading axis; raises ArgumentError for what holds none."""
    e = evaluate(group.identity)
    leaves, structure = jax.tree.flatten(e)
    try:
        if isinstance(elements, list):
            rows = [structure.flatten_up_to(element) for element in elements]
            arrays = [np.array([np.asarray(row[i], float) for row in rows]) for i in range(len(leaves))]
        else:
            arrays = [np.asarray(leaf, float) for leaf in structure.flatten_up_to(elements)]
    except (TypeError, ValueError):
        arrays = []
    shapes = [leaf.shape for leaf in leaves]
    if [array.shape[1:] for array in arrays] != shapes or len({array.shape[:1] for array in arrays}) != 1:
        wanted = ", ".join(str(("count", *shape)) for shape in shapes)
        raise ArgumentError(
            f"Elements of {group!r} must be arrays of shape {wanted}, or a list of elements, but are {shown(elements)}."
        )
    if not arrays[0].shape[0] or not all(np.all(np.isfinite(array)) for array in arrays):
        raise ArgumentError(f"Elements of {group!r} must be one or more, and finite, but are {shown(elements)}.")
    return jax.tree.unflatten(structure, arrays)


def _between(group: LieGroup, m: Element, g: Element) -> Array:
    """log(m⁻¹g_i), (count, dim G)."""
    back = group.inverse(m)
    return jax.vmap(lambda one: group.log(group.compose(back, one)))(g)


def _require_near(group: LieGroup, m: Element, g: Element, xi: np.ndarray) -> None:
    """Raise GroupError that names the first element without exp(ξ_i) = m⁻¹g_i, ξ (count, dim G)."""

    def misfit(m: Element, g: Element, xi: Array) -> Array:
        off = group.matrix(group.compose(m, group.exp(xi))) - group.matrix(g)
        return jnp.max(jnp.abs(off)) / jnp.max(jnp.abs(group.matrix(g)), initial=1.0)

    off = evaluate(jax.vmap(misfit, in_axes=(None, 0, 0)), m, g, xi)
    wrong = np.flatnonzero(~(off <= 1e-6))
    if len(wrong):
        one = jax.tree.map(lambda leaf: leaf[wrong[0]], g)
        between = evaluate(lambda m, one: group.compose(group.inverse(m), one), m, one)
        try:
            require_solution(group, "exp", xi[wrong[0]], group.exp, between)
        except GroupError as error:
            raise GroupError(f"Element {wrong[0]}: {error}") from error


def _weights(weights: ArrayLike, count: int) -> np.ndarray:
    try:
        w = np.asarray(weights, dtype=float)
    except (TypeError, ValueError):
        w = np.full(0, np.nan)
    fits = w.shape == (count,) and np.all(w >= 0) and (0 < np.sum(w) < np.inf)
    checks.expect(fits, weights, "weights", f"{count} finite numbers that are not negative, with a positive sum")
    return w
