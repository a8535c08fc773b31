"""Any matrix Lie group, from a basis of its algebra."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.errors import GroupError
from coadjoint.groups.group import Array
from coadjoint.groups.matrix_elements import MatrixElements


class MatrixGroup(MatrixElements):
    """The matrix Lie group whose algebra has the given basis; an element is a matrix (N, N).

    `basis`: dim matrices (N, N), linearly independent and closed under the bracket. `constraint`: a function
    g ↦ array that vanishes on the group (SL: det g − 1); with it the group has `project` and `defect`.
    Raises GroupError for a basis that is dependent or not closed.

        SL2 = MatrixGroup([[[1, 0], [0, -1]], [[0, 1], [0, 0]], [[0, 0], [1, 0]]],
                          constraint=lambda g: jnp.linalg.det(g) - 1)
    """

    def __init__(self, basis, constraint: Callable[[Array], Array] | None = None, name: str = "MatrixGroup"):
        try:
            matrices = np.array(basis, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise GroupError(f"Argument `basis` of MatrixGroup must be square matrices, but is {basis!r}.") from error
        if matrices.ndim != 3 or matrices.shape[1] != matrices.shape[2] or not np.all(np.isfinite(matrices)):
            raise GroupError(
                f"Argument `basis` of MatrixGroup must be dim finite square matrices, shape (dim, N, N), "
                f"but has shape {matrices.shape}."
            )
        matrices.flags.writeable = False
        self._basis = matrices
        self._constraint = constraint
        self._name = name
        self._key = (matrices.shape, matrices.tobytes(), constraint)
        self._check_algebra()

    def _check_algebra(self) -> None:
        # Every matrix in its own unit: independence and closure do not depend on the scale of a basis.
        sizes = np.max(np.abs(self._basis), axis=(1, 2), keepdims=True)
        unit = self._basis / np.where(sizes > 0, sizes, 1.0)
        flat = unit.reshape(self.dim, -1)
        if np.linalg.matrix_rank(flat) < self.dim:
            raise GroupError(
                f"The basis of {self._name} must be linearly independent, but its rank is smaller than {self.dim}."
            )
        products = np.einsum("iab,jbc->ijac", unit, unit)
        brackets = (products - products.transpose(1, 0, 2, 3)).reshape(self.dim**2, -1)
        outside = brackets - brackets @ np.linalg.pinv(flat) @ flat
        if not np.max(np.abs(outside), initial=0.0) <= 1e-10:
            raise GroupError(
                f"The basis of {self._name} must be closed under the bracket, but [e_i, e_j] leaves its span by "
                f"{np.max(np.abs(outside)):.1e} of |e_i||e_j|; add the missing matrices."
            )

    def __eq__(self, other) -> bool:
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
        return jnp.ravel(self._constraint(g))

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
