"""The classical groups SO(n), Sp(2n, ℝ) and SL(n)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import jax.numpy as jnp
import numpy as np

from coadjoint.errors import GroupError, shown
from coadjoint.groups.group import Array
from coadjoint.groups.matrix_elements import MatrixElements


def _require_size(group: str, size: object, least: int) -> None:
    if not isinstance(size, int) or isinstance(size, bool) or size < least:
        raise GroupError(f"Argument `size` of {group} must be a whole number from {least}, but is {shown(size)}.")


def _unit(size: int, i: int, j: int) -> np.ndarray:
    """The matrix with one entry 1, at (i, j)."""
    unit = np.zeros((size, size))
    unit[i, j] = 1.0
    return unit


class _Quadratic(MatrixElements):
    """{g: gᵀPg = P} for an orthogonal P with Pᵀ = ±P."""

    @property
    def form(self) -> np.ndarray:
        """P (N, N)."""
        raise NotImplementedError

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
class SOn(_Quadratic):
    """Rotations of ℝⁿ, n = `size`; an element is R (n, n); the basis E_ji − E_ij, i < j, turns e_i to e_j.

    size: n, a whole number from 2. Raises GroupError for another one.
    """

    size: int

    def __post_init__(self):
        _require_size("SOn", self.size, 2)

    @property
    def leaf_names(self) -> tuple[str, ...]:
        return ("R",)

    @property
    def basis(self) -> np.ndarray:
        pairs = combinations(range(self.size), 2)
        return np.stack([_unit(self.size, j, i) - _unit(self.size, i, j) for i, j in pairs])

    @property
    def form(self) -> np.ndarray:
        return np.eye(self.size)

    def outside(self, g: Array) -> Array:
        return jnp.maximum(self.defect(g), jnp.abs(jnp.linalg.det(g) - 1))


@dataclass(frozen=True)
class Sp(_Quadratic):
    """Linear symplectic maps of ℝ²ⁿ, n = `size`; an element is g (2n, 2n) with gᵀJg = J, J = [[0, 1], [−1, 0]].

    The basis is [[A, 0], [0, −Aᵀ]], then [[0, B], [0, 0]] and [[0, 0], [B, 0]] with B symmetric, each by rows.

    size: n, a whole number from 1. Raises GroupError for another one.
    """

    size: int

    def __post_init__(self):
        _require_size("Sp", self.size, 1)

    @property
    def form(self) -> np.ndarray:
        return np.kron([[0.0, 1.0], [-1.0, 0.0]], np.eye(self.size))

    @property
    def basis(self) -> np.ndarray:
        n = self.size
        every = [(i, j) for i in range(n) for j in range(n)]
        matrices = [_unit(2 * n, i, j) - _unit(2 * n, n + j, n + i) for i, j in every]
        for row, column in ((0, n), (n, 0)):
            for i, j in every:
                if i <= j:
                    both = _unit(2 * n, row + i, column + j) + _unit(2 * n, row + j, column + i)
                    matrices.append(np.minimum(both, 1.0))
        return np.stack(matrices)


@dataclass(frozen=True)
class SLn(MatrixElements):
    """Linear maps of ℝⁿ that keep volume, n = `size`; an element is g (n, n) with det g = 1.

    The basis is E_ii − E_nn, i < n, and E_ij, i ≠ j, by rows. The Cayley transform fits n = 2 only.

    size: n, a whole number from 2. Raises GroupError for another one.
    """

    size: int

    def __post_init__(self):
        _require_size("SLn", self.size, 2)

    @property
    def basis(self) -> np.ndarray:
        n = self.size
        rows = [_unit(n, i, j) - (i == j) * _unit(n, n - 1, n - 1) for i in range(n) for j in range(n)]
        return np.stack(rows[:-1])

    def defect(self, g: Array) -> Array:
        return jnp.abs(jnp.linalg.det(g) - 1)

    def project(self, g: Array) -> Array:
        """g(1 − (det g − 1)/n): removes round-off quadratically."""
        return g * (1 - (jnp.linalg.det(g) - 1) / self.size)
