"""The conditions under which matrices are a basis of a Lie algebra."""

from __future__ import annotations

import numpy as np

from coadjoint.errors import GroupError


def require_algebra(basis: np.ndarray, name: str) -> None:
    """Raise GroupError unless these matrices (dim, N, N) are finite, independent and closed under the bracket."""
    if basis.ndim != 3 or basis.shape[1] != basis.shape[2] or not np.all(np.isfinite(basis)):
        raise GroupError(
            f"The basis of {name} must be dim finite square matrices, shape (dim, N, N), but has shape {basis.shape}."
        )
    if np.iscomplexobj(basis):
        raise GroupError(
            f"The basis of {name} must be real matrices, but is complex: give co.groups.real_form of it, or make the "
            f"group by "
            "co.MatrixGroup, which takes complex matrices."
        )
    # Every matrix in its own unit: independence and closure do not depend on the scale of a basis.
    sizes = np.max(np.abs(basis), axis=(1, 2), keepdims=True)
    unit = basis / np.where(sizes > 0, sizes, 1.0)
    flat = unit.reshape(len(basis), -1)
    if np.linalg.matrix_rank(flat) < len(basis):
        raise GroupError(
            f"The basis of {name} must be linearly independent, but its rank is smaller than {len(basis)}."
        )
    products = np.einsum("iab,jbc->ijac", unit, unit)
    brackets = (products - products.transpose(1, 0, 2, 3)).reshape(len(basis) ** 2, -1)
    outside = brackets - brackets @ np.linalg.pinv(flat) @ flat
    if not np.max(np.abs(outside), initial=0.0) <= 1e-10:
        raise GroupError(
            f"The basis of {name} must be closed under the bracket, but [e_i, e_j] leaves its span by "
            f"{np.max(np.abs(outside)):.1e} of |e_i||e_j|; add the missing matrices."
        )
