"""The exponential as difference map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial, reduce

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.difference_maps.difference_map import DifferenceMap
from coadjoint.groups import SO3, DirectProduct, LieGroup, Opposite, Power
from coadjoint.groups.group import Element
from coadjoint.groups.small_angle import (
    BERNOULLI,
    cotangent_ratio,
    cotangent_ratio_derivative,
    cubic_ratio,
    versine_ratio,
)


@dataclass(frozen=True)
class Exponential(DifferenceMap):
    """τ = exp, dτ⁻¹_ξ = ad_ξ / (e^{ad_ξ} − 1) (P91, P92). It fits every group.

    SO(3): dτ_ξ χ = χ + (1 − cos θ)/θ² ξ×χ + (θ − sin θ)/θ³ ξ×(ξ×χ), (dτ⁻¹_ξ)* μ = μ + ½ ξ×μ + β ξ×(ξ×μ),
    β = (1 − (θ/2) cot(θ/2))/θ², θ = |ξ| < 2π (P94, with the argument θ = h‖ω‖). Where ad_ξ has eigenvalues 0, ±iθ in
    blocks of size ≤ 2 (SE(2), SE(3), …):
    dτ⁻¹_ξ = 1 − ½ ad_ξ + (β − tβ′) ad_ξ² − β′ ad_ξ⁴, t = θ², β′ = dβ/dt. Other groups sum the series of Bernoulli's
    numbers, which is exact to round-off where |ad_ξ⁴|^{1/4} ≤ 2; a step counts as beyond the chart from there on. It
    is the 115° at which the Cayley transform's chart ends, too.
    """

    def _tau(self, group: LieGroup, xi: Array) -> Element:
        return group.exp(xi)

    def _inverse(self, group: LieGroup, g: Element) -> Array:
        return group.log(g)

    def _dtau(self, group: LieGroup, xi: Array, chi: Array) -> Array:
        if not isinstance(group, SO3):
            return super()._dtau(group, xi, chi)
        t, once = xi @ xi, jnp.cross(xi, chi)
        return chi + versine_ratio(t) * once + cubic_ratio(t) * jnp.cross(xi, once)

    def _dtau_inverse_dual(self, group: LieGroup, xi: Array, mu: Array) -> Array:
        t = group.angle_squared(xi)
        ad_dual = partial(group.ad_dual, xi)
        if t is None:
            return _by_series(ad_dual, mu)
        once = ad_dual(mu)
        twice = ad_dual(once)
        if isinstance(group, SO3):
            return mu - 0.5 * once + cotangent_ratio(t) * twice
        slope = cotangent_ratio_derivative(t)
        return mu - 0.5 * once + (cotangent_ratio(t) - t * slope) * twice - slope * ad_dual(ad_dual(twice))

    def chart(self, group: LieGroup, xi: Array) -> Array | float:
        if isinstance(group, Opposite):
            return self.chart(group.group, xi)
        if isinstance(group, Power):
            return jnp.max(group.each(lambda one: jnp.asarray(self.chart(group.factor, one)), xi))
        if isinstance(group, DirectProduct):
            return reduce(jnp.maximum, [self.chart(f, x) for f, x in zip(group.factors, group.split(xi), strict=True)])
        turned = group.rotation_angle(xi) / (2 * np.pi)
        return turned if group.angle_squared(xi) is not None else jnp.maximum(turned, _size_of_bracket(group, xi) / 2)


_TERMS = 32
"""(2/2π)³⁴ < 1e-16."""


def _by_series(ad_dual: Callable[[Array], Array], mu: Array) -> Array:
    """Σ B_n/n! (ad*_ξ)ⁿ μ by Horner's scheme: B_n = 0 for odd n > 1."""
    total = BERNOULLI[_TERMS] * mu
    for n in range(_TERMS - 2, -1, -2):
        total = BERNOULLI[n] * mu + ad_dual(ad_dual(total))
    return total + BERNOULLI[1] * ad_dual(mu)


def _size_of_bracket(group: LieGroup, xi: Array) -> Array:
    """|ad_ξ⁴|^{1/4}, at least the largest eigenvalue of ad_ξ, in the basis scaled to matrices of unit size."""
    sizes = group.basis_sizes()
    ad = jax.vmap(lambda eta: group.ad(xi, eta / sizes) * sizes, out_axes=1)(jnp.eye(group.dim))
    square = ad @ ad
    return jnp.sum((square @ square) ** 2) ** 0.125
