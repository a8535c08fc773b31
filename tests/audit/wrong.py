"""Methods and a map that claim what they do not keep."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp

import coadjoint as co
from coadjoint.audit.shipped import Shipped
from coadjoint.groups import LieGroup


@dataclass(frozen=True)
class SaidToBeSymmetric(co.Variational):
    """A discrete Lagrangian that claims to be symmetric of order 2, and is not asked whether it is."""

    symmetric: bool = True

    def remember(self, system, state):
        return state


def with_midpoint(system: co.System) -> co.System:
    """The system with Λ of the midpoint rule on H = cay(hξ/2)."""
    group, V = system.group, system.advected

    def midpoint(xi, a, p, h):
        back = group.inverse(co.Cayley().tau(group, 0.5 * h * xi))
        return h * system.reduced_lagrangian(xi, jnp.zeros(0), jnp.zeros(0), V.act(group, back, a))

    return co.System(group, system.lagrangian, advected=V, parameters=system.parameters, discrete_lagrangian=midpoint)


FALSE_HALF = Shipped("Suzuki4 of a false half", lambda tau: co.Suzuki4(SaidToBeSymmetric(tau)), with_midpoint)
"""Over F = cay(hξ), whose half is not cay(hξ/2): order 3. Over the squared map F = cay(hξ/2)² it is true: order 4."""


@dataclass(frozen=True)
class Losing(co.Midpoint):
    """The midpoint rule with μ shrunk by h³/200: of order 2 still, but nothing is kept."""

    def advance(self, system, record, h):
        after = super().advance(system, record, h)
        return after.replace(mu=(1 - h**3 / 200) * after.mu)


@dataclass(frozen=True)
class AsPrinted(co.LeftRectangle):
    """The left rectangle with μ_{k+1} = (dτ⁻¹_{−hξ})*∂_ξℓ, the right transform itself, instead of its transport."""

    def advance(self, system, record, h):
        mu = self.difference_map.dtau_inverse_dual(system.group, -h * record.xi, self._node(system, record, h)[1].mu)
        return super().advance(system, record, h).replace(mu=mu)


@dataclass(frozen=True)
class Truncated(co.Exponential):
    """The exponential of SO(3) with the series (dτ⁻¹_ξ)*μ ≈ μ + ½ξ×μ + ξ×(ξ×μ)/12, right up to |ξ|⁴/720."""

    def _dtau_inverse_dual(self, group: LieGroup, xi, mu):
        turned = jnp.cross(xi, mu)
        return mu + 0.5 * turned + jnp.cross(xi, turned) / 12


def unverified(system: co.System) -> co.System:
    """The system without the comparison of maps with their derivation, which would refuse `Truncated`."""
    return co.System(
        system.group, system.lagrangian, advected=system.advected, parameters=system.parameters, verify=False
    )
