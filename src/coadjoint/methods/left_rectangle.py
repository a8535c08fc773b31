"""The left rectangle rule: the paper's scheme."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp

from coadjoint.arrays import Array, Scalar
from coadjoint.mechanics.discrete import Node, Point, chord, node
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.increments import FullStep
from coadjoint.methods.method import Method
from coadjoint.methods.step import Step


@dataclass(frozen=True)
class LeftRectangle(Method, FullStep):
    """Λ = hℓ(ξ, n, (s − n)/h, a), order 1; with `start="velocity"` the scheme of (P73), (P74).

    Solve μ_k + D = (dτ⁻¹_{hξ})*∂_ξℓ, π_k + κ = ∂_νℓ; then μ_{k+1} = Ad*_F(μ_k + D), π_{k+1} = F*(π_k + κ),
    n_{k+1} = F⁻¹(n + hν), a_{k+1} = F⁻¹a, with D = h torque and κ = h force of the node (n, ν, a).
    """

    takes_smooth_actions = True

    @property
    def order(self) -> int:
        return 1

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        return ((self, 1.0),)

    def _node(self, system: System, record: State, h: Scalar) -> tuple[Point, Node]:
        point = Point(record.xi, record.n, record.nu, record.a, record.t)
        return point, node(system, record, point, chord(system, record.n, record.nu, 0.0, h))

    def nodes(self, system: System, record: State, h: Scalar) -> list[tuple[float, Node]]:
        return [(1.0, self._node(system, record, h)[1])]

    def quadrature(self, system: System, record: State, h: Scalar) -> list[tuple[float, Point]]:
        return [(1.0, self._node(system, record, h)[0])]

    def equations(self, system: System, record: State, h: Scalar) -> Array:
        group = system.group
        point, at = self._node(system, record, h)
        momentum = self.difference_map.dtau_inverse_dual(group, h * point.xi, at.mu)
        rest = self.coordinates(system, record, None, at.pi - record.pi - h * at.force)
        return jnp.concatenate([momentum - record.mu - h * at.torque, rest])

    def advance(self, system: System, record: State, h: Scalar) -> State:
        group, Q, V = system.places
        point, at = self._node(system, record, h)
        F = self.relative(system, record, h)
        back = group.inverse(F)
        n = Q.act(group, back, record.n + h * point.nu)
        transported = Q.pull(group, F, n, record.pi + h * at.force)
        return record.later(
            h,
            g=group.compose(record.g, F),
            n=n,
            a=V.act(group, back, record.a),
            mu=group.Ad_dual(F, record.mu + h * at.torque),
            pi=Q.momentum(group, n, transported, Q.pull(group, F, n, at.pi)),
        )

    def sources(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        source = h * self._node(system, record, h)[1].source
        return source, jnp.zeros_like(source)
