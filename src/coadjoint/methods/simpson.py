"""Simpson's rule along the straight motion between two nodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp

from coadjoint.arrays import Array, Scalar
from coadjoint.groups.group import Element
from coadjoint.mechanics.discrete import Node, Point, node
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.increments import HalfStepSquared
from coadjoint.methods.method import Method
from coadjoint.methods.step import Step

_END, _MIDDLE = 1 / 6, 4 / 6


class _Nodes(NamedTuple):
    """H, H⁻¹n, the mean of both ends, the sagitta e, the place at the end, and the values of ℓ at the three nodes."""

    half: Element
    begin: Array
    mean: Array
    sagitta: Array
    middle: Array
    n: Array
    a: Array
    points: tuple[Point, Point, Point]
    left: Node
    mid: Node
    right: Node


@dataclass(frozen=True)
class Simpson(Method, HalfStepSquared):
    """Λ = h(ℓ⁰ + 4ℓ^½ + ℓ¹)/6 at (n, Hν̄, a), (n̄, ν̄, ā) and (n₊, H⁻¹ν̄, a₊), F = H², order 2, symmetric.

    H = σ(hξ/2) with the difference map σ, n̄ = H⁻¹n + ½hν̄, n₊ = H⁻¹(n̄ + ½hν̄), ā = H⁻¹a, a₊ = H⁻¹ā: a third of the
    trapezoidal rule and two thirds of the midpoint rule. Solve (1 + Ad*_H)(μ_k + D⁰) + D^½ = 2(dσ⁻¹_{hξ/2})*Σw∂_ξℓ,
    H*(π_k + κ⁰) + ½κ^½ = H*∂_νℓ⁰/6 + 4∂_νℓ^½/6 + H⁻*∂_νℓ¹/6; then μ_{k+1} = Ad*_H(Ad*_H(μ_k + D⁰) + D^½) + D¹,
    π_{k+1} = H*(H*(π_k + κ⁰) + κ^½) + κ¹, with the weights in D = wh torque, κ = wh force.
    The quadrature is exact to order 4, so that the action exceeds that of the true motion by half its second variation,
    Λ − S = h³⟨α, α⟩/24 with the acceleration α off the straight motion: of one sign, as `VariableStep` requires.

    On a curved Q the path between the ends x₀, x₁ in the middle's frame is a parabola through the point x̄ =
    (x₀ + x₁)/2 + e, up to O(h⁶) on Q: 2e = (ρ(x₀, P(x₁ − x₀)/2) − x₀) + (ρ(x₁, P(x₀ − x₁)/2) − x₁). The middle node is
    at n̄ = x̄, the outer ones have ν̄ ± 4e/h, and α is the acceleration within Q. With R = ⅔(hκ + P⁰ − P¹), hκ of the
    middle and P = ∂_νℓ in its frame, e adds (∂e/∂x₀)ᵀR to ∂Λ/∂x₀, (∂e/∂x₁)ᵀR to ∂Λ/∂x₁, and to D^½
    (∂e/∂x₀)ᵀR⋄x₀ + (∂e/∂x₁)ᵀR⋄x₁ − R⋄e.
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

    def _nodes(self, system: System, record: State, h: Scalar) -> _Nodes:
        group, Q, V = system.places
        xi, nu, t = record.xi, record.nu, record.t
        half = self.turn(system, h, xi)
        back = group.inverse(half)
        begin, a = Q.act(group, back, record.n), V.act(group, back, record.a)
        mean = begin + 0.5 * h * nu
        end = mean + 0.5 * h * nu
        e = jnp.zeros_like(mean) if Q.flat else sagitta(system, begin, end)
        n, bent = mean + e, 4 * e / h
        first = Point(xi, record.n, Q.push(group, half, n, nu + bent), record.a, t)
        last = Point(xi, Q.act(group, back, end), Q.push(group, back, end, nu - bent), V.act(group, back, a), t + h)
        points = first, Point(xi, n, nu, a, t + 0.5 * h), last
        left, mid, right = (node(system, record, point) for point in points)
        return _Nodes(half, begin, mean, e, n, last.n, last.a, points, left, mid, right)

    def _of_sagitta(self, system: System, h: Scalar, at: _Nodes) -> tuple[Array, Array, Array]:
        """(∂e/∂x₀)ᵀR, (∂e/∂x₁)ᵀR, and what they add to D^½ at nodes that take e for a vector; zero on a flat Q."""
        group, Q, _ = system.places
        if Q.flat:
            return jnp.zeros_like(at.n), jnp.zeros_like(at.n), jnp.zeros(group.dim)
        start = Q.pull(group, at.half, at.begin, at.left.pi)
        end = Q.pull(group, group.inverse(at.half), at.middle, at.right.pi)
        along = 2 / 3 * (h * at.mid.force + start - end)
        ends = at.begin, at.begin + 2 * (at.mean - at.begin)
        _, back = jax.vjp(lambda x, y: sagitta(system, x, y), *ends)
        first, last = back(along)
        turning = Q.diamond(group, first, ends[0]) + Q.diamond(group, last, ends[1])
        return first, last, turning - Q.lifted_diamond(group, along, at.middle, at.sagitta)

    def nodes(self, system: System, record: State, h: Scalar) -> list[tuple[float, Node]]:
        at = self._nodes(system, record, h)
        return [(_END, at.left), (_MIDDLE, at.mid), (_END, at.right)]

    def quadrature(self, system: System, record: State, h: Scalar) -> list[tuple[float, Point]]:
        return list(zip((_END, _MIDDLE, _END), self._nodes(system, record, h).points, strict=True))

    def equations(self, system: System, record: State, h: Scalar) -> Array:
        group, Q, _ = system.places
        at = self._nodes(system, record, h)
        mean = _END * (at.left.mu + at.right.mu) + _MIDDLE * at.mid.mu
        carried = record.mu + _END * h * at.left.torque
        of_first, _, turning = self._of_sagitta(system, h, at)
        momentum = 2 * self.difference_map.dtau_inverse_dual(group, 0.5 * h * record.xi, mean)
        rows = momentum - carried - group.Ad_dual(at.half, carried) - _MIDDLE * h * at.mid.torque - turning
        first = _END * at.left.pi - record.pi - _END * h * at.left.force
        last = Q.pull(group, group.inverse(at.half), at.middle, _END * at.right.pi)
        rest = (
            Q.pull(group, at.half, at.begin, first) + last + _MIDDLE * (at.mid.pi - 0.5 * h * at.mid.force) - of_first
        )
        return jnp.concatenate([rows, self.coordinates(system, record, at.half, rest)])

    def advance(self, system: System, record: State, h: Scalar) -> State:
        group, Q, _ = system.places
        at = self._nodes(system, record, h)
        half = at.half

        def to_middle(b: Array) -> Array:
            return Q.pull(group, half, at.begin, b)

        def to_end(b: Array) -> Array:
            return Q.pull(group, half, at.n, b)

        transported = to_end(to_middle(record.pi + _END * h * at.left.force) + _MIDDLE * h * at.mid.force)
        _, of_last, turning = self._of_sagitta(system, h, at)
        legendre = to_end(to_middle(_END * at.left.pi) + _MIDDLE * (at.mid.pi + 0.5 * h * at.mid.force) + of_last)
        behind = _END * h * at.right.force
        mu = group.Ad_dual(half, record.mu + _END * h * at.left.torque) + _MIDDLE * h * at.mid.torque + turning
        return record.later(
            h,
            g=group.compose(record.g, group.compose(half, half)),
            n=at.n,
            a=at.a,
            mu=group.Ad_dual(half, mu) + _END * h * at.right.torque,
            pi=Q.momentum(group, at.n, transported + behind, legendre + _END * at.right.pi + behind),
        )

    def sources(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        at = self._nodes(system, record, h)
        back = system.group.inverse(at.half)
        ahead = _END * h * at.left.source + system.group.Ad_dual(back, _MIDDLE * h * at.mid.source)
        return ahead, _END * h * at.right.source


def sagitta(system: System, x: Array, y: Array) -> Array:
    """e, (ambient,), for which (x + y)/2 + e is the middle on Q of two points x, y (ambient,) of a curved Q."""
    group, Q, _ = system.places
    halfway = 0.5 * (y - x)
    ahead = Q.difference(group, x, Q.project(group, x, halfway))
    return 0.5 * (ahead + Q.difference(group, y, -Q.project(group, y, halfway)))
