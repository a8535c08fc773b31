"""The additive group ℝⁿ."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.errors import GroupError
from coadjoint.groups.group import LieGroup


@dataclass(frozen=True)
class Translation(LieGroup):
    """ℝⁿ under addition; an element is a vector x (n,), as a matrix [[I, x], [0, 1]]; ad = 0.

    size: n ≥ 0, an integer. Translation(0) is the group {e}, for mechanics on Q alone: with no ξ and no μ the
    equations of every method are the discrete Euler–Lagrange equations of ℓ(ξ, n, ν) on the additional space.

    Raises GroupError for another size.
    """

    size: int

    @property
    def leaf_names(self) -> tuple[str, ...]:
        return ("x",)

    def __post_init__(self):
        object.__setattr__(self, "size", checks.whole(self.size, "Argument `size` of Translation", 0, error=GroupError))

    @property
    def basis(self) -> np.ndarray:
        basis = np.zeros((self.size, self.size + 1, self.size + 1))
        basis[np.arange(self.size), np.arange(self.size), self.size] = 1.0
        return basis

    def identity(self) -> Array:
        return jnp.zeros(self.size)

    def compose(self, g: Array, h: Array) -> Array:
        return g + h

    def inverse(self, g: Array) -> Array:
        return -g

    def matrix(self, g: Array) -> Array:
        return jnp.eye(self.size + 1).at[:-1, -1].set(g)

    def from_matrix(self, matrix: Array) -> Array:
        return matrix[:-1, -1]

    def tangent(self, xi: Array) -> Array:
        return xi

    def vee(self, matrix: Array) -> Array:
        return matrix[:-1, -1]

    def Ad(self, g: Array, xi: Array) -> Array:
        return xi

    def Ad_dual(self, g: Array, mu: Array) -> Array:
        return mu

    def ad(self, xi: Array, eta: Array) -> Array:
        return jnp.zeros_like(xi)

    def ad_dual(self, xi: Array, mu: Array) -> Array:
        return jnp.zeros_like(mu)

    def exp(self, xi: Array) -> Array:
        return xi

    def _log(self, g: Array) -> Array:
        return g

    def angle_squared(self, xi: Array) -> Array:
        return jnp.zeros(())

    def project(self, g: Array) -> Array:
        return g

    def defect(self, g: Array) -> Array:
        return jnp.zeros(())
