"""The exponential as difference map."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.difference_maps.difference_map import DifferenceMap
from coadjoint.groups import SO3, LieGroup
from coadjoint.groups.group import Array, Element
from coadjoint.groups.small_angle import cotangent_ratio, cotangent_ratio_derivative


@dataclass(frozen=True)
class Exponential(DifferenceMap):
    """τ = exp, dτ⁻¹_ξ = ad_ξ / (e^{ad_ξ} − 1) (P91, P92). It fits every group.

    SO(3): (dτ⁻¹_ξ)* μ = μ + ½ ξ×μ + β ξ×(ξ×μ), β = (1 − (θ/2) cot(θ/2))/θ², θ = |ξ| < 2π (P94, with the argument
    θ = h‖ω‖). Where ad_ξ has eigenvalues 0, ±iθ in blocks of size ≤ 2 (SE(2), SE(3), …):
    dτ⁻¹_ξ = 1 − ½ ad_ξ + (β − tβ′) ad_ξ² − β′ ad_ξ⁴, t = θ², β′ = dβ/dt. Other groups use the matrix exponential of
    [[ad, 1], [0, 0]], whose corner is (e^{ad} − 1)/ad.
    """

    def _tau(self, group: LieGroup, xi: Array) -> Element:
        return group.exp(xi)

    def _dtau_inverse_dual(self, group: LieGroup, xi: Array, mu: Array) -> Array:
        t = group.angle_squared(xi)
        if t is None:
            return _by_matrix_exponential(group, xi, mu)
        ad_dual = partial(group.ad_dual, xi)
        once = ad_dual(mu)
        twice = ad_dual(once)
        if isinstance(group, SO3):
            return mu - 0.5 * once + cotangent_ratio(t) * twice
        slope = cotangent_ratio_derivative(t)
        return mu - 0.5 * once + (cotangent_ratio(t) - t * slope) * twice - slope * ad_dual(ad_dual(twice))

    def chart(self, group: LieGroup, xi: Array) -> Array | float:
        return group.rotation_angle(xi) / (2 * np.pi)


def _by_matrix_exponential(group: LieGroup, xi: Array, mu: Array) -> Array:
    n = group.dim
    ad = jax.vmap(lambda eta: group.ad(xi, eta), out_axes=1)(jnp.eye(n))
    block = jnp.zeros((2 * n, 2 * n)).at[:n, :n].set(ad).at[:n, n:].set(jnp.eye(n))
    dtau = jax.scipy.linalg.expm(block)[:n, n:]
    return jnp.linalg.solve(dtau.T, mu)
