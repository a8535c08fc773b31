"""Principal bundles P → M by local sections: changes of section, local connections, lifts through several of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError, GroupError
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.bundle import shapes_of
from coadjoint.mechanics.connection import ROUND_OFF, Connection, finite
from coadjoint.mechanics.discrete_connection import DiscreteConnection
from coadjoint.mechanics.state import State
from coadjoint.spaces import Space

_TRIED = 4
"""Random points of P at which a bundle is tested."""


@dataclass(frozen=True)
class Section:
    """A local section s: U → P of a bundle, on U = {x ∈ M: domain(x) > 0}.

    point: x (m,) ↦ s(x) (n,), smooth about U. domain: x (m,) ↦ one number. Both in terms of jax.numpy.
    """

    point: Callable[[Array], Array]
    domain: Callable[[Array], Scalar]


@dataclass(frozen=True)
class PrincipalBundle:
    """A principal bundle π: P → M, P/G = M, whose points over U_i are p = g·s_i(x).

    Where U_i and U_j overlap, s_j(x) = χ(x)·s_i(x), so that (g, x) through s_i is (gχ(x)⁻¹, x) through s_j.

    group: G. total: P ⊂ ℝⁿ, a space on which G acts freely. shapes: M ⊂ ℝᵐ, on which it does nothing.
    project: π, p (n,) ↦ x (m,). between: (p, q), points of one fibre, ↦ g with q = g·p. sections: s_i, which cover M.
    Functions are in terms of jax.numpy. Raises ArgumentError unless π(g·p) = π(p), between(p, g·p) = g, π(s_i(x)) = x
    and some U_i holds x, at random points.
    """

    group: LieGroup
    total: Space
    shapes: Space
    project: Callable[[Array], Array]
    between: Callable[[Array, Array], Element]
    sections: tuple[Section, ...]

    def __post_init__(self):
        checks.instance(self.group, "group", LieGroup, "a Lie group such as co.SO2()", error=GroupError)
        for name in ("total", "shapes"):
            checks.instance(getattr(self, name), name, Space, "a space such as co.Sphere(co.Trivial(3))")
        object.__setattr__(self, "sections", tuple(self.sections))
        for section in self.sections:
            checks.instance(section, "sections", Section, "a tuple of co.mechanics.Section")
        checks.expect(self.sections, self.sections, "sections", "at least one co.mechanics.Section")
        self.total.require_fit(self.group)
        self.shapes.require_fit(self.group)
        random = np.random.default_rng(1931)
        p = np.stack([self.total.sample(self.group, random) for _ in range(_TRIED)])
        etas = random.normal(scale=0.7, size=(_TRIED, self.group.dim))
        for what, (found, expected) in evaluate(jax.vmap(self._axioms), p, etas).items():
            _require(what, found, expected)
        x = evaluate(jax.vmap(self.project), p)
        depths = evaluate(jax.vmap(self.depths), x)
        if not np.all(np.max(depths, axis=1) > 0):
            raise ArgumentError(
                f"Some section must be defined at every shape, but none is at {x[depths.max(1).argmin()]}."
            )
        for i, section in enumerate(self.sections):
            inside = x[depths[:, i] > 0]
            if len(inside):
                _require(
                    "π(s(x)) = x", evaluate(jax.vmap(lambda x, s=section: self.project(s.point(x))), inside), inside
                )

    def _axioms(self, p: Array, eta: Array) -> dict[str, tuple[Array, Array]]:
        """Both sides of what projection and action have to satisfy."""
        group, g = self.group, self.group.exp(eta)
        q = self.total.act(group, g, p)
        return {
            "π(g·p) = π(p)": (self.project(q), self.project(p)),
            "between(p, g·p) = g": (group.matrix(self.between(p, q)), group.matrix(g)),
        }

    def depths(self, x: Array) -> Array:
        """The functions of all domains at a shape x (m,), (number of sections,)."""
        return jnp.stack([jnp.asarray(section.domain(x), dtype=float) for section in self.sections])

    def transition(self, i: int, j: int, x: Array) -> Element:
        """χ(x) with s_j(x) = χ(x)·s_i(x), an element, at a shape x (m,)."""
        first, other = self.section(i, "i").point, self.section(j, "j").point
        return evaluate(lambda x: self.between(first(x), other(x)), x)

    def point(self, i: int, g: Element, x: Array) -> Array:
        """p = g·s_i(x), (n,), of a shape x (m,)."""
        section = self.section(i, "i").point
        return evaluate(lambda g, x: self.total.act(self.group, g, section(x)), g, x)

    def trivialised(self, i: int, p: Array) -> tuple[Element, Array]:
        """(g, x) with p = g·s_i(x), of a point p (n,) over U_i."""
        section = self.section(i, "i").point

        def local(p: Array) -> tuple[Element, Array]:
            x = self.project(p)
            return self.between(section(x), p), x

        return evaluate(local, p)

    def carried(self, i: int, j: int, state: State) -> State:
        """A state (g, x, μ, π) through s_i as one through s_j, the same covector of P.

        g̃ = gχ⁻¹, μ̃ = Ad*_{χ⁻¹}μ, π̃ = π + ⟨μ̃, (Dχ·)χ⁻¹⟩. Velocities stay, for the first guess of a step.
        """
        group, x = self.group, state.n
        back = group.inverse(self.transition(i, j, x))
        mu = group.Ad_dual(back, state.mu)

        def turned(y: Array) -> Array:
            return group.vee(group.matrix(group.compose(self.transition(i, j, y), back)))

        pi = self.shapes.project(group, x, state.pi + jax.vjp(turned, x)[1](mu)[0])
        return state.replace(g=group.compose(state.g, back), mu=mu, pi=pi)

    def connection(self, form: Callable[[Array], Array], section: int = 0) -> Connection:
        """The local form A(x) = 𝒜(s(x))∘Ds(x) of a connection through a section.

        form: p (n,) ↦ 𝒜(p) (dim G, n) in terms of jax.numpy. section: its number. Raises ArgumentError unless
        𝒜(p)(ξ·p) = ξ and 𝒜(g·p)(g·v) = Ad_g 𝒜(p)v at random points.
        """
        random, group, P = np.random.default_rng(1932), self.group, self.total
        p = P.sample(group, random)
        v = evaluate(lambda p, v: P.project(group, p, v), p, random.normal(size=len(p)))
        eta, xi = random.normal(scale=0.7, size=(2, group.dim))

        def sides(p: Array, v: Array, eta: Array, xi: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
            g = group.exp(eta)
            moved = form(P.act(group, g, p)) @ P.push(group, g, p, v)
            return (form(p) @ P.infinitesimal(group, xi, p), xi), (moved, group.Ad(g, form(p) @ v))

        for what, pair in zip(
            ("𝒜(p)(ξ·p) = ξ", "𝒜(g·p)(g·v) = Ad_g 𝒜(p)v"), evaluate(sides, p, v, eta, xi), strict=True
        ):
            _require(what, *pair)
        s = self.section(section)
        size = self.shapes.ambient(group)
        return Connection(group, size, lambda x: form(s.point(x)) @ jax.jacfwd(s.point)(x), shapes=self.shapes)

    def discrete_connection(self, form: Callable[[Array, Array], Element], section: int = 0) -> DiscreteConnection:
        """The increment Ω(x, x⁺) = 𝒜(s(x), s(x⁺))⁻¹ of a discrete connection through a section (B31).

        form: (p, p⁺) ↦ 𝒜(p, p⁺) ∈ G, (n,) each, in terms of jax.numpy. section: its number. Raises ArgumentError unless
        𝒜(g·p, g⁺·p⁺) = g⁺ 𝒜(p, p⁺) g⁻¹ at random points (B29).
        """
        random, group, P = np.random.default_rng(1933), self.group, self.total
        p, q = (P.sample(group, random) for _ in range(2))

        def sides(p: Array, q: Array, etas: Array) -> tuple[Array, Array]:
            g, g_next = map(group.exp, etas)
            moved = form(P.act(group, g, p), P.act(group, g_next, q))
            expected = group.compose(group.compose(g_next, form(p, q)), group.inverse(g))
            return group.matrix(moved), group.matrix(expected)

        _require(
            "𝒜(g·p, g⁺·p⁺) = g⁺ 𝒜(p, p⁺) g⁻¹", *evaluate(sides, p, q, random.normal(scale=0.7, size=(2, group.dim)))
        )
        s = self.section(section)
        size = self.shapes.ambient(group)

        def increment(x: Array, x_next: Array) -> Element:
            return group.inverse(form(s.point(x), s.point(x_next)))

        return DiscreteConnection(group, size, increment, shapes=self.shapes)

    def horizontal_lift(self, form: Callable[[Array, Array], Element], shapes: ArrayLike, p: ArrayLike) -> np.ndarray:
        """The points of P, (N+1, n), over a path of shapes (N+1, m) with 𝒜 = e at each step, from p (n,) on.

        form: as in `discrete_connection`. Each step is taken through the section that holds both of its ends best, so
        that the path may go anywhere. Raises ArgumentError where no section holds a step, or p is not over the first
        shape.
        """
        locals_ = [self.discrete_connection(form, i) for i in range(len(self.sections))]
        x = shapes_of(locals_[0], shapes)
        first = np.asarray(self.total.point(self.group, p, "p"))
        _require("π(p) = x₀", evaluate(self.project, first), x[0])
        depths = evaluate(jax.vmap(self.depths), x)
        held = np.minimum(depths[:-1], depths[1:])
        if not np.all(held.max(axis=1) > 0):
            raise ArgumentError("Each step of `shapes` must lie in the domain of one section: give more shapes.")

        def step(i: int, p: Array, x_next: Array) -> Array:
            g, x = self.trivialised(i, p)
            return self.point(i, self.group.compose(g, locals_[i].increment(x, x_next)), x_next)

        steps = [partial(step, i) for i in range(len(self.sections))]

        def along(p: Array, x: Array, chosen: Array) -> Array:
            def one(p: Array, at: tuple[Array, Array]) -> tuple[Array, Array]:
                p = jax.lax.switch(at[1], steps, p, at[0])
                return p, p

            return jax.lax.scan(one, p, (x, chosen))[1]

        found = evaluate(along, first, x[1:], held.argmax(axis=1))
        return finite(np.concatenate([first[None], found]), "The horizontal lift")

    def section(self, number: object, name: str = "section") -> Section:
        """A section by its number; raises ArgumentError where there is none."""
        return self.sections[checks.whole(number, name, 0, len(self.sections) - 1)]


def _require(what: str, found: PyTree, expected: PyTree) -> None:
    """Raise ArgumentError unless both sides of an identity agree to round-off."""
    off = np.max(np.abs(np.asarray(found) - np.asarray(expected)), initial=0.0)
    if not off <= ROUND_OFF * max(1.0, float(np.max(np.abs(expected), initial=0.0))):
        raise ArgumentError(f"A principal bundle must satisfy {what}, but is off by {off:.1e}.")
