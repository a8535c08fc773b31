"""The discrete Euler–Poincaré equations on a semidirect product in their own variables (B9)–(B17)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import GroupError, LagrangianError
from coadjoint.groups.derivative import right_derivative
from coadjoint.groups.group import Element, LieGroup
from coadjoint.mechanics.system import System
from coadjoint.spaces import Space
from coadjoint.theory.algorithm import Algorithm
from coadjoint.theory.euler_poincare import Link, impulse, instant_after
from coadjoint.theory.instant import ALWAYS, Instant, given
from coadjoint.theory.unreduced import KEYWORDS, WithKeywords, keywords_of


class SemidirectLink(NamedTuple):
    """f = g_{k+1}⁻¹g_k, y = f u_k and u = u_{k+1}, with u_k = g_k⁻¹v_k (B9), (B10).

    `at`: the start time of the step and the inputs and internal state held over it, if they matter.

    f: an element. y, u: (dim V,). A sequence of steps has a leading axis.
    """

    f: Element
    y: Array
    u: Array
    at: Instant = ALWAYS


SemidirectFunction = Callable[..., PyTree]
"""l(f, y, u⁺, h) on S × V (B11); it may take keyword-only `t`, `inputs` and `internal`."""


@dataclass(frozen=True)
class SemidirectLagrangian:
    """l(f, y, u⁺, h) of a system, whose time, forces, inputs and internal state act on it."""

    system: System

    @property
    def function(self) -> SemidirectFunction:
        """l as a function with the keywords of the system."""
        return WithKeywords(partial(_of_group, self.system.driven(None)), tuple(filter(self.system.takes, KEYWORDS)))

    def __call__(self, f: Element, y: Array, u: Array, h: Scalar, **keywords: PyTree) -> Array:
        """l(f, y, u⁺, h)."""
        return self.function(f, y, u, h, **keywords)


def semidirect_system(
    group: LieGroup, space: Space, l: SemidirectFunction, *, forces: PyTree = None, internal: PyTree = None
) -> System:
    """The system of l(f, y, u⁺, h) on G Ⓢ V: Λ(F, n, s; h) = l(F⁻¹, F⁻¹n, F⁻¹s, h). `space` is V, a representation.

    `forces`, `internal`: as those of co.System; the functions of (B13) take them with `semidirect_lagrangian(system)`.
    """
    if not space.flat:
        raise GroupError(f"A semidirect product needs a representation of the group, but got {space!r}.")

    taking = WithKeywords(partial(_on_group, group, space, l), keywords_of(l))
    return System(group, group_lagrangian=taking, additional=space, forces=forces, internal=internal)


def _of_group(
    plain: System,
    f: Element,
    y: Array,
    u: Array,
    h: Scalar,
    t: Array | float = 0.0,
    inputs: PyTree = None,
    internal: PyTree = None,
) -> Array:
    """l(f, y, u⁺, h) of a system that nothing drives."""
    group, Q, _ = plain.places
    F = group.inverse(f)
    n, s = Q.act(group, F, y), Q.act(group, F, u)
    return plain.reduced_group_lagrangian(F, n, s, np.zeros(0), h, t, inputs, internal)


def _on_group(
    group: LieGroup, space: Space, l: SemidirectFunction, F: Element, n: Array, s: Array, h: Scalar, **keywords: object
) -> Array:
    """Λ(F, n, s; h)."""
    f = group.inverse(F)
    return l(f, space.act(group, f, n), space.act(group, f, s), h, **keywords)


def semidirect_lagrangian(system: System) -> SemidirectLagrangian:
    """l(f, y, u⁺, h) = Λ(f⁻¹, f⁻¹y, f⁻¹u⁺; h) of a system without advected parameters."""
    group, _, V = system.places
    if V.ambient(group):
        raise GroupError("l(f, y, u⁺) of (B11) has no parameters: leave out `advected`, or see `poisson_lagrangian`.")
    if system.group_lagrangian is None:
        raise LagrangianError(
            "l(f, y, u⁺) needs a discrete Lagrangian in group form: pass `group_lagrangian` to co.System."
        )
    return SemidirectLagrangian(system)


def _driven(group: LieGroup, space: Space, l: SemidirectFunction | SemidirectLagrangian) -> SemidirectLagrangian:
    """l with the system that drives it; a new one, without forces, where it is a function."""
    if isinstance(l, SemidirectLagrangian):
        return l
    return SemidirectLagrangian(semidirect_system(group, space, l))


def semidirect_link(group: LieGroup, space: Space, link: Link) -> SemidirectLink:
    """(f, y, u⁺) = (F⁻¹, F⁻¹n, F⁻¹s) (B9); traceable by JAX."""
    f = group.inverse(link.F)
    return SemidirectLink(f, space.act(group, f, link.n), space.act(group, f, link.s), link.at)


def _link(group: LieGroup, space: Space, link: SemidirectLink) -> Link:
    """The same step in the variables of (P38)."""
    F = group.inverse(link.f)
    return Link(F, space.act(group, F, link.y), space.act(group, F, link.u), np.zeros(0), link.at)


def discrete_euler_poincare_semidirect(
    group: LieGroup,
    space: Space,
    l: SemidirectFunction | SemidirectLagrangian,
    before: SemidirectLink,
    here: SemidirectLink,
    h: Scalar,
) -> tuple[Array, Array]:
    """(B13): Ad*_{f_k}(D^Rl_k − D₂l_k⋄y_k) − (D^Rl_{k−1} − D₂l_{k−1}⋄y_{k−1}) + T⁻_k − φ⁻_k⋄u_k and
    f_k*D₂l_k + D₃l_{k−1} + φ⁻_k.

    ⟨D^Rl, χ⟩ = d/dε l(e^{εχ}f, y, u⁺). Zero on solutions; shapes (dim,), (dim V,). Traceable by JAX.
    """
    driven = _driven(group, space, l)
    function = driven.function if l is driven else l

    def momentum(link: SemidirectLink) -> tuple[Array, Array, Array]:
        keywords = driven.system.keywords(function, *given(driven.system, link.at))

        def value(f: Element, y: Array, u: Array) -> Array:
            return function(f, y, u, h, **keywords)

        along_y, along_u = jax.grad(value, argnums=(1, 2))(*link[:3])
        turned = right_derivative(group, lambda f: value(f, link.y, link.u), link.f)
        return turned - space.diamond(group, along_y, link.y), along_y, along_u

    now, along_y, _ = momentum(here)
    last, _, along_u = momentum(before)
    torque, force = impulse(driven.system, _link(group, space, here), h)
    turning = group.Ad_dual(here.f, now) - last + torque - space.diamond(group, force, before.u)
    return turning, space.pull(group, here.f, before.u, along_y) + along_u + force


@dataclass(frozen=True)
class SemidirectEulerPoincare(Algorithm):
    """The algorithm (f_{k−1}, y_{k−1}, u_k) ↦ (f_k, y_k, u_{k+1}) of (B13)."""

    group: LieGroup
    space: Space
    l: SemidirectFunction | SemidirectLagrangian

    def last(self, pair: SemidirectLink, h: Scalar):
        F = self.group.inverse(pair.f)
        return F, pair.u, (pair.u - pair.y) / h

    def conditions(self, pair: SemidirectLink, h: Scalar, F: Element, s: Array):
        here = self.following(pair, h, F, s)
        return discrete_euler_poincare_semidirect(self.group, self.space, self.l, pair, here, h)

    def following(self, pair: SemidirectLink, h: Scalar, F: Element, s: Array):
        system = _driven(self.group, self.space, self.l).system
        now = instant_after(system, _link(self.group, self.space, pair), h)
        return semidirect_link(self.group, self.space, Link(F, pair.u, s, np.zeros(0), now))


def semidirect_algorithm(
    group: LieGroup,
    space: Space,
    l: SemidirectFunction | SemidirectLagrangian,
    first: SemidirectLink,
    h: Scalar,
    steps: int,
) -> SemidirectLink:
    """The `steps` links (f, y, u⁺) that start with one and solve (B13), every leaf with a leading axis."""
    first = jax.tree.map(lambda leaf: np.asarray(leaf, dtype=float), first)
    found: Any = SemidirectEulerPoincare(group, space, l).run(first, h, checks.whole(steps, "steps") - 1)
    return found
