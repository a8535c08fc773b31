"""The integrable heavy tops: Lagrange, Kovalevskaya, Goryachev and Chaplygin; their integrals are watched."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import jax.numpy as jnp

from coadjoint.groups import SO3
from coadjoint.mechanics.members import Quantity
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.system import System
from coadjoint.models.heavy_top import CHECKS, UNITS, lagrangian, start
from coadjoint.models.quantities import checked, positive
from coadjoint.spaces import Defining

__all__ = ["goryachev_chaplygin", "kovalevskaya", "lagrange", "start"]

_UNITS = {
    **UNITS,
    "axial_momentum": "kg m²/s",
    "kovalevskaya_integral": "rad⁴/s⁴",
    "chaplygin_integral": "rad³/s³",
    "vertical_momentum": "kg m²/s",
}


def lagrange(
    *,
    mass: Quantity,
    lever: Quantity,
    transverse: Quantity,
    axial: Quantity,
    gravity: Quantity = 9.81,
) -> System:
    """Lagrange's top: J = diag(I₁, I₁, I₃) about the pivot, the mass centre on the axis at r = l e₃.

    Integrals: energy, vertical momentum μ·a, axial momentum μ₃. u = cos θ = a₃ is an elliptic function of time,
    u̇² = (2mgl/I₁)(u − u₁)(u − u₂)(u − u₃).

    mass: kg. lever: l, m. transverse, axial: I₁, I₃, kg m². gravity: m/s².
    """
    inertia = (positive(transverse, "transverse"), transverse, positive(axial, "axial"))
    watched = {"axial_momentum": axial_momentum}
    return _top("Lagrange top", mass, gravity, (0.0, 0.0, positive(lever, "lever")), inertia, watched)


def kovalevskaya(*, mass: Quantity, lever: Quantity, axial: Quantity, gravity: Quantity = 9.81) -> System:
    """Kovalevskaya's top: J = diag(2C, 2C, C) about the pivot, the mass centre in the equator at r = l e₁.

    Integrals: energy, vertical momentum μ·a, and K = |(ω₁ + iω₂)² − k(a₁ + ia₂)|² with k = mgl/C.

    mass: kg. lever: l, m. axial: C, kg m². gravity: m/s². Source: Kovalevskaya (1889).
    """
    C = positive(axial, "axial")
    watched = {"kovalevskaya_integral": kovalevskaya_integral}
    return _top("Kovalevskaya top", mass, gravity, (positive(lever, "lever"), 0.0, 0.0), (2 * C, 2 * C, C), watched)


def goryachev_chaplygin(*, mass: Quantity, lever: Quantity, axial: Quantity, gravity: Quantity = 9.81) -> System:
    """The top of Goryachev and Chaplygin: J = diag(4C, 4C, C) about the pivot, the mass centre at r = l e₁.

    Integrals: energy, vertical momentum μ·a, and where that is zero G = ω₃(ω₁² + ω₂²) − kω₁a₃ with k = mgl/C.

    mass: kg. lever: l, m. axial: C, kg m². gravity: m/s². Source: Chaplygin (1901).
    """
    C = positive(axial, "axial")
    watched = {"vertical_momentum": vertical_momentum, "chaplygin_integral": chaplygin_integral}
    name = "Goryachev–Chaplygin top"
    return _top(name, mass, gravity, (positive(lever, "lever"), 0.0, 0.0), (4 * C, 4 * C, C), watched)


def axial_momentum(state):
    """μ₃, conserved by the top's symmetry about its axis."""
    return state.mu[2]


def vertical_momentum(state):
    """μ·a, the Casimir function of the heavy top; the integral of Goryachev and Chaplygin needs it to be zero."""
    return state.mu @ state.a


def kovalevskaya_integral(state, p):
    """K = |(ω₁ + iω₂)² − k(a₁ + ia₂)|², k = mgl/C."""
    omega, k = _velocity(state, p), _strength(p)
    real = omega[0] ** 2 - omega[1] ** 2 - k * state.a[0]
    imaginary = 2 * omega[0] * omega[1] - k * state.a[1]
    return real**2 + imaginary**2


def chaplygin_integral(state, p):
    """G = ω₃(ω₁² + ω₂²) − kω₁a₃, k = mgl/C, conserved where μ·a = 0."""
    omega = _velocity(state, p)
    return omega[2] * (omega[0] ** 2 + omega[1] ** 2) - _strength(p) * omega[0] * state.a[2]


def _velocity(state, p):
    """ω = J⁻¹μ at the node, J diagonal."""
    return state.mu / jnp.diag(p.inertia)


def _strength(p):
    """k = mgl/C."""
    return p.mass * p.gravity * p.center_of_mass[0] / p.inertia[2, 2]


def _top(
    name: str,
    mass: Quantity,
    gravity: Quantity,
    lever: Sequence[Quantity],
    inertia: Sequence[Quantity],
    quantities: object,
) -> System:
    given = {"mass": mass, "center_of_mass": list(lever), "inertia": list(inertia), "gravity": gravity}
    p = Parameters(**checked(CHECKS, given))
    spaces = {
        "advected": Defining(),
        "parameters": p,
        "quantities": quantities,
        "checks": partial(checked, CHECKS),
    }
    return System(SO3(), lagrangian, **spaces, name=name, units=_UNITS)
