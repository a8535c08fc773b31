"""Discrete Lagrangians on G × Q before reduction, and the discrete Euler–Lagrange equations (P36), (B7), (B8)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import numpy as np

from coadjoint.errors import LagrangianError
from coadjoint.groups.derivative import left_derivative
from coadjoint.groups.group import Array, Element, LieGroup
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import Places
from coadjoint.mechanics.system import System, require_signature
from coadjoint.spaces import Space, Trivial
from coadjoint.theory.algorithm import Algorithm


class Configuration(NamedTuple):
    """(g, q): an element and a point of Q in the space frame, (0,) where there is no Q; or sequences of these."""

    g: Element
    q: Array


def has_points(space: Space) -> bool:
    """Whether the system has this space at all."""
    return bool(space != Trivial(0))


class UnreducedLagrangian:
    """L(g_k, q_k, g_{k+1}, q_{k+1}, a₀; h) on (G × Q)² × V* (P36); on S × S with S = G Ⓢ V it is (B7), Q = V.

    `function` takes g [, q], g_next [, q_next] [, a0] [, p], h in this order and returns a number: q with
    `additional`, a0 with `advected`, p with `parameters`. Raises LagrangianError for other arguments.
    """

    def __init__(
        self,
        group: LieGroup,
        function: Callable[..., Any],
        *,
        additional: Space | Mapping[str, Space] | None = None,
        advected: Space | Mapping[str, Space] | None = None,
        parameters: Parameters | Mapping[str, Any] | None = None,
    ):
        self.function = function
        self.reduced = System(
            group, group_lagrangian=self._at_identity, additional=additional, advected=advected, parameters=parameters,
            name=getattr(function, "__name__", "system"),
        )  # fmt: skip
        dynamic = has_points(self.places.additional)
        pair = ["g", "q", "g_next", "q_next"] if dynamic else ["g", "g_next"]
        rest = ["a0"] if has_points(self.places.advected) else []
        rest += [] if self.reduced.parameters is None else ["p"]
        require_signature(function, "The unreduced discrete Lagrangian", [*pair, *rest, "h"])

    @property
    def places(self) -> Places:
        """G, Q and V*."""
        return self.reduced.places

    def __call__(self, first: Configuration, second: Configuration, a0: Array, h: Array) -> Array:
        """L at two configurations."""
        group, Q, V = self.places
        pair = [[c.g, Q.view(group, c.q)] if has_points(Q) else [c.g] for c in (first, second)]
        rest = [V.view(group, a0)] if has_points(V) else []
        rest += [] if self.reduced.parameters is None else [self.reduced.parameters]
        return self.function(*pair[0], *pair[1], *rest, h)

    def _at_identity(self, F: Element, *rest: Any) -> Array:
        """Λ(F, n, s, a; h) = L(e, n, F, s, a; h) (P37)."""
        e = self.places.group.identity()
        if not has_points(self.places.additional):
            return self.function(e, F, *rest)
        n, s, *others = rest
        return self.function(e, n, F, s, *others)


def configuration(L: UnreducedLagrangian, g: Element, q: Any = None) -> Configuration:
    """(g, q) with q (dim,), or by names on several spaces; without Q leave q out."""
    group, Q, _ = L.places
    if q is None:
        if has_points(Q):
            raise LagrangianError("This discrete Lagrangian has additional dynamics: give `q`.")
        return Configuration(g, np.zeros(0))
    return Configuration(g, Q.point(group, q, "q"))


def action(L: UnreducedLagrangian, path: Configuration, a0: Array, h: float) -> Array:
    """A = Σ L(g_k, q_k, g_{k+1}, q_{k+1}, a₀; h) of a sequence (B7); traceable by JAX."""
    first, second = (jax.tree.map(lambda leaf, cut=cut: leaf[cut], path) for cut in (slice(None, -1), slice(1, None)))
    return jax.numpy.sum(jax.vmap(lambda x, y: L(x, y, a0, h))(first, second))


def discrete_euler_lagrange(
    L: UnreducedLagrangian, before: Configuration, here: Configuration, after: Configuration, a0: Array, h: Array
) -> tuple[Array, Array]:
    """(D₃L_{k−1} + D₁L_k, D₄L_{k−1} + D₂L_k) (B8), zero where the sequence is stationary.

    The first is left-trivialised, ⟨·, η⟩ for δg_k = g_kη, shape (dim,); the second a covector at q_k, projected onto
    T*Q. Traceable by JAX.
    """
    group, Q, _ = L.places

    def two(g, q):
        return L(before, Configuration(g, q), a0, h) + L(Configuration(g, q), after, a0, h)

    on_group = left_derivative(group, lambda g: two(g, here.q), here.g)
    return on_group, Q.project(group, here.q, jax.grad(two, argnums=1)(here.g, here.q))


@dataclass(frozen=True)
class DiscreteEulerLagrange(Algorithm):
    """The algorithm ((g_{k−1}, q_{k−1}), (g_k, q_k)) ↦ ((g_k, q_k), (g_{k+1}, q_{k+1})) (B16) at fixed a₀."""

    L: UnreducedLagrangian

    @property
    def group(self) -> LieGroup:  # type: ignore[override]
        return self.L.places.group

    @property
    def space(self) -> Space:  # type: ignore[override]
        return self.L.places.additional

    def last(self, pair, h):
        before, here, _ = pair
        Q, group = self.space, self.group
        velocity = Q.tangent(group, here.q, Q.coordinates(group, here.q, (here.q - before.q) / h))
        return group.compose(group.inverse(before.g), here.g), here.q, velocity

    def conditions(self, pair, h, F, s):
        before, here, a0 = pair
        return discrete_euler_lagrange(self.L, before, here, Configuration(self.group.compose(here.g, F), s), a0, h)

    def following(self, pair, F, s):
        _, here, a0 = pair
        return here, Configuration(self.group.compose(here.g, F), s), a0


def discrete_euler_lagrange_algorithm(
    L: UnreducedLagrangian, first: Configuration, second: Configuration, a0: Any, h: float, steps: int
) -> Configuration:
    """The sequence of `steps` + 1 configurations that starts with two and solves (B8) at every inner node.

    `a0` (dim V*,) or None without advected parameters. Raises StepError where Newton does not solve a step.
    """
    group, _, V = L.places
    a0 = np.zeros(0) if a0 is None else V.point(group, a0, "a0")
    before, here, _ = DiscreteEulerLagrange(L).run((first, second, a0), h, steps - 1)
    return jax.tree.map(lambda rows, ends: np.concatenate([rows[:1], ends]), before, here)
