"""Strains of an element of a rod: the logarithm of the pose of one section as the section before it sees it."""

from __future__ import annotations

from functools import cache, partial, reduce
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.groups.group import Array

_SWITCH = 1 / 4
_LEVELS = 12

_AXIAL = np.zeros((3, 3, 3))
"""R ↦ (R₃₂ − R₂₃, R₁₃ − R₃₁, R₂₁ − R₁₂), (3, 3, 3)."""
_AXIAL[range(3), [2, 0, 1], [1, 2, 0]], _AXIAL[range(3), [1, 2, 0], [2, 0, 1]] = 1.0, -1.0


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def _arctangent_ratio(k: int, t: Array) -> Array:
    """A_k = ∫₀¹ u²ᵏ/(1 + tu²) du = Σ_j (−t)ʲ/(2j + 2k + 1), an array of any shape, smooth through t = 0.

    A₀ = arctan(τ)/τ of t = τ²; A_{k+1} = (1/(2k + 1) − A_k)/t; dA_k/dt = ½ ((2k + 1) A_{k+1} − 1/(1 + t)). Below
    t = 1/4 by Gauss's continued fraction, which is exact to round-off there, above it in closed form. The division
    comes last: XLA computes anew what is no division wherever it is used.
    """
    near = t < _SWITCH
    inner, outer = jnp.where(near, t, 0.0), jnp.where(near, 1.0, t)
    tangent = jnp.sqrt(outer)
    above, below = jnp.arctan(tangent), tangent
    for j in range(k):
        above, below = 1 / (2 * j + 1) - above / below, outer
    numerator, denominator = (_horner(row, inner) for row in _convergent(k))
    return jnp.where(near, numerator, above) / jnp.where(near, denominator, below)


@cache
def _convergent(k: int) -> np.ndarray:
    """Coefficients of P and Q from the constant on, (2, 1 + LEVELS/2), with A_k = P(t)/Q(t).

    (2k + 1) A_k = 1/(1 + e₁t/(1 + e₂t/(1 + …))) with e_n = s²/((k + n − ½)(k + n + ½)), where s = n/2 of even n and
    k + n/2 of odd n; there are LEVELS of them.
    """
    size = 1 + _LEVELS // 2
    before, now = np.eye(1, size) * [[0.0], [1.0]], np.eye(1, size) * [[1.0], [1.0]]
    for n in range(1, _LEVELS + 1):
        half = n // 2 if n % 2 == 0 else k + n / 2
        e = half**2 / ((k + n - 0.5) * (k + n + 0.5))
        before, now = now, now + e * np.pad(before[:, :-1], ((0, 0), (1, 0)))
    return now / [[2 * k + 1], [1]]


def _horner(coefficients: np.ndarray, t: Array) -> Array:
    """Σ_i c_i tⁱ, an array of the shape of t."""
    return reduce(lambda value, c: value * t + c, coefficients[::-1].tolist())


@_arctangent_ratio.defjvp
def _(k, primals, tangents):
    (t,), (along,) = primals, tangents
    slope = 0.5 * ((2 * k + 1) * _arctangent_ratio(k + 1, t) - 1 / (1 + t))
    return _arctangent_ratio(k, t), slope * along


def _arctangent_ratios(t: Array) -> tuple[Array, Array]:
    """f = arctan(τ)/τ and q = (1 − f)/τ² of t = τ²."""
    q = _arctangent_ratio(1, t)
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


def each_element(strain: Any, count: int) -> np.ndarray:
    """A strain for each of `count` elements, (count, d), of one for all (d,) or of one each."""
    return np.broadcast_to(strain, (count, np.shape(strain)[-1])).copy()
