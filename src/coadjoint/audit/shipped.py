"""Every method that is shipped, as instances to audit, and the difference maps that they are audited with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp

from coadjoint.arrays import Array
from coadjoint.audit.systems import QUICK, AuditSystem
from coadjoint.difference_maps import Cayley, DifferenceMap, Exponential, Pade, SecondKind, Squared
from coadjoint.groups import SE3
from coadjoint.groups.group import Element
from coadjoint.mechanics.constraints import Constraint
from coadjoint.mechanics.system import System
from coadjoint.methods import (
    AdjointVariational,
    CommutatorFree,
    Composition,
    CrouchGrossman,
    EnergyMomentum,
    Galerkin,
    GroupVariational,
    HamiltonianMidpoint,
    IsospectralMidpoint,
    KahanLi6,
    KahanLi8,
    LeftRectangle,
    LeftRight,
    Method,
    Midpoint,
    MuntheKaas,
    ProjectedMidpoint,
    RightRectangle,
    Simpson,
    SofroniouSpaletta6,
    SofroniouSpaletta8,
    SofroniouSpaletta10,
    Suzuki4,
    Symmetrised,
    Trapezoidal,
    VariableStep,
    Variational,
    Yoshida4,
)


def as_it_is(system: System) -> System:
    return system


def _constraints(system: System) -> dict[str, Constraint] | None:
    return {one.name: one.constraint for one in system.constraints} or None


def with_left_rectangle(system: System) -> System:
    """The system with Λ = hℓ(ξ, n, (s − n)/h, a) in addition to ℓ; in group form with ξ = (F − F⁻¹)ᵛ/2h."""
    group, dynamic = system.group, system.additional.ambient(system.group) > 0

    def in_algebra(xi: Array, *rest):
        *places, h = rest
        if dynamic:
            n, s, *places = places
            places = [n, (s - n) / h, *places]
        return h * system.lagrangian(xi, *places)  # type: ignore[misc]

    def on_group(F: Element, *rest):
        apart = group.vee(group.matrix(F) - group.matrix(group.inverse(F)))
        return in_algebra(apart / (2 * rest[-1]), *rest)

    return System(
        group, system.lagrangian, additional=system.additional, advected=system.advected,
        parameters=system.parameters, forces=system.forces, internal=system.internal, constraints=_constraints(system),
        discrete_lagrangian=in_algebra, group_lagrangian=on_group,
    )  # fmt: skip


def with_hamiltonian(system: System) -> System:
    """The system by ℋ(p) = ⟨p, z⟩ − ℓ(z) in the place of ℓ(z) = ½ z·Kz + b·z − U, z = (ξ, ν) = K⁻¹(p − b)."""
    dynamic, dim = system.additional.ambient(system.group) > 0, system.group.dim

    def hamiltonian(mu: Array, *rest):
        n, pi, *places = rest if dynamic else (None, mu[:0], *rest)

        def lagrangian(z: Array):
            moving = (n, z[dim:]) if dynamic else ()
            return system.lagrangian(z[:dim], *moving, *places)  # type: ignore[misc]

        p = jnp.concatenate([mu, pi])
        rest_momenta, inertia = jax.grad(lagrangian)(jnp.zeros_like(p)), jax.hessian(lagrangian)(jnp.zeros_like(p))
        z = jnp.linalg.solve(inertia, p - rest_momenta)
        return p @ z - lagrangian(z)

    return System(
        system.group, hamiltonian=hamiltonian, additional=system.additional, advected=system.advected,
        parameters=system.parameters, forces=system.forces, internal=system.internal, constraints=_constraints(system),
    )  # fmt: skip


@dataclass(frozen=True)
class Shipped:
    """A method under a name, made over a difference map; `adapt` gives a system what the method needs.

    first_order: for Lagrangians that are linear in the velocities.
    """

    name: str
    make: Callable[[DifferenceMap], Method]
    adapt: Callable[[System], System] = as_it_is
    first_order: bool = False


MAPS: dict[str, DifferenceMap] = {
    "Cayley": Cayley(),
    "Exponential": Exponential(),
    "Squared(Cayley)": Squared(Cayley()),
    "Pade(2)": Pade(2),
    "SecondKind": SecondKind(),
}

FOR_EVERY_METHOD = ("Cayley", "Exponential", "Squared(Cayley)")
"""The other maps are audited on the systems `QUICK`, with methods up to order 2, of which the others are made."""

FIVE = (0.25, 0.375, -0.25, 0.375, 0.25)
"""Coefficients of a user's own, of no higher order than the base."""

