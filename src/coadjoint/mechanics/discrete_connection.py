"""Discrete principal connections on M × G (B28–B32): local and global form, refusals, change of section."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.difference_maps import DifferenceMap, Exponential
from coadjoint.errors import ArgumentError
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.trace.jaxprs import results
from coadjoint.mechanics.connection import ROUND_OFF, Bundle, Connection, finite, random_shapes
from coadjoint.mechanics.trace_checks import trace
from coadjoint.spaces import Space

_WHAT = "The increment Ω(x, x⁺) of a discrete connection"


@dataclass(frozen=True)
class DiscreteConnection(Bundle):
    """A discrete connection 𝒜((g, x), (g⁺, x⁺)) = g⁺ Ω(x, x⁺)⁻¹ g⁻¹ on M × G, M ⊂ ℝᵐ (B29, B31).

    group: G. size: m, at least 1. increment: the function Ω(x, x⁺) ∈ G of two shapes (m,), in terms of jax.numpy: what
    the horizontal lift of a step from x to x⁺ turns. shapes: M, by default ℝᵐ, as in co.mechanics.Connection. 𝒜 = e on
    horizontal steps; Ω(x, x) = e is not required. Raises GroupError and ArgumentError unless Ω is an element of G at
    random shapes.
    """

    increment: Callable[[Array, Array], Element]

    def __post_init__(self):
        super().__post_init__()
        x, x_next = random_shapes(self._M, self.group, 2)
        require_element(self.group, partial(trace, self.increment, _WHAT, (x, x_next)), _WHAT)
        outside = evaluate(lambda *pair: self.group.outside(self.increment(*pair)), x, x_next)
        if not outside <= ROUND_OFF:
            raise ArgumentError(f"{_WHAT} must lie in {self.group!r}, but is outside by {float(outside):.1e}.")

    def __call__(self, x: ArrayLike, x_next: ArrayLike) -> Element:
        """Ω(x, x⁺)."""
        pair = self.shape(x, "x"), self.shape(x_next, "x_next")
        return finite(evaluate(self.increment, *pair), "The discrete connection")

    def form(self, g: Element, x: Array, g_next: Element, x_next: Array) -> Element:
        """𝒜((g, x), (g⁺, x⁺)) = g⁺ Ω(x, x⁺)⁻¹ g⁻¹, an element, of shapes x and x⁺ (m,) (B31)."""
        compose, inverse = self.group.compose, self.group.inverse
        return compose(g_next, inverse(compose(g, self.increment(x, x_next))))

    def in_section(self, section: Callable[[Array], Element]) -> DiscreteConnection:
        """The same connection in the section g̃ = g χ(x)⁻¹: Ω̃ = χ(x) Ω(x, x⁺) χ(x⁺)⁻¹."""
        compose, inverse = self.group.compose, self.group.inverse
        what = "The change of section χ(x)"
        tried = random_shapes(self._M, self.group, 1)[0]
        require_element(self.group, partial(trace, section, what, (tried,)), what)

        def increment(x: Array, x_next: Array) -> Element:
            return compose(compose(section(x), self.increment(x, x_next)), inverse(section(x_next)))

        return DiscreteConnection(self.group, self.size, increment, shapes=self.shapes)

    @classmethod
    def from_form(
        cls,
        group: LieGroup,
        size: int,
        form: Callable[..., Element],
        *,
        shapes: Space | Mapping[str, Space] | None = None,
    ) -> DiscreteConnection:
        """The discrete connection of a global form 𝒜(g, x, g⁺, x⁺) ∈ G: Ω(x, x⁺) = 𝒜(e, x, e, x⁺)⁻¹.

        group, size, shapes: as above. Raises ArgumentError unless 𝒜(fg, x, f⁺g⁺, x⁺) = f⁺ 𝒜(g, x, g⁺, x⁺) f⁻¹ at
        random arguments (B29).
        """
        require_equivariant(Bundle(group, size, shapes=shapes), form)
        e = group.identity
        return cls(group, size, lambda x, x_next: group.inverse(form(e(), x, e(), x_next)), shapes=shapes)

    @classmethod
    def from_connection(
        cls, connection: Connection, difference_map: DifferenceMap | None = None, *, at: str = "middle"
    ) -> DiscreteConnection:
        """Ω(x, x⁺) = τ(−A(x̄)(x⁺ − x)), x̄ = (x + x⁺)/2: of order 2 in the step, and Ω(x⁺, x) = Ω(x, x⁺)⁻¹.

        With at="start", x̄ = x: order 1. `difference_map` is τ, co.Exponential() by default. The middle of two shapes of
        a curved M lies off M, where A must be smooth.
        """
        checks.choice(at, "at", ("middle", "start"))
        tau = Exponential() if difference_map is None else difference_map
        tau.require_fit(connection.group)

        def increment(x: Array, x_next: Array) -> Element:
            place = 0.5 * (x + x_next) if at == "middle" else x
            return tau.tau(connection.group, connection.velocity(place, x_next - x))

        return cls(connection.group, connection.size, increment, shapes=connection.shapes)


def require_element(group: LieGroup, traced: Callable[[], PyTree], what: str) -> None:
    """Raise ArgumentError unless a traced function returns arrays of the shapes of an element of G."""
    found = [value.shape for value in results(traced())]
    expected = [np.shape(leaf) for leaf in jax.tree.leaves(evaluate(group.identity))]
    if found != expected:
        raise ArgumentError(
            f"{what} must be an element of {group!r}, with arrays of shape {', '.join(map(str, expected))}, but has "
            f"{', '.join(map(str, found)) or 'nothing'}."
        )


def require_equivariant(bundle: Bundle, form: Callable[..., Element]) -> None:
    """Raise ArgumentError unless 𝒜(fg, x, f⁺g⁺, x⁺) = f⁺ 𝒜(g, x, g⁺, x⁺) f⁻¹ at random arguments (B29)."""
    group = bundle.group
    x, x_next = random_shapes(bundle._M, group, 2)
    turns = np.random.default_rng(29).normal(scale=0.7, size=(4, group.dim))
    e, what = evaluate(group.identity), "The form 𝒜(g, x, g⁺, x⁺) of a discrete connection"
    require_element(group, partial(trace, form, what, (e, x, e, x_next)), what)

    def error(turns: Array, x: Array, x_next: Array) -> tuple[Array, Array]:
        g, g_next, f, f_next = (group.exp(turn) for turn in turns)
        moved = group.matrix(form(group.compose(f, g), x, group.compose(f_next, g_next), x_next))
        expected = group.compose(group.compose(f_next, form(g, x, g_next, x_next)), group.inverse(f))
        return jnp.max(jnp.abs(moved - group.matrix(expected))), jnp.max(jnp.abs(moved))

    off, scale = map(float, evaluate(error, turns, x, x_next))
    if not off <= ROUND_OFF * scale:
        raise ArgumentError(
            "A discrete connection must be equivariant, 𝒜(fg, x, f⁺g⁺, x⁺) = f⁺ 𝒜(g, x, g⁺, x⁺) f⁻¹, but is off by "
            f"{off:.1e}; give its local form Ω(x, x⁺) to co.mechanics.DiscreteConnection instead."
        )
