"""What all groups share whose elements are their own matrices."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

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


def singular(matrix: Array) -> Array:
    """Whether a matrix (N, N) has no inverse to round-off: its least singular value is below Nε of the largest.

    The determinant does not say: that of 0.01·I of 200 rows is 0 in float64.
    """
    values = jnp.linalg.svd(matrix, compute_uv=False)
    return ~(values[-1] > len(values) * np.finfo(float).eps * values[0])
