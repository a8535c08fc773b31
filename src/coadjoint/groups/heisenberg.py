"""The Heisenberg groups."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.errors import GroupError
from coadjoint.groups.group import LieGroup


@dataclass(frozen=True)
class Heisenberg(LieGroup):
    """H_n, n = `size`: an element is a vector (x, y, z) of ℝⁿ × ℝⁿ × ℝ, as a matrix [[1, xᵀ, z], [0, 1, y], [0, 0, 1]].

    (x, y, z)(x′, y′, z′) = (x + x′, y + y′, z + z′ + x·y′); [(x, y, z), (x′, y′, z′)] = (0, 0, x·y′ − x′·y).

    size: n ≥ 1, an integer, by default 1. Raises GroupError for other values.
    """

    size: int = 1

    def __post_init__(self):
        object.__setattr__(self, "size", checks.whole(self.size, "Argument `size` of Heisenberg", 1, error=GroupError))

    @property
    def basis(self) -> np.ndarray:
        n = self.size
        basis = np.zeros((2 * n + 1, n + 2, n + 2))
        basis[np.arange(n), 0, 1 + np.arange(n)] = 1.0
        basis[n + np.arange(n), 1 + np.arange(n), -1] = 1.0
        basis[-1, 0, -1] = 1.0
        return basis

    def _area(self, g: Array, h: Array) -> Array:
        """(0, 0, x·y′)."""
        n = self.size
        return jnp.concatenate([jnp.zeros(2 * n), (g[:n] @ h[n:-1])[None]])

    def identity(self) -> Array:
        return jnp.zeros(self.dim)

    def compose(self, g: Array, h: Array) -> Array:
        return g + h + self._area(g, h)

    def inverse(self, g: Array) -> Array:
        return self._area(g, g) - g

    def matrix(self, g: Array) -> Array:
        return jnp.eye(self.matrix_size) + self.hat(g)

    def from_matrix(self, matrix: Array) -> Array:
        return self.vee(matrix)

    def tangent(self, xi: Array) -> Array:
        return xi

    def vee(self, matrix: Array) -> Array:
        return jnp.concatenate([matrix[0, 1:-1], matrix[1:-1, -1], matrix[0, -1:]])

    def Ad(self, g: Array, xi: Array) -> Array:
        return xi + self.ad(g, xi)

    def ad(self, xi: Array, eta: Array) -> Array:
        return self._area(xi, eta) - self._area(eta, xi)

    def Ad_dual(self, g: Array, mu: Array) -> Array:
        return mu + self.ad_dual(g, mu)

    def ad_dual(self, xi: Array, mu: Array) -> Array:
        n = self.size
        return mu[-1] * jnp.concatenate([-xi[n:-1], xi[:n], jnp.zeros(1)])

    def exp(self, xi: Array) -> Array:
        return xi + 0.5 * self._area(xi, xi)

    def _log(self, g: Array) -> Array:
        return g - 0.5 * self._area(g, g)

    def angle_squared(self, xi: Array) -> Array:
        return jnp.zeros(())

    def project(self, g: Array) -> Array:
        return g

    def defect(self, g: Array) -> Array:
        return jnp.zeros(())
