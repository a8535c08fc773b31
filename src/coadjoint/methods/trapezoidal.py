"""The trapezoidal rule: the mean of the left and the right rectangle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import jax.numpy as jnp

from coadjoint.arrays import Array, Scalar
from coadjoint.groups.group import Element
from coadjoint.mechanics.discrete import Node, Point, node
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.increments import FullStep
from coadjoint.methods.method import Method
from coadjoint.methods.step import Step


class _Ends(NamedTuple):
    """The increment, the points at both ends and the values of ℓ there."""

    F: Element
    first: Point
    last: Point
    at_first: Node
    at_last: Node


@dataclass(frozen=True)
class Trapezoidal(Method, FullStep):
    """Λ = ½hℓ(ξ, n, ν, a) + ½hℓ(ξ, F⁻¹s, F⁻¹ν, F⁻¹a) with ν = (s − n)/h, order 2, symmetric.

    With ⁰ at (n, ν, a) and ¹ at (F⁻¹(n + hν), F⁻¹ν, F⁻¹a): solve μ_k + ½D⁰ = (dτ⁻¹_{hξ})*½(∂_ξℓ⁰ + ∂_ξℓ¹),
    F*(π_k + ½κ⁰) = ½(F*∂_νℓ⁰ + ∂_νℓ¹); then μ_{k+1} = Ad*_F(μ_k + ½D⁰) + ½D¹, π_{k+1} = F*(π_k + ½κ⁰) + ½κ¹.
    """

    @property
    def order(self) -> int:
        return 2

    @property
    def symmetric(self) -> bool:
        return True

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        return ((self, 1.0),)

    def _ends(self, system: System, record: State, h: Scalar) -> _Ends:
        group, Q, V = system.places
        xi = record.xi
        nu = record.nu
        F = self.relative(system, record, h)
        back = group.inverse(F)
        first = Point(xi, record.n, nu, record.a, record.t)
        end = record.n + h * nu
        carried = Q.push(group, back, end, nu)
        last = Point(xi, Q.act(group, back, end), carried, V.act(group, back, record.a), record.t + h)
        return _Ends(F, first, last, node(system, record, first), node(system, record, last))

    def nodes(self, system: System, record: State, h: Scalar) -> list[tuple[float, Node]]:
        ends = self._ends(system, record, h)
        return [(0.5, ends.at_first), (0.5, ends.at_last)]

    def quadrature(self, system: System, record: State, h: Scalar) -> list[tuple[float, Point]]:
        ends = self._ends(system, record, h)
        return [(0.5, ends.first), (0.5, ends.last)]

    def equations(self, system: System, record: State, h: Scalar) -> Array:
        group, Q, _ = system.places
        F, first, _last, start, end = self._ends(system, record, h)
        mean = 0.5 * (start.mu + end.mu)
        momentum = self.difference_map.dtau_inverse_dual(group, h * first.xi, mean)
        begin = Q.act(group, group.inverse(F), record.n)
        # Written in the frame of node k + 1, where the flat rule needs no inverse of F*.
        rest = 0.5 * end.pi + Q.pull(group, F, begin, 0.5 * start.pi - record.pi - 0.5 * h * start.force)
        return jnp.concatenate(
            [momentum - record.mu - 0.5 * h * start.torque, self.coordinates(system, record, F, rest)]
        )

    def advance(self, system: System, record: State, h: Scalar) -> State:
        group, Q, _ = system.places
        F, _, last, start, end = self._ends(system, record, h)
        transported = Q.pull(group, F, last.n, record.pi + 0.5 * h * start.force) + 0.5 * h * end.force
        legendre = 0.5 * Q.pull(group, F, last.n, start.pi) + 0.5 * end.pi + 0.5 * h * end.force
        return record.later(
            h,
            g=group.compose(record.g, F),
            n=last.n,
            a=last.a,
            mu=group.Ad_dual(F, record.mu + 0.5 * h * start.torque) + 0.5 * h * end.torque,
            pi=Q.momentum(group, last.n, transported, legendre),
        )

    def sources(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        ends = self._ends(system, record, h)
        return 0.5 * h * ends.at_first.source, 0.5 * h * ends.at_last.source
