"""Every method that is shipped, as instances to audit, and the difference maps that they are audited with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from coadjoint.difference_maps import Cayley, DifferenceMap, Exponential, Squared
from coadjoint.groups.group import Array, Element
from coadjoint.mechanics.system import System
from coadjoint.methods import (
    EnergyMomentum,
    Galerkin,
    GroupVariational,
    LeftRectangle,
    LeftRight,
    Method,
    Midpoint,
    RightRectangle,
    Simpson,
    Suzuki4,
    Trapezoidal,
    Variational,
)


def as_it_is(system: System) -> System:
    return system


def with_left_rectangle(system: System) -> System:
    """The system with Λ = hℓ(ξ, n, (s − n)/h, a) beside ℓ; in group form with ξ = (F − F⁻¹)ᵛ/2h."""
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
        parameters=system.parameters, forces=system.forces, discrete_lagrangian=in_algebra, group_lagrangian=on_group,
    )  # fmt: skip


@dataclass(frozen=True)
class Shipped:
    """A method under a name, made over a difference map; `adapt` gives a system what the method needs."""

    name: str
    make: Callable[[DifferenceMap], Method]
    adapt: Callable[[System], System] = as_it_is


MAPS: dict[str, DifferenceMap] = {
    "Cayley": Cayley(),
    "Exponential": Exponential(),
    "Squared(Cayley)": Squared(Cayley()),
}

SHIPPED: tuple[Shipped, ...] = (
    Shipped("LeftRectangle", LeftRectangle),
    Shipped("RightRectangle", RightRectangle),
    Shipped("Variational", Variational, with_left_rectangle),
    Shipped("GroupVariational", GroupVariational, with_left_rectangle),
    Shipped("Midpoint", Midpoint),
    Shipped("Trapezoidal", Trapezoidal),
    Shipped("Simpson", Simpson),
    Shipped("LeftRight", LeftRight),
    Shipped("Suzuki4(Midpoint)", lambda tau: Suzuki4(Midpoint(tau))),
    Shipped("Suzuki4(Trapezoidal)", lambda tau: Suzuki4(Trapezoidal(tau))),
    Shipped("Suzuki4(LeftRight)", lambda tau: Suzuki4(LeftRight(tau))),
    Shipped("Galerkin(degree=2)", lambda tau: Galerkin(tau, degree=2)),
    Shipped("Galerkin(degree=3)", lambda tau: Galerkin(tau, degree=3)),
    Shipped("Galerkin(degree=4)", lambda tau: Galerkin(tau, degree=4)),
    Shipped("EnergyMomentum", EnergyMomentum),
    Shipped("EnergyMomentum(points=4)", lambda tau: EnergyMomentum(tau, points=4)),
)
"""A method that is not here is not audited: a test holds this list complete."""
