"""The end of isospectral steps: the momentum after a step by a unitary map, however close W̃ is to its equations."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax.numpy as jnp
from jax import lax

from coadjoint.groups.group import Array
from coadjoint.kernels.newton.fixed_point import largest, scales
from coadjoint.mechanics.system import System
from coadjoint.methods.isospectral_fields import brackets, moved, rows_of

ROUND_OFF = 3e-16
"""What is left of the equations for Ŵ, relative to W̃, of which an error in each step adds up in the spectrum."""

SINGLE = 1e-10
"""The largest tolerance with which corrections are exact to round-off in single precision."""

LARGE = 128**2
"""How many unknowns of a copy there are where products in single precision take less time."""

NEAR = 100.0
"""What is left, over ROUND_OFF, below which it is round-off once it no longer shrinks."""

MOST = 100
"""The most iterations; with a contraction by 0.7 half of them do."""


class _Correction(NamedTuple):
    delta: Array
    odd: Array
    left: Array
    size: Array
    goes_on: Array
    iterations: Array


def correction(
    system: System, slopes: tuple[Array, Array], off: Array, z: Array, epsilon: Array, precision: Any
) -> Array:
    """ε[P̃, δ], (unknowns,), of δ = Ŵ − W̃ where P̃ stays: δ − ε[P̃, δ] − ε² P̃δP̃ = −r.

    off: r, (unknowns,), what the equations are off at W̃, of unknowns z. By δ ← δ − (what is left of r), with products
    in a precision; NaN where that diverges.
    """
    rows = rows_of(system)
    unit, until = jnp.max(jnp.abs(off)), ROUND_OFF * scales(z, rows)
    unit = jnp.where(unit > 0, unit, 1.0)  # single precision has no small numbers
    forces = epsilon * slopes[0], epsilon * slopes[1]

    def size_of(left):
        return jnp.max(unit * largest(left, rows) / until)

    def advance(now: _Correction) -> _Correction:
        delta = now.delta - now.left
        left = off / unit + delta - moved(system, *forces, delta, 1.0, precision)
        odd = brackets(system, *forces, delta, 1.0, precision).astype(off.dtype)
        size = size_of(left)
        goes_on = (size > 1) & ((size > NEAR) | (size < now.size))
        return _Correction(delta, odd, left, size, goes_on, now.iterations + 1)

    nothing, begun = jnp.zeros_like(off), size_of(off / unit)
    end = lax.while_loop(
        lambda now: now.goes_on & (now.iterations < MOST),
        advance,
        _Correction(nothing, nothing, off / unit, begun, begun > 1, jnp.asarray(0)),
    )
    return jnp.where(end.iterations < MOST, unit * end.odd, jnp.nan)
