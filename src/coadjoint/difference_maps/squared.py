"""The squared map, which has a true half on every group."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.difference_maps.difference_map import DifferenceMap
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element


@dataclass(frozen=True)
class Squared(DifferenceMap):
    """τ₂(ξ) = σ(ξ/2)² of a map σ, with half H = σ(ξ/2), which is a true half on every group.

    dτ₂_ξ = ½ (1 + Ad_H) dσ_{ξ/2}, (dτ₂⁻¹_ξ)* = 2 (1 + Ad*_H)⁻¹ (dσ⁻¹_{ξ/2})*.

    half: σ, such as co.Cayley(). The exponential is its own squared map. Squared Cayley on SO(3) is the Cayley
    transform of SU(2) and reaches π. Raises ArgumentError unless it is a DifferenceMap.
    """

    half: DifferenceMap

    def __post_init__(self):
        checks.instance(self.half, "The half of Squared", DifferenceMap, "a difference map such as co.Cayley()")

    def _tau(self, group: LieGroup, xi: Array) -> Element:
        root = self.half.tau(group, 0.5 * xi)
        return group.compose(root, root)

    def _inverse(self, group: LieGroup, g: Element) -> Array:
        """2σ⁻¹(√g) with √g = exp(½ log g)."""
        return 2 * self.half.inverse(group, group.exp(0.5 * group.log(g)))

    def _dtau(self, group: LieGroup, xi: Array, chi: Array) -> Array:
        moved = 0.5 * self.half.dtau(group, 0.5 * xi, chi)
        return moved + group.Ad(self.half.tau(group, 0.5 * xi), moved)

    def _dtau_inverse_dual(self, group: LieGroup, xi: Array, mu: Array) -> Array:
        root = self.half.tau(group, 0.5 * xi)
        doubled = jax.vmap(lambda nu: nu + group.Ad_dual(root, nu), out_axes=1)(jnp.eye(group.dim))
        return jnp.linalg.solve(doubled, 2 * self.half.dtau_inverse_dual(group, 0.5 * xi, mu))

    def chart(self, group: LieGroup, xi: Array) -> Array | float:
        return self.half.chart(group, 0.5 * xi)
