"""Every method that is shipped, as instances to audit, and the difference maps that they are audited with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from coadjoint.difference_maps import Cayley, DifferenceMap, Exponential, Squared
from coadjoint.groups.group import Array
from coadjoint.mechanics.system import System
from coadjoint.methods import (
    EnergyMomentum,
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
    """The system with Λ = hℓ(ξ, n, (s − n)/h, a) beside ℓ."""

    def discrete(xi: Array, *rest):
        *rest, h = rest
        if system.additional.ambient(system.group):
            n, s, *rest = rest
            rest = [n, (s - n) / h, *rest]
        return h * system.lagrangian(xi, *rest)  # type: ignore[misc]

    return System(
        system.group, system.lagrangian, additional=system.additional, advected=system.advected,
        parameters=system.parameters, forces=system.forces, discrete_lagrangian=discrete,
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
    Shipped("Midpoint", Midpoint),
    Shipped("Trapezoidal", Trapezoidal),
    Shipped("Simpson", Simpson),
    Shipped("LeftRight", LeftRight),
    Shipped("Suzuki4(Midpoint)", lambda tau: Suzuki4(Midpoint(tau))),
    Shipped("Suzuki4(Trapezoidal)", lambda tau: Suzuki4(Trapezoidal(tau))),
    Shipped("Suzuki4(LeftRight)", lambda tau: Suzuki4(LeftRight(tau))),
    Shipped("EnergyMomentum", EnergyMomentum),
    Shipped("EnergyMomentum(points=4)", lambda tau: EnergyMomentum(tau, points=4)),
)
"""A method that is not here is not audited: a test holds this list complete."""
