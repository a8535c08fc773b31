"""What all groups share whose elements are their own matrices."""

from __future__ import annotations

import jax.numpy as jnp

from coadjoint.groups.group import Array, LieGroup


class MatrixElements(LieGroup):
    """A group whose elements are matrices (N, N) under multiplication; `basis` and what it can do better remain."""

    def identity(self) -> Array:
        return jnp.eye(self.matrix_size)

    def compose(self, g: Array, h: Array) -> Array:
        return g @ h

    def inverse(self, g: Array) -> Array:
        return jnp.linalg.inv(g)

    def matrix(self, g: Array) -> Array:
        return g

    def from_matrix(self, matrix: Array) -> Array:
        return matrix

    def tangent(self, xi: Array) -> Array:
        return self.hat(xi)
