"""The classical groups SO(n), Sp(2n, ℝ), GL(n) and SL(n)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.errors import GroupError, must_give
from coadjoint.groups.matrix_elements import (
    MatrixCoordinates,
    MatrixElements,
    require_room,
    singular,
    unit,
)
from coadjoint.groups.matrix_functions import logarithm


class _Quadratic(MatrixElements):
    """{g: gᵀPg = P} for an orthogonal P with Pᵀ = ±P."""

    @property
    def form(self) -> np.ndarray:
        """P (N, N)."""
        must_give(self, "form")

    def inverse(self, g: Array) -> Array:
        return self.form.T @ g.T @ self.form

    def _mismatch(self, g: Array) -> Array:
        return g.T @ self.form @ g - self.form

    def defect(self, g: Array) -> Array:
        return jnp.max(jnp.abs(self._mismatch(g)))

    def project(self, g: Array) -> Array:
        """One Newton step g(1 − ½P⁻¹(gᵀPg − P)): removes round-off quadratically."""
        return g - 0.5 * g @ (self.form.T @ self._mismatch(g))


@dataclass(frozen=True)
class SOn(MatrixCoordinates, _Quadratic):
    """The rotations of ℝⁿ, n = `size`; an element is R (n, n); the basis E_ji − E_ij, i < j, turns e_i to e_j.

    size: n ≥ 2, an integer. Raises GroupError for other values.
    """

    size: int

    def __post_init__(self):
        checks.whole(self.size, "Argument `size` of SOn", 2, error=GroupError)

    @property
    def leaf_names(self) -> tuple[str, ...]:
        return ("R",)

    @property
    def dim(self) -> int:
        return self.size * (self.size - 1) // 2

    @property
    def matrix_size(self) -> int:
        return self.size

    def _matrices(self) -> np.ndarray:
        pairs = combinations(range(self.size), 2)
        return np.stack([unit(self.size, j, i) - unit(self.size, i, j) for i, j in pairs])

    def _hat(self, xi: Array) -> Array:
        places, signs = _places(self.size)
        return jnp.asarray(xi)[places] * signs

    def _vee(self, matrix: Array) -> Array:
        return (0.5 * (matrix - matrix.T))[_below(self.size)]

    def _Ad(self, g: Array, xi: Array) -> Array:
        return self._vee(g @ self._hat(xi) @ g.T)

    def _Ad_dual(self, g: Array, mu: Array) -> Array:
        return self._vee(g.T @ self._hat(mu) @ g)

    def _ad(self, xi: Array, eta: Array) -> Array:
        """(ξ̂η̂ − η̂ξ̂)ᵛ, where η̂ξ̂ = (ξ̂η̂)ᵀ."""
        return 2 * self._vee(self._hat(xi) @ self._hat(eta))

    def _ad_dual(self, xi: Array, mu: Array) -> Array:
        """−ad_ξ μ: the basis is orthogonal, and its matrices are of one length."""
        return self._ad(mu, xi)

    @property
    def form(self) -> np.ndarray:
        return np.eye(self.size)

    def _log(self, g: Array) -> Array:
        return self.vee(logarithm(g, orthogonal=True))

    def outside(self, g: Array) -> Array:
        return jnp.maximum(self.defect(g), jnp.abs(jnp.linalg.det(g) - 1))


@dataclass(frozen=True)
class Sp(_Quadratic):
    """Linear symplectic maps of ℝ²ⁿ, n = `size`; an element is g (2n, 2n) with gᵀJg = J, J = [[0, 1], [−1, 0]].

    The basis is [[A, 0], [0, −Aᵀ]], then [[0, B], [0, 0]] and [[0, 0], [B, 0]] with B symmetric, each by rows.

    size: n ≥ 1, an integer. Raises GroupError for other values.
    """

    size: int

    def __post_init__(self):
        checks.whole(self.size, "Argument `size` of Sp", 1, error=GroupError)

    @property
    def form(self) -> np.ndarray:
        return np.kron([[0.0, 1.0], [-1.0, 0.0]], np.eye(self.size))

    @property
    def basis(self) -> np.ndarray:
        n = self.size
        every = [(i, j) for i in range(n) for j in range(n)]
        matrices = [unit(2 * n, i, j) - unit(2 * n, n + j, n + i) for i, j in every]
        for row, column in ((0, n), (n, 0)):
            for i, j in every:
                if i <= j:
                    both = unit(2 * n, row + i, column + j) + unit(2 * n, row + j, column + i)
                    matrices.append(np.minimum(both, 1.0))
        return np.stack(matrices)


@dataclass(frozen=True)
class GLn(MatrixElements):
    """Linear maps of ℝⁿ that have inverses, n = `size`; an element is g (n, n); the basis is E_ij by rows.

    No basis is formed: ξ̂ is ξ by rows.

    size: n ≥ 1, an integer. Raises GroupError for other values.
    """

    size: int

    def __post_init__(self):
        checks.whole(self.size, "Argument `size` of GLn", 1, error=GroupError)

    @property
    def dim(self) -> int:
        return self.size**2

    @property
    def matrix_size(self) -> int:
        return self.size

    @property
    def basis(self) -> np.ndarray:
        require_room(self)
        return np.eye(self.dim).reshape(self.dim, self.size, self.size)

    def basis_sizes(self) -> np.ndarray:
        return np.ones(self.dim)

    def hat(self, xi: Array) -> Array:
        return jnp.reshape(xi, (self.size, self.size))

    def vee(self, matrix: Array) -> Array:
        return jnp.reshape(matrix, -1)

    def Ad_dual(self, g: Array, mu: Array) -> Array:
        """gᵀ M g⁻ᵀ of the matrix M of μ."""
        return self.vee(g.T @ self.hat(mu) @ self.inverse(g).T)

    def ad(self, xi: Array, eta: Array) -> Array:
        X, Y = self.hat(xi), self.hat(eta)
        return self.vee(X @ Y - Y @ X)

    def ad_dual(self, xi: Array, mu: Array) -> Array:
        """ξ̂ᵀM − Mξ̂ᵀ of the matrix M of μ."""
        X, M = self.hat(xi).T, self.hat(mu)
        return self.vee(X @ M - M @ X)

    def defect(self, g: Array) -> Array:
        return jnp.zeros(())

    def project(self, g: Array) -> Array:
        return g

    def outside(self, g: Array) -> Array:
        """Infinite where g has no inverse, else 0."""
        return jnp.where(singular(g), jnp.inf, 0.0)


@dataclass(frozen=True)
class SLn(MatrixCoordinates, MatrixElements):
    """Linear maps of ℝⁿ that keep volume, n = `size`; an element is g (n, n) with det g = 1.

    The basis is E_ii − E_nn, i < n, and E_ij, i ≠ j, by rows. The Cayley transform fits n = 2 only.

    size: n ≥ 2, an integer. Raises GroupError for other values.
    """

    size: int

    def __post_init__(self):
        checks.whole(self.size, "Argument `size` of SLn", 2, error=GroupError)

    @property
    def dim(self) -> int:
        return self.size**2 - 1

    @property
    def matrix_size(self) -> int:
        return self.size

    def _matrices(self) -> np.ndarray:
        n = self.size
        rows = [unit(n, i, j) - (i == j) * unit(n, n - 1, n - 1) for i in range(n) for j in range(n)]
        return np.stack(rows[:-1])

    def _hat(self, xi: Array) -> Array:
        return jnp.concatenate([xi, -jnp.sum(xi[:: self.size + 1])[None]]).reshape(self.size, self.size)

    def _vee(self, matrix: Array) -> Array:
        return (matrix - jnp.trace(matrix) / self.size * np.eye(self.size)).reshape(-1)[:-1]

    def _covector(self, mu: Array) -> Array:
        """A matrix M with ⟨μ, ξ⟩ = tr(Mᵀξ̂); others differ by a multiple of 1."""
        return jnp.concatenate([mu, jnp.zeros(1)]).reshape(self.size, self.size)

    def _of_covector(self, matrix: Array) -> Array:
        """μ of M: ⟨M, e_k⟩ for every matrix of the basis."""
        return (matrix - matrix[-1, -1] * np.eye(self.size)).reshape(-1)[:-1]

    def _Ad(self, g: Array, xi: Array) -> Array:
        return self._vee(g @ self._hat(xi) @ self.inverse(g))

    def _Ad_dual(self, g: Array, mu: Array) -> Array:
        return self._of_covector(g.T @ self._covector(mu) @ self.inverse(g).T)

    def _ad(self, xi: Array, eta: Array) -> Array:
        X, Y = self._hat(xi), self._hat(eta)
        return self._vee(X @ Y - Y @ X)

    def _ad_dual(self, xi: Array, mu: Array) -> Array:
        X, M = self._hat(xi).T, self._covector(mu)
        return self._of_covector(X @ M - M @ X)

    def defect(self, g: Array) -> Array:
        return jnp.abs(jnp.linalg.det(g) - 1)

    def project(self, g: Array) -> Array:
        """g(1 − (det g − 1)/n): removes round-off quadratically."""
        return g * (1 - (jnp.linalg.det(g) - 1) / self.size)


def _places(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Where the entries of ξ̂ stand in ξ, (n, n), and their signs, 0 on the diagonal."""
    found, (rows, columns) = np.zeros((size, size), int), _below(size)
    found[rows, columns] = found[columns, rows] = np.arange(len(rows))
    return found, np.tri(size, k=-1) - np.tri(size, k=-1).T


def _below(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns (j, i), i < j, in the order of the pairs (i, j)."""
    i, j = np.triu_indices(size, 1)
    return j, i
