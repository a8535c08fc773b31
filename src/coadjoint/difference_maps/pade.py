"""Diagonal Padé approximants of the exponential."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import jax
import jax.numpy as jnp

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.difference_maps.difference_map import DifferenceMap
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element, transpose


@dataclass(frozen=True)
class Pade(DifferenceMap):
    """τ(ξ) = N(−ξ̂)⁻¹N(ξ̂), N(X) = Σ_j (2m−j)! m! / ((2m)! j! (m−j)!) Xʲ: e^ξ̂ up to ξ^{2m+1}.

    order: m, an integer from 1 to 8, by default 2; Pade(1) is the Cayley transform. It fits quadratic groups and
    their homogeneous extensions as that does, because N(−X)⁻¹N(X) keeps gᵀPg = P for every m. It is not its own squared
    map. With N = N(ξ̂) and M = N(−ξ̂), which commute, M (dτ_ξχ)^ N = (∂_χN) M − (∂_χM) N; (dτ⁻¹_ξ)* solves with the
    transpose of it. Raises ArgumentError for another order.
    """

    order: int = 2

    def __post_init__(self):
        object.__setattr__(self, "order", checks.whole(self.order, "Argument `order` of Pade", 1, 8))

    def _coefficients(self) -> list[float]:
        m = self.order
        return [
            factorial(2 * m - j) * factorial(m) / (factorial(2 * m) * factorial(j) * factorial(m - j))
            for j in range(m + 1)
        ]

    def _numerators(self, X: Array) -> tuple[Array, Array]:
        """N(X) and N(−X), by the even and the odd part."""
        even = odd = jnp.zeros_like(X)
        power = jnp.eye(X.shape[0])
        for j, coefficient in enumerate(self._coefficients()):
            even, odd = (even, odd + coefficient * power) if j % 2 else (even + coefficient * power, odd)
            power = power @ X
        return even + odd, even - odd

    def _tau(self, group: LieGroup, xi: Array) -> Element:
        N, M = self._numerators(group.hat(xi))
        return group.from_matrix(jnp.linalg.solve(M, N))

    def _dtau_inverse_dual(self, group: LieGroup, xi: Array, mu: Array) -> Array:
        """Solve K*β = μ with K χ = (∂_χN)M − (∂_χM)N, which lies in 𝔤; then the dual of χ ↦ M χ̂ N."""
        X = group.hat(xi)
        N, M = self._numerators(X)

        def K(chi: Array) -> Array:
            slope_N, slope_M = jax.jvp(self._numerators, (X,), (group.hat(chi),))[1]
            return group.vee(slope_N @ M - slope_M @ N)

        beta = jnp.linalg.solve(jax.vmap(K)(jnp.eye(group.dim)), mu)
        return transpose(lambda chi: group.vee(M @ group.hat(chi) @ N), group.dim, beta)
