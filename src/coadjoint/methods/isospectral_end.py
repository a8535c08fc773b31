"""The end of isospectral steps: the momentum after a step by a unitary map, however close W̃ is to its equations."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax

from coadjoint.arrays import Array, Scalar
from coadjoint.kernels.newton.fixed_point import largest, scales
from coadjoint.mechanics.system import System
from coadjoint.methods.isospectral_fields import Moves, moves, rows_of

ROUND_OFF = 1e-16
"""The residual of the equations for Ŵ, relative to W̃; its errors add up in the spectrum over the steps."""

SINGLE = 1e-10
"""The largest tolerance with which corrections are exact to round-off in single precision."""

LARGE = 128**2
"""The number of unknowns of a copy from which products in single precision take less time."""

MOST = 100
"""The most iterations; with a contraction by 0.7 this number suffices."""


class RightSides(NamedTuple):
    """The equations evaluated at some unknowns: the slopes there, and the right sides that follow from them.

    at: the unknowns z, (unknowns,). xi, along_a: ∂ℋ/∂μ and ∂ℋ/∂a, (dim G,) and (ambient V*,). off: the residual, z less
    the right sides, (unknowns,). odd: the part of the right sides that is odd in ε,
    (unknowns,).
    """

    at: Array
    xi: Array
    along_a: Array
    off: Array
    odd: Array


class _Correction(NamedTuple):
    delta: Array
    odd: Array
    rest: Array
    size: Array
    shrinks: Array
    iterations: Array


def correction(
    system: System, slopes: tuple[Array, Array], off: Array, z: Array, epsilon: Scalar, precision: object
) -> tuple[Array, Array]:
    """Lδ and the part of it that is odd in ε, (unknowns,) each, of δ with δ − Lδ = −r, for fixed P̃.

    L δ = ε[P̃, δ] + ε² P̃δP̃, by `moves`. off: r, (unknowns,), the residual of the equations at W̃, of
    unknowns z. δ = −(r + Lr + L²r + …), up to a term that is round-off, with products in the given precision; NaN if
    the series diverges.
    """
    rows = rows_of(system)
    unit, until = jnp.max(jnp.abs(off)), ROUND_OFF * scales(z, rows)
    unit = jnp.where(unit > 0, unit, 1.0)  # single precision has no small numbers
    forces = epsilon * slopes[0], epsilon * slopes[1]

    def moved_by(rest: Array) -> Moves:
        return Moves(*(part.astype(off.dtype) for part in moves(system, *forces, rest, 1.0, precision)))

    def size_of(rest: Array) -> Array:
        return jnp.max(unit * largest(rest, rows) / until)

    def advance(now: _Correction) -> _Correction:
        rest, odd = moved_by(now.rest)
        size = size_of(rest)
        return _Correction(now.delta + now.rest, now.odd + odd, rest, size, size / now.size, now.iterations + 1)

    nothing, begun = jnp.zeros_like(off), -off / unit
    end = lax.while_loop(
        lambda now: (now.size * now.shrinks > 1) & (now.iterations < MOST),
        advance,
        _Correction(nothing, nothing, begun, size_of(begun), jnp.asarray(1.0), jnp.asarray(0)),
    )
    scale, last = jnp.where(end.iterations < MOST, unit, jnp.nan), moved_by(end.rest).odd
    return scale * (end.delta + end.rest + last) + off, scale * (end.odd + last)


@jax.custom_jvp
def valued(value: Array, other: Array) -> Array:
    """`value`, with the derivatives of `other`, arrays of one shape."""
    return value


@valued.defjvp
def _valued_slope(primals: tuple[Array, Array], tangents: tuple[Array, Array]) -> tuple[Array, Array]:
    return valued(*primals), tangents[1]
