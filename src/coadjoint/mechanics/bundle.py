"""Motions on M × G: reduction and reconstruction (B32–B34), horizontal lifts and holonomy."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError, StepError
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.trace.jaxprs import results
from coadjoint.mechanics.connection import Connection, finite
from coadjoint.mechanics.discrete_connection import DiscreteConnection
from coadjoint.mechanics.start_arguments import checked_element
from coadjoint.mechanics.trace_checks import trace

_FINEST = 2**13
"""The most pieces into which an interval of a path is cut."""


def reduced(connection: DiscreteConnection, g: Element, x: ArrayLike) -> Element:
    """σ_k = F_k⁻¹ Ω(x_k, x_{k+1}) with F_k = g_k⁻¹g_{k+1} of a motion on M × G (B32–B34); σ = e on horizontal steps.

    g: elements with a leading axis (N+1); x: shapes (N+1, m). Returns elements with a leading axis (N).
    """
    x = shapes_of(connection, x)
    g = _elements_of(connection.group, g, len(x))
    compose, inverse = connection.group.compose, connection.group.inverse

    def relative(g: Element, g_next: Element, x: Array, x_next: Array) -> Element:
        return compose(inverse(compose(inverse(g), g_next)), connection.increment(x, x_next))

    found = evaluate(jax.vmap(relative), *_ends(g), x[:-1], x[1:])
    return finite(found, "The discrete connection")


def reconstructed(connection: DiscreteConnection, g0: Element, x: ArrayLike, sigma: Element) -> Element:
    """g_{k+1} = g_k Ω(x_k, x_{k+1}) σ_k⁻¹: the inverse of `reduced` from g₀ on.

    x: shapes (N+1, m). sigma: elements with a leading axis (N). Returns elements with a leading axis (N+1).
    """
    x = shapes_of(connection, x)
    sigma = _elements_of(connection.group, sigma, len(x) - 1)
    compose, inverse = connection.group.compose, connection.group.inverse

    def increment(x: Array, x_next: Array, sigma: Element) -> Element:
        return compose(connection.increment(x, x_next), inverse(sigma))

    increments = evaluate(jax.vmap(increment), x[:-1], x[1:], sigma)
    return finite(_product(connection.group, checked_element(connection.group, g0), increments), "The motion")


def horizontal_lift(
    connection: Connection | DiscreteConnection, shapes: PyTree, g0: Element = None, *, times: ArrayLike | None = None
) -> Element:
    """The motion in G along a path of shapes with 𝒜 = e at each step, or 𝒜 = 0: momentum zero for a mechanical 𝒜.

    connection: a co.mechanics.DiscreteConnection, for which g_{k+1} = g_k Ω(x_k, x_{k+1}), or a
        co.mechanics.Connection, g⁻¹ġ = −A(x)ẋ.
    shapes: of a discrete connection (N+1, m); of a continuous one a function t → x (m,) in terms of jax.numpy.
    g0: the element to start from, by default e.
    times: (N+1,), s, for a continuous connection only. It is integrated by Magnus' series of order 4, each interval cut
    into pieces until the elements stay to 1e-12.

    Returns elements with a leading axis (N+1). Raises ArgumentError for arguments that do not fit, and StepError where
    the pieces do not suffice.
    """
    if isinstance(connection, DiscreteConnection):
        checks.leave_out(times is not None, "`times`", "The lift of a discrete connection goes from shape to shape")
        x = shapes_of(connection, shapes)
        increments = evaluate(jax.vmap(connection.increment), x[:-1], x[1:])
    elif isinstance(connection, Connection):
        increments = _transports(connection, shapes, _times(times))
    else:
        raise ArgumentError(
            f"Argument `connection` must be a co.mechanics.Connection or a co.mechanics.DiscreteConnection, but is "
            f"{connection!r}."
        )
    g0 = checked_element(connection.group, g0)
    return finite(_product(connection.group, g0, increments), "The horizontal lift")


def holonomy(connection: Connection | DiscreteConnection, loop: PyTree) -> Element:
    """The holonomy of a closed loop of shapes, its rotation with 𝒜 = e: ∏ Ω(x_k, x_{k+1}), left to right, or its limit.

    connection: a co.mechanics.DiscreteConnection or a co.mechanics.Connection.
    loop: of a discrete connection (N+1, m) with x_N = x_0; of a continuous one a function t → x (m,) on 0 ≤ t ≤ 1 with
    x(1) = x(0).

    Returns an element of G. Raises ArgumentError for a loop that is open; where shapes are angles and the loop winds
    around, take the last element of co.mechanics.horizontal_lift.
    """
    if isinstance(connection, DiscreteConnection):
        ends = shapes_of(connection, loop)[[0, -1]]
        lift = horizontal_lift(connection, loop)
    else:
        lift = horizontal_lift(connection, loop, times=np.linspace(0.0, 1.0, 5))
        ends = evaluate(jax.vmap(loop), np.array([0.0, 1.0]))
    gap = float(np.max(np.abs(ends[1] - ends[0])))
    if gap > 1e-9 * max(1.0, float(np.max(np.abs(ends)))):
        raise ArgumentError(
            f"Argument `loop` must end where it begins, but its ends differ by {gap:.1e}; if shapes are angles and the "
            "loop winds around, take the last element of co.mechanics.horizontal_lift."
        )
    return jax.tree.map(lambda leaf: leaf[-1], lift)


def shapes_of(connection: DiscreteConnection, shapes: PyTree) -> np.ndarray:
    """A path of at least two shapes, (N+1, m); raises ArgumentError."""
    checks.instance(connection, "connection", DiscreteConnection, "a co.mechanics.DiscreteConnection")
    if callable(shapes):
        raise ArgumentError("A discrete connection goes from shape to shape: give an array (N+1, m), not a function.")
    found = checks.array(shapes, "shapes", f"(n, {connection.size})")
    checks.expect(len(found) > 1, found, "shapes", "two shapes or more")
    connection.require_shapes(found, "shapes")
    return found


def _elements_of(group: LieGroup, g: Element, count: int) -> Element:
    """Elements with a leading axis of this length; raises ArgumentError."""
    one = evaluate(group.identity)
    expected = [(count, *np.shape(leaf)) for leaf in jax.tree.leaves(one)]
    found = [np.shape(leaf) for leaf in jax.tree.leaves(g)]
    if found != expected or jax.tree.structure(g) != jax.tree.structure(one):
        raise ArgumentError(
            f"The elements of {group!r} along this path must be arrays of shape {', '.join(map(str, expected))}, but "
            f"have {', '.join(map(str, found))}."
        )
    return jax.tree.map(lambda leaf: float64(leaf, "The elements"), g)


def _ends(records: PyTree) -> tuple[PyTree, PyTree]:
    """All but the last, and all but the first."""
    return jax.tree.map(lambda leaf: leaf[:-1], records), jax.tree.map(lambda leaf: leaf[1:], records)


def _product(group: LieGroup, g0: Element, increments: Element) -> Element:
    """g₀, g₀F₀, g₀F₀F₁, …"""

    def products(g0: Element, increments: Element) -> Element:
        chain = jax.tree.map(lambda first, rest: jnp.concatenate([first[None], rest]), g0, increments)
        return jax.lax.associative_scan(jax.vmap(group.compose), chain)

    return evaluate(products, g0, increments)


def _times(times: ArrayLike | None) -> np.ndarray:
    if times is None:
        raise ArgumentError("The lift of a continuous connection needs `times`, an array (N+1,).")
    found = checks.array(times, "times", "(n,)")
    checks.expect(len(found) > 1, found, "times", "two times or more")
    return found


def _transports(connection: Connection, path: Callable[[Array], Array], times: np.ndarray) -> Element:
    """The increment over each interval, in so many pieces that twice as many change nothing over 1e-12."""
    if not callable(path):
        raise ArgumentError("A continuous connection lifts a function t → x (m,): give `shapes` as such, with `times`.")
    found = results(trace(path, "The path of shapes", (times[0],)))
    if len(found) != 1 or found[0].shape != (connection.size,):
        raise ArgumentError(
            f"The path of shapes must return an array of shape ({connection.size},), but returns "
            f"{', '.join(str(value.shape) for value in found)}."
        )
    connection.require_shapes(evaluate(jax.vmap(path), times), "shapes")
    pieces, before = 8, None
    while pieces <= _FINEST:
        after = finite(_in_pieces(connection, path, times, pieces), "The connection")
        if before is not None:
            change = max(np.max(np.abs(a - b)) for a, b in zip(*map(jax.tree.leaves, (before, after)), strict=True))
            if change <= 1e-12:
                return after
        before, pieces = after, 2 * pieces
    raise StepError(f"The horizontal lift does not settle with {_FINEST} pieces an interval: give more `times`.")


def _in_pieces(connection: Connection, path: Callable[[Array], Array], times: np.ndarray, pieces: int) -> Element:
    """Magnus' series of order 4 with two Gauss nodes a piece, for ġ = gξ: log F = ½h(ξ₁ + ξ₂) + (√3/12) h²[ξ₁, ξ₂]."""
    group = connection.group

    def velocity(t: Scalar):
        x, v = jax.jvp(path, (t,), (jnp.ones_like(t),))
        return connection.velocity(x, v)

    def piece(t: Scalar, h: Scalar):
        first, last = (velocity(t + h * (0.5 + side * np.sqrt(3) / 6)) for side in (-1, 1))
        return group.exp(0.5 * h * (first + last) + np.sqrt(3) / 12 * h**2 * group.ad(first, last))

    def interval(t: Scalar, h: Scalar):
        parts = jax.vmap(piece, in_axes=(0, None))(t + h * jnp.arange(pieces), h)
        size = pieces
        while size > 1:
            size //= 2
            parts = jax.vmap(group.compose)(*(jax.tree.map(lambda leaf, s=side: leaf[s::2], parts) for side in (0, 1)))
        return jax.tree.map(lambda leaf: leaf[0], parts)

    return evaluate(jax.vmap(interval), times[:-1], np.diff(times) / pieces)
