"""Groups whose elements are matrices, and those among them whose coordinates are entries of the matrix."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.errors import GroupError, must_give
from coadjoint.groups.group import Element, LieGroup


class MatrixElements(LieGroup):
    """A group whose elements are matrices (N, N) under multiplication; subclasses add `basis` and faster operations."""

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

    The determinant does not show it: that of 0.01·I of 200 rows is 0 in float64.
    """
    values = jnp.linalg.svd(matrix, compute_uv=False)
    return ~(values[-1] > len(values) * np.finfo(float).eps * values[0])


DENSE = 60
"""The largest dimension for which ad and hat use the basis: such systems run as native code, which this form suits."""
LARGEST_BASIS = 2**31
"""The largest size of a basis, in bytes."""


class MatrixCoordinates(LieGroup):
    """A group of which `hat`, `vee`, Ad, ad and their duals are written with matrices, without a basis.

    Up to DENSE dimensions they are nevertheless those of the basis. A subclass gives `dim`, `matrix_size`, `_matrices`,
    the basis, and the closed forms `_hat`, `_vee`, `_Ad`, `_Ad_dual`, `_ad` and `_ad_dual`.
    """

    @property
    def dense(self) -> bool:
        """Whether the group is small enough for a basis."""
        return self.dim <= DENSE

    @property
    def basis(self) -> np.ndarray:
        """The basis, (dim, N, N), built when asked for; raises GroupError where it takes more than 2 GiB."""
        require_room(self)
        return self._matrices()

    def basis_sizes(self) -> np.ndarray:
        return np.ones(self.dim)

    def _matrices(self) -> np.ndarray:
        must_give(self, "_matrices")

    def _hat(self, xi: Array) -> Array:
        must_give(self, "_hat")

    def _vee(self, matrix: Array) -> Array:
        must_give(self, "_vee")

    def _Ad(self, g: Element, xi: Array) -> Array:
        must_give(self, "_Ad")

    def _Ad_dual(self, g: Element, mu: Array) -> Array:
        must_give(self, "_Ad_dual")

    def _ad(self, xi: Array, eta: Array) -> Array:
        must_give(self, "_ad")

    def _ad_dual(self, xi: Array, mu: Array) -> Array:
        must_give(self, "_ad_dual")

    def hat(self, xi: Array) -> Array:
        return super().hat(xi) if self.dense else self._hat(xi)

    def vee(self, matrix: Array) -> Array:
        return super().vee(matrix) if self.dense else self._vee(matrix)

    def Ad(self, g: Element, xi: Array) -> Array:
        return super().Ad(g, xi) if self.dense else self._Ad(g, xi)

    def Ad_dual(self, g: Element, mu: Array) -> Array:
        return super().Ad_dual(g, mu) if self.dense else self._Ad_dual(g, mu)

    def ad(self, xi: Array, eta: Array) -> Array:
        return super().ad(xi, eta) if self.dense else self._ad(xi, eta)

    def ad_dual(self, xi: Array, mu: Array) -> Array:
        return super().ad_dual(xi, mu) if self.dense else self._ad_dual(xi, mu)


def require_room(group: LieGroup) -> None:
    """Raise GroupError where the basis of a group would take more than 2 GiB."""
    size = 8 * group.dim * group.matrix_size**2
    if size > LARGEST_BASIS:
        raise GroupError(
            f"The basis of {group!r} would take {size / 1e9:.3g} GB of memory: use `hat` and `vee` of the group, which "
            "need none, and co.IsospectralMidpoint() or, where it fits, co.Cayley() as difference map."
        )


def unit(size: int, i: int, j: int) -> np.ndarray:
    """The matrix (size, size) with one entry 1, at (i, j)."""
    found = np.zeros((size, size))
    found[i, j] = 1.0
    return found


def diagonal(matrix: Array) -> Array:
    """The diagonal of a matrix (N, N), by a slice, which transposes to a slice."""
    return matrix.reshape(-1)[:: matrix.shape[0] + 1]