SHIPPED: tuple[Shipped, ...] = (
    Shipped("LeftRectangle", LeftRectangle),
    Shipped("RightRectangle", RightRectangle),
    Shipped("Variational", Variational, with_left_rectangle),
    Shipped("AdjointVariational", AdjointVariational, with_left_rectangle),
    Shipped("Symmetrised(Variational)", lambda tau: Symmetrised(Variational(tau)), with_left_rectangle),
    Shipped("GroupVariational", GroupVariational, with_left_rectangle),
    Shipped("Midpoint", Midpoint),
    Shipped("HamiltonianMidpoint", HamiltonianMidpoint, with_hamiltonian),
    Shipped("IsospectralMidpoint", lambda tau: IsospectralMidpoint(tau, carry_g=True), with_hamiltonian),
    Shipped("Trapezoidal", Trapezoidal),
    Shipped("Simpson", Simpson),
    Shipped("LeftRight", LeftRight),
    Shipped("Suzuki4(Midpoint)", lambda tau: Suzuki4(Midpoint(tau))),
    Shipped("Suzuki4(Trapezoidal)", lambda tau: Suzuki4(Trapezoidal(tau))),
    Shipped("Suzuki4(LeftRight)", lambda tau: Suzuki4(LeftRight(tau))),
    Shipped("Galerkin(degree=2)", lambda tau: Galerkin(tau, degree=2)),
    Shipped("Galerkin(degree=3)", lambda tau: Galerkin(tau, degree=3)),
    Shipped("Galerkin(degree=4)", lambda tau: Galerkin(tau, degree=4)),
    Shipped("Yoshida4(Midpoint)", lambda tau: Yoshida4(Midpoint(tau))),
    Shipped("KahanLi6(Midpoint)", lambda tau: KahanLi6(Midpoint(tau))),
    Shipped("KahanLi6(LeftRight)", lambda tau: KahanLi6(LeftRight(tau))),
    Shipped("SofroniouSpaletta6(Midpoint)", lambda tau: SofroniouSpaletta6(Midpoint(tau))),
    Shipped("KahanLi8(Midpoint)", lambda tau: KahanLi8(Midpoint(tau))),
    Shipped("KahanLi8(LeftRight)", lambda tau: KahanLi8(LeftRight(tau))),
    Shipped("SofroniouSpaletta8(Midpoint)", lambda tau: SofroniouSpaletta8(Midpoint(tau))),
    Shipped("SofroniouSpaletta10(Midpoint)", lambda tau: SofroniouSpaletta10(Midpoint(tau))),
    Shipped("Composition(Trapezoidal)", lambda tau: Composition(Trapezoidal(tau), FIVE)),
    Shipped("VariableStep(Simpson)", lambda tau: VariableStep(Simpson(tau))),
    Shipped("EnergyMomentum", EnergyMomentum),
    Shipped("EnergyMomentum(points=4)", lambda tau: EnergyMomentum(tau, points=4)),
    Shipped("ProjectedMidpoint", ProjectedMidpoint, first_order=True),
    Shipped("Suzuki4(ProjectedMidpoint)", lambda tau: Suzuki4(ProjectedMidpoint(tau)), first_order=True),
    Shipped("MuntheKaas", MuntheKaas),
    Shipped("CommutatorFree", CommutatorFree),
    Shipped("CrouchGrossman", CrouchGrossman),
)
"""A method that is not here is not audited: a test holds this list complete."""


def audited(shipped: Shipped, tau: str, problem: AuditSystem) -> bool:
    """Whether a method over a map on a system is audited.

    Left out are systems of first order with methods for others, and the other way round, maps that are not
    `FOR_EVERY_METHOD` with methods over order 2 and on systems that are not `QUICK`, Galerkin's of order 8 on SE(3) and
    on a curved Q, and all of Galerkin's on SE(3) over the exponential: such a step is too large for native code, and
    XLA takes minutes for it. Orders with an internal state and constrained systems are audited over the Cayley map.
    """
    if shipped.first_order != problem.first_order:
        return False
    if (problem.internal or problem.constrained) and tau in MAPS and tau != "Cayley":
        return False
    method = shipped.make(MAPS.get(tau, Cayley()))
    if tau in MAPS and tau not in FOR_EVERY_METHOD and (problem.name not in QUICK or method.claims.order > 2):
        return False
    if not isinstance(method, Galerkin):
        return True
    on_se3 = isinstance(problem.system.group, SE3)
    large = method.degree == 4 and (on_se3 or not problem.system.additional.flat)
    return not (large or (on_se3 and tau == "Exponential"))
