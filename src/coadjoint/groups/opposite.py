"""The opposite group, with products in the other order: on it right-invariant systems are left-invariant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from coadjoint.arrays import Array
from coadjoint.groups.group import Element, LieGroup, require_group
from coadjoint.groups.power import require_one_matrix


@dataclass(frozen=True)
class Opposite(LieGroup):
    """Gᵒᵖ: the elements, 𝔤 and exp of G with the product g·h = hg, so that Adᵒᵖ_g = Ad_{g⁻¹} and adᵒᵖ_ξ = −ad_ξ.

    Its left velocity g⁻¹·ġ is the right velocity ġg⁻¹ of G, and a right-invariant system on G is a left-invariant one
    on Gᵒᵖ; g ↦ g⁻¹ maps one group to the other. Its matrices are those of G, transposed.

    group: G. Raises GroupError unless it is a LieGroup.
    """

    group: LieGroup

    def __post_init__(self):
        require_group(self.group, "The group of Opposite")
        require_one_matrix(self.group, "Opposite")

    @property
    def basis(self) -> np.ndarray:
        return np.swapaxes(self.group.basis, 1, 2)

    def basis_sizes(self) -> np.ndarray:
        return self.group.basis_sizes()

    @property
    def dim(self) -> int:
        return self.group.dim

    @property
    def matrix_size(self) -> int:
        return self.group.matrix_size

    @property
    def leaf_names(self) -> tuple[str, ...]:
        return self.group.leaf_names

    def identity(self) -> Element:
        return self.group.identity()

    def compose(self, g: Element, h: Element) -> Element:
        return self.group.compose(h, g)

    def inverse(self, g: Element) -> Element:
        return self.group.inverse(g)

    def matrix(self, g: Element) -> Array:
        return self.group.matrix(g).T

    def from_matrix(self, matrix: Array) -> Element:
        return self.group.from_matrix(matrix.T)

    def tangent(self, xi: Array) -> Element:
        return self.group.tangent(xi)

    def hat(self, xi: Array) -> Array:
        return self.group.hat(xi).T

    def vee(self, matrix: Array) -> Array:
        return self.group.vee(matrix.T)

    def Ad(self, g: Element, xi: Array) -> Array:
        return self.group.Ad(self.group.inverse(g), xi)

    def Ad_dual(self, g: Element, mu: Array) -> Array:
        return self.group.Ad_dual(self.group.inverse(g), mu)

    def ad(self, xi: Array, eta: Array) -> Array:
        return -self.group.ad(xi, eta)

    def ad_dual(self, xi: Array, mu: Array) -> Array:
        return -self.group.ad_dual(xi, mu)

    def exp(self, xi: Array) -> Element:
        return self.group.exp(xi)

    def _log(self, g: Element) -> Array:
        return self.group.log(g)

    def angle_squared(self, xi: Array) -> Array | None:
        return self.group.angle_squared(xi)

    def rotation_angle(self, xi: Array) -> Array | float:
        return self.group.rotation_angle(xi)

    @property
    def constrained(self) -> bool:
        """Whether G knows its defining equations."""
        return self.group.constrained

    def project(self, g: Element) -> Element:
        return self.group.project(g)

    def defect(self, g: Element) -> Array:
        return self.group.defect(g)

    def outside(self, g: Element) -> Array:
        return self.group.outside(g)

    def rotation(self, g: Element) -> Array | None:
        return self.group.rotation(g)
