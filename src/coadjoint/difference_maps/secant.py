"""The secant of an action along a difference map: the operator A with H·v − H⁻¹·v = hξ·(A v), H = τ(hξ/2).

A is an even function of the infinitesimal action, A = 1 + O(h²), and commutes with it. A discrete gradient that is
taken between g and gH² needs it, because a chord of the orbit is not a tangent vector.
"""

from __future__ import annotations

from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.difference_maps.cayley import Cayley
from coadjoint.difference_maps.difference_map import DifferenceMap
from coadjoint.difference_maps.exponential import Exponential
from coadjoint.errors import GroupError
from coadjoint.groups.group import LieGroup, transpose
from coadjoint.groups.small_angle import cubic_ratio
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces import Space

_TERMS = 20
"""Of the series of sinh(X)/X: exact to round-off for |X| < 2π, twice what the chart leaves a rotation."""


def secant(difference_map: DifferenceMap, group: LieGroup, space: Space, hxi: Array, x: Array, v: Array) -> Array:
    """A v, (ambient,), for a tangent vector v (ambient,) at x; hxi: hξ, (dim G,).

    Cayley: A = (2 + H + H⁻¹)/4, where H acts as Cayley's transform of the infinitesimal action, as on the defining
    representation. Exponential: A = sinh(X)/X, X v = (hξ/2)·v; where X has the eigenvalues of ad_ξ, 0 and ±iθ in blocks
    of size ≤ 2, A = 1 + (c − tc′)X² − c′X⁴ with t = θ², c = (θ − sin θ)/θ³, c′ = dc/dt; elsewhere its series.
    """
    if isinstance(difference_map, Cayley):
        half = difference_map.tau(group, 0.5 * hxi)
        both = space.push(group, half, x, v) + space.push(group, group.inverse(half), x, v)
        return 0.25 * (2 * v + both)

    def twice(v: Array) -> Array:
        return space.lifted(group, 0.5 * hxi, x, space.lifted(group, 0.5 * hxi, x, v))

    t = group.angle_squared(0.5 * hxi)
    if t is not None and _like_adjoint(group, space):
        c, slope = jax.jvp(cubic_ratio, (t,), (jnp.ones_like(t),))
        once = twice(v)
        return v + (c - t * slope) * once - slope * twice(once)
    total = v
    for k in reversed(range(1, _TERMS + 1)):
        total = v + twice(total) / (2 * k * (2 * k + 1))
    return total


@lru_cache(maxsize=256)
def _like_adjoint(group: LieGroup, space: Space) -> bool:
    """Whether X = ξ· on the space satisfies X(X² + θ²)² = 0 with the θ of ad_ξ, tried at a random ξ."""
    random = np.random.default_rng(1765)
    xi, x = random.normal(size=group.dim), random.normal(size=space.ambient(group))
    matrix = evaluate(jax.vmap(lambda v: space.lifted(group, xi, x, v), out_axes=1), np.eye(len(x)))
    square = matrix @ matrix + float(evaluate(group.angle_squared, xi)) * np.eye(len(x))
    return bool(np.max(np.abs(matrix @ square @ square), initial=0.0) <= 1e-12)


def secant_dual(difference_map: DifferenceMap, group: LieGroup, space: Space, hxi: Array, x: Array, b: Array) -> Array:
    """A*b, (ambient,), of a covector b (ambient,): ⟨A*b, v⟩ = ⟨b, A v⟩ with the arguments of `secant`."""
    return transpose(lambda v: secant(difference_map, group, space, hxi, x, v), space.ambient(group), b)


@lru_cache(maxsize=256)
def require_secant(difference_map: DifferenceMap, group: LieGroup, space: Space) -> None:
    """Raise GroupError unless the secant of this map is known on this space, tried at random hξ and v."""
    if not isinstance(difference_map, Cayley | Exponential):
        raise GroupError(f"An energy–momentum step needs Cayley() or Exponential(), but got {difference_map!r}.")
    size = space.ambient(group)
    random = np.random.default_rng(1734)
    hxi = random.normal(scale=0.3, size=group.dim) / group.basis_sizes()

    def misfit(hxi: Array, x: Array, v: Array) -> tuple[Array, Array]:
        forward, back = (difference_map.tau(group, s * hxi) for s in (0.5, -0.5))
        chord = space.push(group, forward, x, v) - space.push(group, back, x, v)
        tangent = space.lifted(group, hxi, x, secant(difference_map, group, space, hxi, x, v))
        return jnp.max(jnp.abs(chord - tangent), initial=0.0), jnp.max(jnp.abs(v), initial=0.0)

    off, scale = map(float, evaluate(misfit, hxi, *random.normal(size=(2, size))))
    if not off <= 1e-10 * max(scale, 1e-300):
        raise GroupError(
            f"On {space!r} {group!r} does not act by Cayley's transform, so that an energy–momentum step with "
            f"{difference_map!r} would lose the energy (off by {off:.1e}): use co.Exponential()."
        )
