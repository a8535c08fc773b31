"""Complex matrices as real ones of twice the size, A + iB ↦ [[A, −B], [B, A]]: sums, products and inverses stay."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array


def real_form(matrix: Array) -> Array:
    """[[A, −B], [B, A]] of complex matrices A + iB; it acts on (Re z, Im z).

    matrix: a NumPy or JAX array (…, N, N). Returns the same kind, (…, 2N, 2N).
    """
    numbers = jnp if isinstance(matrix, jnp.ndarray) else np
    A, B = numbers.real(matrix), numbers.imag(matrix)
    return numbers.concatenate([numbers.concatenate([A, -B], axis=-1), numbers.concatenate([B, A], axis=-1)], axis=-2)


def complex_form(matrix: Array) -> Array:
    """A + iB of [[A, −B], [B, A]], the inverse of `co.groups.real_form`.

    matrix: a NumPy or JAX array (…, 2N, 2N). Returns the same kind, (…, N, N).
    """
    size = matrix.shape[-1] // 2
    return matrix[..., :size, :size] + 1j * matrix[..., size:, :size]


def off_real_form(matrix: Array) -> Array:
    """What of a matrix (2N, 2N) is not of the form [[A, −B], [B, A]]: both differences of blocks, (2N²,)."""
    size = matrix.shape[-1] // 2
    A, B, C, D = matrix[:size, :size], matrix[size:, :size], matrix[:size, size:], matrix[size:, size:]
    return jnp.concatenate([jnp.ravel(A - D), jnp.ravel(B + C)])
