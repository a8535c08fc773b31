"""Strains of an element of a rod: the logarithm of the pose of one section as the section before it sees it."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.groups.small_angle import arctangent_ratio

_AXIAL = np.zeros((3, 3, 3))
"""R ↦ (R₃₂ − R₂₃, R₁₃ − R₃₁, R₂₁ − R₁₂), (3, 3, 3)."""
_AXIAL[range(3), [2, 0, 1], [1, 2, 0]], _AXIAL[range(3), [1, 2, 0], [2, 0, 1]] = 1.0, -1.0


def _arctangent_ratios(t: Scalar) -> tuple[Array, Array]:
    """f = arctan(τ)/τ and q = (1 − f)/τ² of t = τ²."""
    q = arctangent_ratio(1, t)
    return 1 - t * q, q


def logarithm(pose: tuple[Array, Array]) -> Array:
    """(ω, v) of poses (R, x) with exp(ω, v) = (R, x), for turns below π.

    With w = 2 tan(θ/2) n of the turn R by θ about n, τ = tan(θ/2), and f, q as above:

        ω = f w,    v = x − ½ f w × x + ¼ q w × (w × x)

    pose: (R, x), in space (…, 3, 3) and (…, 3), which gives (…, 6), rad and m; in the plane (…, 2, 2) and (…, 2), which
    gives (…, 3). At a turn of π it is infinite.
    """
    R, x = pose
    if x.shape[-1] == 2:
        tangent = (R[..., 1, 0] - R[..., 0, 1]) / (2 + R[..., 0, 0] + R[..., 1, 1])
        f, _ = _arctangent_ratios(tangent**2)
        half = (f * tangent)[..., None]
        back = jnp.stack([x[..., 1], -x[..., 0]], axis=-1)
        return jnp.concatenate([2 * half, f[..., None] * x + half * back], axis=-1)
    w, turn = _half_tangent(R)
    f, q = (ratio[..., None] for ratio in _arctangent_ratios(0.25 * jnp.sum(w * w, axis=-1)))
    once = jnp.sum(turn * x[..., None, :], axis=-1)
    twice = jnp.sum(turn * once[..., None, :], axis=-1)
    return jnp.concatenate([f * w, x - 0.5 * f * once + 0.25 * q * twice], axis=-1)


def rotation_vector(R: Array) -> Array:
    """log R, (…, 3), rad, of rotations (…, 3, 3) by less than π."""
    w, _ = _half_tangent(R)
    return _arctangent_ratios(0.25 * jnp.sum(w * w, axis=-1))[0][..., None] * w


def _half_tangent(R: Array) -> tuple[Array, Array]:
    """w = 2 tan(θ/2) n, (…, 3), and its matrix w^×, (…, 3, 3), which is 2(R − Rᵀ)/(1 + tr R).

    Sums of products with constants, whose derivatives XLA compiles in half the time of those of single entries.
    """
    scale = 2 / (1 + jnp.sum(R * np.eye(3), axis=(-2, -1)))
    turned = jnp.sum(_AXIAL * R[..., None, :, :], axis=(-2, -1))
    return scale[..., None] * turned, scale[..., None, None] * (R - jnp.swapaxes(R, -2, -1))


def straight(planar: bool) -> np.ndarray:
    """The strain (κ, γ) of a straight rod, (6,) or in the plane (3,): κ = 0 and γ = the first axis."""
    return np.eye(3)[1] if planar else np.eye(6)[3]


def each_element(strain: PyTree, count: int) -> np.ndarray:
    """A strain for each of `count` elements, (count, d), of one for all (d,) or of one each."""
    return np.broadcast_to(strain, (count, np.shape(strain)[-1])).copy()
