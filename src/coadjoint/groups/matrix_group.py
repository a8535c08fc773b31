"""Any matrix Lie group, from a basis of its algebra."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.errors import GroupError, error_line, shown
from coadjoint.groups.algebra import require_algebra
from coadjoint.groups.complex_form import off_real_form, real_form
from coadjoint.groups.matrix_elements import MatrixElements, singular
from coadjoint.kernels.trace.evaluate import evaluate

_ROUND_OFF = 1e-14
"""An imaginary part up to this, relative to the largest entry of its matrix, is round-off."""


class MatrixGroup(MatrixElements):
    """The matrix Lie group whose algebra has the given basis; an element is a matrix (N, N).

        SL2 = MatrixGroup([[[1, 0], [0, -1]], [[0, 1], [0, 0]], [[0, 0], [1, 0]]],
                          constraint=lambda g: jnp.linalg.det(g) - 1)

    basis: matrices (dim, N, N), linearly independent and closed under the bracket. constraint: a function g ↦ array
    that vanishes on the group (SL: det g − 1), by default none; with it the group has `project` and `defect`. name: for
    cards and errors, by default "MatrixGroup". A basis of complex matrices spans a real algebra, as that of su(n) does:
    it is taken in its real form [[A, −B], [B, A]] for A + iB (`co.groups.real_form`, `co.groups.complex_form`), and
    elements and the argument of `constraint` are real matrices (2N, 2N). Raises GroupError for a basis that is
    dependent or not closed, and for a constraint that exp(ξ) does not satisfy.
    """

    def __init__(self, basis: ArrayLike, constraint: Callable[[Array], Array] | None = None, name: str = "MatrixGroup"):
        try:
            given = np.array(None if np.ma.is_masked(basis) else basis)
            entries = given if given.dtype.kind == "c" else given.astype(np.float64)
        except Exception as error:
            raise GroupError(
                f"Argument `basis` of MatrixGroup must be square matrices, but is {shown(basis)}."
            ) from error
        if entries.ndim != 3 or entries.shape[1] != entries.shape[2] or not np.all(np.isfinite(entries)):
            raise GroupError(
                f"Argument `basis` of MatrixGroup must be dim finite square matrices, shape (dim, N, N), "
                f"but has shape {entries.shape}."
            )
        sizes = np.max(np.abs(entries), axis=(1, 2), keepdims=True, initial=0.0)
        self._complex = bool(np.any(np.abs(np.imag(entries)) > _ROUND_OFF * sizes))
        matrices = np.ascontiguousarray(real_form(entries) if self._complex else np.real(entries), dtype=np.float64)
        matrices.flags.writeable = False
        self._basis = matrices
        self._constraint = constraint
        self._name = name
        self._key = (matrices.shape, matrices.tobytes(), constraint, self._complex)
        self._require_algebra(name)
        if constraint is not None:
            self._check_constraint()

    def _require_algebra(self, name: str) -> None:
        try:
            require_algebra(self._basis, name)
        except GroupError as error:
            if not self._complex:
                raise
            raise GroupError(
                f"{error} Complex matrices are a basis over the real numbers: Hermitian ones, such as Pauli's, need a "
                "factor i."
            ) from error

    def _check_constraint(self) -> None:
        xi = np.random.default_rng(2).normal(size=self.dim)
        xi *= 0.5 / np.max(np.abs(np.einsum("k,kij->ij", xi, self._basis)))
        checks.function(
            self._constraint, f"Argument `constraint` of {self._name}", "a function g ↦ array", error=GroupError
        )
        try:
            off = float(evaluate(lambda xi: self.defect(self.exp(xi)), xi))
        except Exception as error:
            raise GroupError(
                f"Argument `constraint` of {self._name} must be a function g ↦ array written with jax.numpy, but with "
                f"a matrix ({self.matrix_size}, {self.matrix_size}) it raised {error_line(error)}."
            ) from error
        if not off <= 1e-10:
            raise GroupError(
                f"Argument `constraint` of {self._name} must vanish on the group, but is {off:.1e} at the exponential "
                "of an element of its algebra: another basis or another constraint is meant."
            )

    @cached_property
    def _hull(self) -> np.ndarray:
        """Orthonormal rows that span all products of basis matrices: exp(ξ) − I lies among them."""
        rows = _orthonormal(self._basis.reshape(self.dim, -1))
        while True:
            products = np.einsum("iab,jbc->ijac", rows.reshape(-1, *self._basis.shape[1:]), self._basis)
            longer = _orthonormal(np.concatenate([rows, products.reshape(-1, rows.shape[1])]))
            if len(longer) == len(rows):
                return rows
            rows = longer

    def outside(self, g: Array) -> Array:
        """The defect; without a constraint, how far g is from the sums of I and products of basis matrices.

        Infinite where g has no inverse.
        """
        if self.constrained:
            return self.defect(g)
        rest = jnp.ravel(g - jnp.eye(self.matrix_size))
        off = jnp.max(jnp.abs(rest - self._hull.T @ (self._hull @ rest)))
        return jnp.where(singular(g), jnp.inf, off)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, MatrixGroup) and self._key == other._key

    def __hash__(self) -> int:
        return hash(self._key)

    def __repr__(self) -> str:
        return f"{self._name}(dim={self.dim}, N={self.matrix_size})"

    @property
    def basis(self) -> np.ndarray:
        return self._basis

    @property
    def constrained(self) -> bool:
        return self._constraint is not None

    def _equations(self, g: Array) -> Array:
        if self._constraint is None:
            raise GroupError(f"{self!r} has no projection or defect: give MatrixGroup a constraint.")
        equations = jnp.ravel(self._constraint(g))
        return jnp.concatenate([equations, off_real_form(g)]) if self._complex else equations

    def defect(self, g: Array) -> Array:
        return jnp.max(jnp.abs(self._equations(g)))

    def project(self, g: Array) -> Array:
        """One Gauss–Newton step of least norm onto the constraint: removes round-off quadratically.

        The step is Jᵀ(JJᵀ + ε)⁻¹ r with rows of unit length; ε = 1e-10 lets equations be redundant.
        """
        jacobian, defect = jax.jacfwd(self._equations)(g).reshape(-1, g.size), self._equations(g)
        squares = jnp.sum(jacobian * jacobian, axis=1)
        lengths = jnp.sqrt(jnp.where(squares > 0, squares, 1.0))
        rows = jacobian / lengths[:, None]
        step = rows.T @ jnp.linalg.solve(rows @ rows.T + 1e-10 * jnp.eye(len(lengths)), defect / lengths)
        return g - step.reshape(g.shape)


def _orthonormal(rows: np.ndarray) -> np.ndarray:
    """Orthonormal rows that span the given ones, each of which counts in its own unit."""
    sizes = np.linalg.norm(rows, axis=1, keepdims=True)
    _, values, found = np.linalg.svd(rows[sizes[:, 0] > 0] / sizes[sizes > 0][:, None], full_matrices=False)
    return found[values > 1e-10 * values[0]]
