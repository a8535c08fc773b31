"""The unitary groups U(n) and SU(n), with real and imaginary parts apart."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import lax

from coadjoint import checks
from coadjoint.arrays import Array, Scalar
from coadjoint.errors import GroupError, must_give
from coadjoint.groups.complex_form import real_form
from coadjoint.groups.matrix_elements import MatrixCoordinates, diagonal
from coadjoint.groups.matrix_functions import logarithm

_HALF = 0.5**0.5
"""√½ as a Python float, which keeps single precision single."""


class ComplexMatrix(NamedTuple):
    """A complex matrix A + iB by its parts, (n, n) each: an element of U(n), and a matrix of its algebra."""

    real: Array
    imaginary: Array

    @property
    def adjoint(self) -> ComplexMatrix:
        """The conjugate transpose."""
        return ComplexMatrix(self.real.T, -self.imaginary.T)


def product(a: ComplexMatrix, b: ComplexMatrix) -> ComplexMatrix:
    """ab, by three products of real matrices."""
    first, second = a[0] @ b[0], a[1] @ b[1]
    both = (a[0] + a[1]) @ (b[0] + b[1])
    return ComplexMatrix(first - second, both - first - second)


def sum_of_parts(Z: ComplexMatrix, P: ComplexMatrix) -> Array:
    """A + B, (n, n), of ZP = A + iB, of Z and P (n, n) with P† = −P, by two products of real matrices.

    With P = R + iJ and S = R + J: A + B = Re Z (R + J) + Im Z (R − J) = Re Z S − Im Z Sᵀ, as Rᵀ = −R and Jᵀ = J.
    Where ZP is anti-Hermitian A is the skew part of the sum, and B its symmetric part.
    """
    S = P.real + P.imaginary
    return Z.real @ S - Z.imaginary @ S.T


class _Unitary(MatrixCoordinates):
    """{g: g†g = 1} and its subgroup with det g = 1, in a basis that is orthonormal for Re tr(X†Y)."""

    size: int

    @property
    def matrix_size(self) -> int:
        return 2 * self.size

    @property
    def leaf_names(self) -> tuple[str, ...]:
        return ("real", "imaginary")

    def basis_sizes(self) -> np.ndarray:
        sizes = np.full((self.size, self.size), np.sqrt(0.5))
        np.fill_diagonal(sizes, np.append(np.max(np.abs(self._diagonals()), axis=0), 1.0)[: self.size])
        return sizes.ravel()[: self.dim]

    def _diagonals(self) -> np.ndarray:
        """The diagonals of the matrices of the basis that are diagonal, over i, a column each."""
        must_give(self, "_diagonals")

    def _to_diagonal(self, rows: Array) -> Array:
        """The diagonal of B by that of coordinates by rows (n, n), of which another entry may be anything, (n, n)."""
        must_give(self, "_to_diagonal")

    def _from_diagonal(self, B: Array) -> Array:
        """The diagonal of coordinates by rows by that of B (n, n), of which another entry may be anything, (n, n)."""
        must_give(self, "_from_diagonal")

    def _matrices(self) -> np.ndarray:
        n, found = self.size, []
        diagonals = self._diagonals()
        for i in range(n):
            for j in range(n):
                matrix = np.zeros((n, n), complex)
                if i == j:
                    if i == diagonals.shape[1]:
                        continue
                    np.fill_diagonal(matrix, 1j * diagonals[:, i])
                else:
                    matrix[i, j], matrix[j, i] = (np.sqrt(0.5), -np.sqrt(0.5)) if i < j else (1j * np.sqrt(0.5),) * 2
                found.append(matrix)
        return np.asarray(real_form(np.stack(found))) if found else np.zeros((0, 2 * n, 2 * n))

    def parts(self, xi: Array) -> ComplexMatrix:
        """The matrix of coordinates ξ (dim,) by its parts, (n, n) each."""
        n, (over, under) = self.size, _triangles(self.size)
        rows = jnp.concatenate([xi, jnp.zeros(n * n - self.dim, xi.dtype)]).reshape(n, n)
        here, across = _HALF * rows, _HALF * rows.T
        A = jnp.where(over, here, jnp.where(under, -across, 0.0))
        return ComplexMatrix(A, jnp.where(under, here, jnp.where(over, across, self._to_diagonal(rows))))

    def coordinates(self, matrix: ComplexMatrix) -> Array:
        """The coordinates (dim,) of a matrix by its parts, of its orthogonal projection where it is outside 𝔤."""
        (A, B), (over, under) = matrix, _triangles(self.size)
        rows = _HALF * (jnp.where(over, A, B) + jnp.where(over, B, -A).T)
        return jnp.where(jnp.logical_or(over, under), rows, self._from_diagonal(B)).reshape(-1)[: self.dim]

    def identity(self) -> ComplexMatrix:
        return ComplexMatrix(jnp.eye(self.size), jnp.zeros((self.size, self.size)))

    def compose(self, g: ComplexMatrix, h: ComplexMatrix) -> ComplexMatrix:
        return product(ComplexMatrix(*g), ComplexMatrix(*h))

    def inverse(self, g: ComplexMatrix) -> ComplexMatrix:
        return ComplexMatrix(*g).adjoint

    def matrix(self, g: ComplexMatrix) -> Array:
        A, B = g
        return jnp.concatenate([jnp.concatenate([A, -B], axis=1), jnp.concatenate([B, A], axis=1)])

    def from_matrix(self, matrix: Array) -> ComplexMatrix:
        return ComplexMatrix(matrix[: self.size, : self.size], matrix[self.size :, : self.size])

    def tangent(self, xi: Array) -> ComplexMatrix:
        return self.from_matrix(self.hat(xi)) if self.dense else self.parts(xi)

    def _log(self, g: ComplexMatrix) -> Array:
        return self.vee(logarithm(self.matrix(g), orthogonal=True))

    def _hat(self, xi: Array) -> Array:
        return self.matrix(self.parts(xi))

    def _vee(self, matrix: Array) -> Array:
        n = self.size
        A, B = matrix[:n, :n] + matrix[n:, n:], matrix[n:, :n] - matrix[:n, n:]
        return self.coordinates(ComplexMatrix(0.5 * A, 0.5 * B))

    def _Ad(self, g: ComplexMatrix, xi: Array) -> Array:
        g = ComplexMatrix(*g)
        return self.coordinates(product(product(g, self.parts(xi)), g.adjoint))

    def _Ad_dual(self, g: ComplexMatrix, mu: Array) -> Array:
        """Ad_{g⁻¹}, because the basis is orthonormal for a form that Ad keeps."""
        return self._Ad(self.inverse(g), mu)

    def _ad(self, xi: Array, eta: Array) -> Array:
        """(ξ̂η̂ − η̂ξ̂)ᵛ, where η̂ξ̂ = (ξ̂η̂)†."""
        return 2 * self.coordinates(product(self.parts(xi), self.parts(eta)))

    def _ad_dual(self, xi: Array, mu: Array) -> Array:
        """−ad_ξ μ."""
        return self._ad(mu, xi)

    def _mismatch(self, g: ComplexMatrix) -> ComplexMatrix:
        """g†g − 1."""
        A, B = product(g.adjoint, g)
        return ComplexMatrix(A - np.eye(self.size), B)

    def defect(self, g: ComplexMatrix) -> Array:
        A, B = self._mismatch(ComplexMatrix(*g))
        return jnp.maximum(jnp.max(jnp.abs(A)), jnp.max(jnp.abs(B)))

    def project(self, g: ComplexMatrix) -> ComplexMatrix:
        """g − ½g(g†g − 1): removes round-off quadratically."""
        g = ComplexMatrix(*g)
        A, B = product(g, self._mismatch(g))
        return ComplexMatrix(g.real - 0.5 * A, g.imaginary - 0.5 * B)


@dataclass(frozen=True)
class Un(_Unitary):
    """The unitary group U(n), n = `size`; an element is (A, B) with A + iB unitary, (n, n) each.

    ξ by rows is a real matrix r (n, n): over the diagonal r_ij (E_ij − E_ji)/√2, on it r_ii iE_ii, below it
    r_ij i(E_ij + E_ji)/√2. This basis is orthonormal for Re tr(X†Y), so that μ as a matrix is that of its coordinates.
    `matrix`, `hat` and `vee` have the real form [[A, −B], [B, A]]; `parts` and `coordinates` have the parts.

    size: n ≥ 1, an integer. Raises GroupError for other values.
    """

    size: int

    def __post_init__(self):
        checks.whole(self.size, "Argument `size` of Un", 1, error=GroupError)

    @property
    def dim(self) -> int:
        return self.size**2

    def _diagonals(self) -> np.ndarray:
        return np.eye(self.size)

    def _to_diagonal(self, rows: Array) -> Array:
        return rows

    def _from_diagonal(self, B: Array) -> Array:
        return B


@dataclass(frozen=True)
class SUn(_Unitary):
    """The special unitary group SU(n), n = `size`; an element is (A, B) with A + iB unitary, det = 1, (n, n) each.

    The basis is that of `Un` without the last matrix, and with i diag(1, …, 1, −k, 0, …)/√(k(k + 1)) for the kth on the
    diagonal. The Cayley transform fits n = 2 only: take U(n), with an energy that does not depend on the trace.

    size: n ≥ 2, an integer. Raises GroupError for other values.
    """

    size: int

    def __post_init__(self):
        checks.whole(self.size, "Argument `size` of SUn", 2, error=GroupError)

    @property
    def dim(self) -> int:
        return self.size**2 - 1

    def _diagonals(self) -> np.ndarray:
        return _traceless(self.size)

    def _to_diagonal(self, rows: Array) -> Array:
        along = self._diagonals().astype(rows.dtype) @ diagonal(rows)[:-1]
        return jnp.broadcast_to(along, rows.shape)

    def _from_diagonal(self, B: Array) -> Array:
        along = self._diagonals().T.astype(B.dtype) @ diagonal(B)
        return jnp.broadcast_to(jnp.append(along, 0.0), B.shape)

    def _determinant(self, g: ComplexMatrix) -> tuple[Scalar, Scalar]:
        """Re and Im of det g."""
        if not self.dense:
            found = jnp.linalg.det(g.real + 1j * g.imaginary)
            return found.real, found.imag
        # By Faddeev and Le Verrier: sums and products alone, which native code takes.
        eye, power, c = np.eye(self.size), self.identity(), (1.0, 0.0)
        for k in range(1, self.size + 1):
            power = product(g, power)
            c = tuple(-jnp.trace(part) / k for part in power)
            power = ComplexMatrix(*(part + value * eye for part, value in zip(power, c, strict=True)))
        sign = (-1.0) ** self.size
        return sign * c[0], sign * c[1]

    def defect(self, g: ComplexMatrix) -> Array:
        real, imaginary = self._determinant(ComplexMatrix(*g))
        return jnp.maximum(super().defect(g), jnp.maximum(jnp.abs(real - 1), jnp.abs(imaginary)))

    def project(self, g: ComplexMatrix) -> ComplexMatrix:
        """That of U(n), then g(1 − i Im(det g)/n): removes round-off quadratically."""
        A, B = super().project(g)
        angle = self._determinant(ComplexMatrix(A, B))[1] / self.size
        return ComplexMatrix(A + angle * B, B - angle * A)


def _triangles(size: int) -> tuple[Array, Array]:
    """Which entries of a matrix (n, n) are over the diagonal, and which below it; reading them would take longer."""
    i, j = (lax.broadcasted_iota(int, (size, size), axis) for axis in (0, 1))
    return i < j, i > j


@lru_cache(maxsize=64)
def _traceless(size: int) -> np.ndarray:
    """(1, …, 1, −k, 0, …)/√(k(k + 1)) for k from 1 to size − 1, a column each."""
    k = np.arange(1, size)
    return (np.triu(np.ones((size, size - 1))) - np.eye(size, size - 1, -1) * k) / np.sqrt(k * (k + 1))
