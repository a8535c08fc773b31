"""The discrete Euler–Poincaré–Poisson equations and their Kelvin–Noether theorem (B18)–(B27)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import GroupError, LagrangianError
from coadjoint.groups.derivative import right_derivative
from coadjoint.groups.group import Element, LieGroup
from coadjoint.mechanics.system import System
from coadjoint.spaces import Space, Trivial
from coadjoint.theory.algorithm import Algorithm
from coadjoint.theory.euler_poincare import Link, impulse, instant_after
from coadjoint.theory.instant import ALWAYS, Instant, given
from coadjoint.theory.unreduced import KEYWORDS, WithKeywords, has_points, keywords_of

End = Literal["left", "right"]
"""Where the parameter of l is taken: l(f_k, a_k) or, as (B18) prints it, l(f_k, a_{k+1})."""

PoissonFunction = Callable[..., PyTree]


class PoissonLink(NamedTuple):
    """f_k = g_{k+1}⁻¹g_k and a_k = g_k⁻¹a₀; `at`: the start time of the step and the inputs and internal state held
    over it, if they matter.

    f: an element. a: (dim V*,). A sequence of steps has a leading axis.
    """

    f: Element
    a: Array
    at: Instant = ALWAYS


@dataclass(frozen=True)
class PoissonLagrangian:
    """l(f, a, h) on G × V* with its parameter at the left end, l(f_k, a_k), or at the right, l(f_k, a_{k+1}) (B18).

    `function` may take keyword-only `t`, `inputs` and `internal`. `driven`: the system whose forces, inputs and
    internal state act; that of l itself, which has none, unless l was made by `poisson_lagrangian(system)`.
    """

    group: LieGroup
    space: Space
    function: PoissonFunction
    parameter: End = "left"
    driven: System | None = None

    def __post_init__(self):
        checks.choice(self.parameter, "parameter", ("left", "right"))
        if not self.space.flat:
            raise GroupError(f"Advected parameters need a representation of the group, but got {self.space!r}.")
        if self.driven is None:
            object.__setattr__(self, "driven", poisson_system(self))

    @property
    def system(self) -> System:
        """The system of l, with the forces, inputs and internal state that act."""
        assert self.driven is not None
        return self.driven

    def taken(self, link: PoissonLink) -> Array:
        """The parameter that l sees on a step, (dim V*,): a_k, or a_{k+1} = f_ka_k."""
        return link.a if self.parameter == "left" else self.space.act(self.group, link.f, link.a)

    def slopes(self, link: PoissonLink, h: Scalar) -> tuple[Array, Array]:
        """D^Rl and D₂l⋄a with the parameter that l sees, both (dim,); ⟨D^Rl, χ⟩ = d/dε l(e^{εχ}f, a)."""
        a = self.taken(link)

        keywords = self.system.keywords(self.function, *given(self.system, link.at))

        def value(f: Element, a: Array) -> Array:
            return self.function(f, a, h, **keywords)

        source = self.space.diamond(self.group, jax.grad(value, argnums=1)(link.f, a), a)
        return right_derivative(self.group, lambda f: value(f, a), link.f), source

    def torque(self, link: PoissonLink, h: Scalar) -> Array:
        """T⁻ = hT, (dim,), what the forces give at the left node of a step."""
        return impulse(self.system, self.link(link), h)[0]

    def link(self, link: PoissonLink) -> Link:
        """The same step in the variables of (P38), F = f⁻¹."""
        nothing = jnp.zeros(0)
        return Link(self.group.inverse(link.f), nothing, nothing, link.a, link.at)

    def next_a(self, link: PoissonLink) -> Array:
        """a_{k+1} = f_ka_k, (dim V*,)."""
        return self.space.act(self.group, link.f, link.a)


def poisson_system(l: PoissonLagrangian, *, forces: PyTree = None, internal: PyTree = None) -> System:
    """The system of l: Λ(F, a; h) = l(F⁻¹, a, h), or l(F⁻¹, F⁻¹a, h) with the parameter at the right end.

    `forces`, `internal`: as those of co.System.
    """

    taking = WithKeywords(partial(_on_group, l), keywords_of(l.function))
    return System(l.group, group_lagrangian=taking, advected=l.space, forces=forces, internal=internal)


def _on_group(l: PoissonLagrangian, F: Element, a: Array, h: Scalar, **keywords: object) -> Array:
    """Λ(F, a; h)."""
    f = l.group.inverse(F)
    return l.function(f, l.taken(PoissonLink(f, a)), h, **keywords)


def poisson_lagrangian(system: System, parameter: End = "left") -> PoissonLagrangian:
    """l(f, a_k) = Λ(f⁻¹, a_k), or l(f, a_{k+1}) = Λ(f⁻¹, f⁻¹a_{k+1}), of a system without additional dynamics.

    Time, forces, inputs and the internal state of the system act on l.
    """
    group, Q, V = system.places
    if has_points(Q):
        raise GroupError("The Euler–Poincaré–Poisson equations have no additional dynamics: leave out `additional`.")
    if system.group_lagrangian is None:
        raise LagrangianError(
            "l(f, a) needs a discrete Lagrangian in group form: pass `group_lagrangian` to co.System."
        )
    function = partial(_of_group, system.driven(None), parameter)
    keywords = tuple(filter(system.takes, KEYWORDS))
    return PoissonLagrangian(group, V, WithKeywords(function, keywords), parameter, system)


def _of_group(
    plain: System,
    parameter: End,
    f: Element,
    a: Array,
    h: Scalar,
    t: Array | float = 0.0,
    inputs: PyTree = None,
    internal: PyTree = None,
) -> Array:
    """l(f, a_k) or l(f, a_{k+1}) of a system that nothing drives."""
    group, _, V = plain.places
    F, nothing = group.inverse(f), jnp.zeros(0)
    a = a if parameter == "left" else V.act(group, F, a)
    return plain.reduced_group_lagrangian(F, nothing, nothing, a, h, t, inputs, internal)


def poisson_link(group: LieGroup, link: Link) -> PoissonLink:
    """(f, a) = (F⁻¹, a)."""
    return PoissonLink(group.inverse(link.F), link.a, link.at)


def discrete_euler_poincare_poisson(
    l: PoissonLagrangian,
    before: PoissonLink,
    here: PoissonLink,
    h: Scalar,
) -> Array:
    """(B19): Ad*_{f_k}D^Rl_k − D^Rl_{k−1} + D₂l⋄a_k + T⁻_k, zero on solutions, with D₂l of step k for a parameter at
    the left end and of step k − 1 for one at the right end. Shape (dim,); traceable by JAX.
    """
    (now, source), (last, source_before) = l.slopes(here, h), l.slopes(before, h)
    turning = l.group.Ad_dual(here.f, now) - last + (source if l.parameter == "left" else source_before)
    return turning + l.torque(here, h)


@dataclass(frozen=True)
class EulerPoincarePoisson(Algorithm):
    """The algorithm (f_{k−1}, a_{k−1}) ↦ (f_k, a_k) of (B19)."""

    l: PoissonLagrangian

    @property
    def group(self) -> LieGroup:  # type: ignore[override]
        return self.l.group

    @property
    def space(self) -> Space:  # type: ignore[override]
        return Trivial(0)

    def last(self, pair: PoissonLink, h: Scalar):
        return self.group.inverse(pair.f), jnp.zeros(0), jnp.zeros(0)

    def conditions(self, pair: PoissonLink, h: Scalar, F: Element, s: Array):
        return discrete_euler_poincare_poisson(self.l, pair, self.following(pair, h, F, s), h), s

    def following(self, pair: PoissonLink, h: Scalar, F: Element, s: Array):
        now = instant_after(self.l.system, self.l.link(pair), h)
        return PoissonLink(self.group.inverse(F), self.l.next_a(pair), now)


def poisson_algorithm(l: PoissonLagrangian, first: PoissonLink, h: Scalar, steps: int) -> PoissonLink:
    """The `steps` links (f, a) that start with one and solve (B19), every leaf with a leading axis."""
    first = jax.tree.map(lambda leaf: np.asarray(leaf, dtype=float), first)
    found: Any = EulerPoincarePoisson(l).run(first, h, checks.whole(steps, "steps") - 1)
    return found


def kelvin_noether_poisson(
    l: PoissonLagrangian,
    before: PoissonLink,
    here: PoissonLink,
    K: Array,
    h: Scalar,
) -> tuple[Array, Array]:
    """I^B_k = ⟨D^Rl_{k−1}, 𝒦(c_k, a_k)⟩ (B24) and its change −⟨D₂l⋄a_k + T⁻_k, 𝒦(c_k, a_k)⟩ over the next step (B25).

    `K` is 𝒦(c_k, a_k) (dim,). With the parameter at the left end D₂l is that of step k and I^B = −I of Theorem 7; at
    the right end D₂l is that of step k − 1. Traceable by JAX.
    """
    (momentum, source_before), (_, source) = l.slopes(before, h), l.slopes(here, h)
    change = (source if l.parameter == "left" else source_before) + l.torque(here, h)
    return momentum @ K, -change @ K
