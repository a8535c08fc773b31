"""The right rectangle rule, adjoint to the left one."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp

from coadjoint.arrays import Array, Scalar
from coadjoint.groups.group import Element
from coadjoint.mechanics.discrete import Node, Point, chord, node
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.increments import FullStep
from coadjoint.methods.left_rectangle import LeftRectangle
from coadjoint.methods.method import Method
from coadjoint.methods.step import Step


@dataclass(frozen=True)
class RightRectangle(Method, FullStep, adjoint_of=LeftRectangle):
    """Λ = hℓ(ξ, F⁻¹s, F⁻¹(s − n)/h, F⁻¹a), order 1.

    At the node n⁺ = F⁻¹n + hν⁺, a⁺ = F⁻¹a: solve μ_k = (dτ⁻¹_{hξ})*∂_ξℓ, F*π_k = ∂_νℓ; then
    μ_{k+1} = Ad*_F μ_k + D, π_{k+1} = F*π_k + κ.
    """

    takes_smooth_actions = True

    @property
    def order(self) -> int:
        return 1

        return LeftRectangle(self.difference_map, self.start)

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        return ((self, 1.0),)

    def turn(self, system: System, h: Scalar, xi: Array) -> Element:
        return self.difference_map.tau(system.group, h * xi)

    def _node(self, system: System, record: State, h: Scalar) -> tuple[Element, Array, Point, Node]:
        group, Q, V = system.places
        xi = record.xi
        F = self.relative(system, record, h)
        back = group.inverse(F)
        start, nu = Q.act(group, back, record.n), record.nu
        point = Point(xi, start + h * nu, nu, V.act(group, back, record.a), record.t + h)
        return F, start, point, node(system, record, point, chord(system, start, nu, 1.0, h))

    def nodes(self, system: System, record: State, h: Scalar) -> list[tuple[float, Node]]:
        return [(1.0, self._node(system, record, h)[-1])]

    def quadrature(self, system: System, record: State, h: Scalar) -> list[tuple[float, Point]]:
        return [(1.0, self._node(system, record, h)[2])]

    def equations(self, system: System, record: State, h: Scalar) -> Array:
        group, Q, _ = system.places
        F, start, point, at = self._node(system, record, h)
        momentum = self.difference_map.dtau_inverse_dual(group, h * point.xi, at.mu)
        rest = self.coordinates(system, record, F, at.pi - Q.pull(group, F, start, record.pi))
        return jnp.concatenate([momentum - record.mu, rest])

    def advance(self, system: System, record: State, h: Scalar) -> State:
        group, Q, _ = system.places
        F, start, point, at = self._node(system, record, h)
        kick = h * at.force
        transported = Q.pull(group, F, start, record.pi) + kick
        return record.later(
            h,
            g=group.compose(record.g, F),
            n=point.n,
            a=point.a,
            mu=group.Ad_dual(F, record.mu) + h * at.torque,
            pi=Q.momentum(group, point.n, transported, at.pi + kick),
        )

    def sources(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        source = h * self._node(system, record, h)[-1].source
        return jnp.zeros_like(source), source
