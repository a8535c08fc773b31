"""Hopf's fibration S³ → S² with the fibre U(1): spinors and their directions, and Dirac's monopole as its connection.

A point of S³ is a pair (a, b) of complex numbers, p = (Re a, Im a, Re b, Im b), and lies over the direction

    x = (2 Re āb, 2 Im āb, |a|² − |b|²).

U(1) = SO(2) acts by p ↦ e^{iθ}p. S³ = SU(2) holds the attitudes of a body, x is its axis in space, and U(1) turns it
about this axis. A particle at x whose momentum along the fibre is e moves in the field of a monopole, e/2 per unit of
area.
"""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp

from coadjoint.arrays import Array
from coadjoint.groups import SO2, LieGroup
from coadjoint.groups.group import Element
from coadjoint.mechanics.principal_bundle import PrincipalBundle, Section
from coadjoint.spaces import Representation, Sphere, Trivial


@dataclass(frozen=True)
class Spinors(Representation):
    """ℂ² as ℝ⁴, on which U(1) acts by p ↦ e^{iθ}p."""

    def ambient(self, group: LieGroup) -> int:
        return 4

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        return jnp.ravel(jnp.reshape(x, (2, 2)) @ g.T)


def direction(p: Array) -> Array:
    """x = (2 Re āb, 2 Im āb, |a|² − |b|²), (3,), of p (4,)."""
    a, b = p[:2], p[2:]
    return jnp.stack([2 * a @ b, 2 * (a[0] * b[1] - a[1] * b[0]), a @ a - b @ b])


def phase(p: Array, q: Array) -> Array:
    """The rotation by the argument of ⟨p, q⟩ = p̄·q, (2, 2), of p and q (4,): e for q that is in phase with p."""
    u, v = p @ q, _imaginary(p) @ q
    c, s = u / jnp.hypot(u, v), v / jnp.hypot(u, v)
    return jnp.stack([jnp.stack([c, -s]), jnp.stack([s, c])])


def connection_form(p: Array) -> Array:
    """𝒜(p)v = Im(p̄·v)/|p|² as a row (1, 4) at p (4,): the mechanical connection of the round metric.

    Its curvature is half the area of S²; the lift of a loop turns by minus half its solid angle.
    """
    return _imaginary(p)[None] / (p @ p)


def fibration() -> PrincipalBundle:
    """S³ → S² by two sections: s₀ with a > 0 away from x₃ = −1, and s₁ with b > 0 away from x₃ = 1."""
    return PrincipalBundle(
        SO2(), Sphere(Spinors()), Sphere(Trivial(3)), direction, phase,
        (Section(_north, _above), Section(_south, _below)),
    )  # fmt: skip


def _north(x: Array) -> Array:
    a = jnp.sqrt(0.5 * (1 + x[2]))
    return jnp.stack([a, 0 * a, 0.5 * x[0] / a, 0.5 * x[1] / a])


def _south(x: Array) -> Array:
    b = jnp.sqrt(0.5 * (1 - x[2]))
    return jnp.stack([0.5 * x[0] / b, -0.5 * x[1] / b, b, 0 * b])


def _above(x: Array) -> Array:
    return 1 + x[2]


def _below(x: Array) -> Array:
    return 1 - x[2]


def _imaginary(p: Array) -> Array:
    """The vector ip with Im(p̄·v) = ip·v, (4,)."""
    return jnp.stack([-p[1], p[0], -p[3], p[2]])
