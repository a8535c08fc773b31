"""The discrete Euler–Poincaré equations on a semidirect product in their own variables (B9)–(B17)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import numpy as np

from coadjoint.errors import GroupError
from coadjoint.groups.derivative import right_derivative
from coadjoint.groups.group import Array, Element, LieGroup
from coadjoint.mechanics.system import System
from coadjoint.spaces import Space
from coadjoint.theory.algorithm import Algorithm
from coadjoint.theory.euler_poincare import Link


class SemidirectLink(NamedTuple):
    """f = g_{k+1}⁻¹g_k, y = f u_k and u = u_{k+1}, with u_k = g_k⁻¹v_k (B9), (B10)."""

    f: Element
    y: Array
    u: Array


SemidirectLagrangian = Callable[[Element, Array, Array, Any], Any]
"""l(f, y, u⁺, h) on S × V (B11)."""


def semidirect_system(group: LieGroup, space: Space, l: SemidirectLagrangian) -> System:
    """The system of l(f, y, u⁺, h) on G Ⓢ V: Λ(F, n, s; h) = l(F⁻¹, F⁻¹n, F⁻¹s, h). `space` is V, a representation."""
    if not space.flat:
        raise GroupError(f"A semidirect product needs a representation of the group, but got {space!r}.")

    def group_lagrangian(F, n, s, h):
        f = group.inverse(F)
        return l(f, space.act(group, f, n), space.act(group, f, s), h)

    return System(group, group_lagrangian=group_lagrangian, additional=space)


def semidirect_lagrangian(system: System) -> SemidirectLagrangian:
    """l(f, y, u⁺, h) = Λ(f⁻¹, f⁻¹y, f⁻¹u⁺; h) of a system without advected parameters."""
    group, Q, V = system.places
    if V.ambient(group):
        raise GroupError("l(f, y, u⁺) of (B11) has no parameters: leave out `advected`, or see `poisson_lagrangian`.")

    def l(f, y, u, h):  # noqa: E743
        F = group.inverse(f)
        nothing = np.zeros(0)
        return system.reduced_group_lagrangian(F, Q.act(group, F, y), Q.act(group, F, u), nothing, h)

    return l


def semidirect_link(group: LieGroup, space: Space, link: Link) -> SemidirectLink:
    """(f, y, u⁺) = (F⁻¹, F⁻¹n, F⁻¹s) (B9); traceable by JAX."""
    f = group.inverse(link.F)
    return SemidirectLink(f, space.act(group, f, link.n), space.act(group, f, link.s))


def discrete_euler_poincare_semidirect(
    group: LieGroup,
    space: Space,
    l: SemidirectLagrangian,
    before: SemidirectLink,
    here: SemidirectLink,
    h: Array,
) -> tuple[Array, Array]:
    """(B13): Ad*_{f_k}(D^Rl_k − D₂l_k⋄y_k) − (D^Rl_{k−1} − D₂l_{k−1}⋄y_{k−1}) and f_k*D₂l_k + D₃l_{k−1}.

    ⟨D^Rl, χ⟩ = d/dε l(e^{εχ}f, y, u⁺). Zero on solutions; shapes (dim,), (dim V,). Traceable by JAX.
    """

    def momentum(link: SemidirectLink) -> tuple[Array, Array, Array]:
        along_y, along_u = jax.grad(l, argnums=(1, 2))(*link, h)
        turned = right_derivative(group, lambda f: l(f, link.y, link.u, h), link.f)
        return turned - space.diamond(group, along_y, link.y), along_y, along_u

    now, along_y, _ = momentum(here)
    last, _, along_u = momentum(before)
    return group.Ad_dual(here.f, now) - last, space.pull(group, here.f, before.u, along_y) + along_u


@dataclass(frozen=True)
class SemidirectEulerPoincare(Algorithm):
    """The algorithm (f_{k−1}, y_{k−1}, u_k) ↦ (f_k, y_k, u_{k+1}) of (B13)."""

    group: LieGroup
    space: Space
    l: SemidirectLagrangian

    def last(self, pair: SemidirectLink, h):
        F = self.group.inverse(pair.f)
        return F, pair.u, (pair.u - pair.y) / h

    def _next(self, pair: SemidirectLink, F, s) -> SemidirectLink:
        return semidirect_link(self.group, self.space, Link(F, pair.u, s, np.zeros(0)))

    def conditions(self, pair: SemidirectLink, h, F, s):
        here = self._next(pair, F, s)
        return discrete_euler_poincare_semidirect(self.group, self.space, self.l, pair, here, h)

    def following(self, pair: SemidirectLink, F, s):
        return self._next(pair, F, s)


def semidirect_algorithm(
    group: LieGroup,
    space: Space,
    l: SemidirectLagrangian,
    first: SemidirectLink,
    h: float,
    steps: int,
) -> SemidirectLink:
    """The `steps` links (f, y, u⁺) that start with one and solve (B13), every leaf with a leading axis."""
    found: Any = SemidirectEulerPoincare(group, space, l).run(first, h, steps - 1)
    return found
