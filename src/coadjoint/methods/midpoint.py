"""The midpoint rule with the true half of the increment."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp

from coadjoint.arrays import Array, Scalar
from coadjoint.groups.group import Element
from coadjoint.mechanics.discrete import Node, Point, chord, node
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.increments import HalfStepSquared
from coadjoint.methods.method import Method
from coadjoint.methods.step import Step


@dataclass(frozen=True)
class Midpoint(Method, HalfStepSquared):
    """Λ = hℓ(ξ, H⁻¹(n + s)/2, H⁻¹(s − n)/h, H⁻¹a) with H = σ(hξ/2) and F = H², order 2, symmetric.

    σ is the difference map given; the increment is its squared map. At the node n̄ = H⁻¹n + ½hν̄, ā = H⁻¹a, t + h/2:
    solve μ_k + Ad*_H μ_k + D = 2(dσ⁻¹_{hξ/2})*∂_ξℓ, H*π_k + ½κ = ∂_νℓ; then μ_{k+1} = Ad*_H(Ad*_H μ_k + D),
    π_{k+1} = H*(H*π_k + κ), n_{k+1} = H⁻¹(n̄ + ½hν̄), a_{k+1} = H⁻¹ā.
    """

    takes_smooth_actions = True

    @property
    def order(self) -> int:
        return 2

    @property
    def symmetric(self) -> bool:
        return True

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        return ((self, 1.0),)

    def _node(self, system: System, record: State, h: Scalar) -> tuple[Element, Array, Point, Node]:
        group, Q, V = system.places
        half = self.turn(system, h, record.xi)
        back = group.inverse(half)
        start, nu = Q.act(group, back, record.n), record.nu
        point = Point(record.xi, start + 0.5 * h * nu, nu, V.act(group, back, record.a), record.t + 0.5 * h)
        return half, start, point, node(system, record, point, chord(system, start, nu, 0.5, h))

    def nodes(self, system: System, record: State, h: Scalar) -> list[tuple[float, Node]]:
        return [(1.0, self._node(system, record, h)[-1])]

    def quadrature(self, system: System, record: State, h: Scalar) -> list[tuple[float, Point]]:
        return [(1.0, self._node(system, record, h)[2])]

    def equations(self, system: System, record: State, h: Scalar) -> Array:
        group, Q, _ = system.places
        half, start, point, at = self._node(system, record, h)
        momentum = 2 * self.difference_map.dtau_inverse_dual(group, 0.5 * h * point.xi, at.mu)
        carried = record.mu + group.Ad_dual(half, record.mu) + h * at.torque
        rest = at.pi - Q.pull(group, half, start, record.pi) - 0.5 * h * at.force
        return jnp.concatenate([momentum - carried, self.coordinates(system, record, half, rest)])

    def advance(self, system: System, record: State, h: Scalar) -> State:
        group, Q, V = system.places
        half, start, point, at = self._node(system, record, h)
        n = Q.act(group, group.inverse(half), point.n + 0.5 * h * point.nu)
        transported = Q.pull(group, half, n, Q.pull(group, half, start, record.pi) + h * at.force)
        return record.later(
            h, g=group.compose(record.g, group.compose(half, half)), n=n, a=V.act(group, group.inverse(half), point.a),
            mu=group.Ad_dual(half, group.Ad_dual(half, record.mu) + h * at.torque),
            pi=Q.momentum(group, n, transported, Q.pull(group, half, n, at.pi + 0.5 * h * at.force)),
        )  # fmt: skip

    def sources(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        """⟨Ad_{H⁻¹}𝒦_k, hΔ⟩ = ⟨𝒦_k, Ad*_{H⁻¹} hΔ⟩."""
        half, _, _, at = self._node(system, record, h)
        source = system.group.Ad_dual(system.group.inverse(half), h * at.source)
        return source, jnp.zeros_like(source)
