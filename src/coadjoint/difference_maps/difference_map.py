"""The contract of a group difference map τ: 𝔤 → G, with its tangents derived from τ alone.

Definitions 3–5: τ(0) = e, τ(ξ)⁻¹ = τ(−ξ); Dτ(ξ)·χ = (dτ_ξ χ) τ(ξ) (P32) and its inverse dτ⁻¹_ξ (P34).
Closed forms are optimisations; each must satisfy dτ_ξ = Ad_{τ(ξ)} dτ_{−ξ} (P33) and
dτ⁻¹_ξ = dτ⁻¹_{−ξ} Ad_{τ(−ξ)} (P35) exactly, because the last is what makes momentum exact.
"""

from __future__ import annotations

from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from coadjoint.arrays import Array
from coadjoint.errors import GroupError, must_give
from coadjoint.groups.direct_product import DirectProduct
from coadjoint.groups.group import Element, LieGroup, require_solution, transpose
from coadjoint.groups.opposite import Opposite
from coadjoint.groups.power import Power
from coadjoint.kernels.run import disk_cache
from coadjoint.kernels.trace.evaluate import evaluate, traced

_NEWTON_STEPS = 12
"""Of τ(ξ) = g from log g, which quadratic convergence needs anywhere in a chart."""


class DifferenceMap:
    """A group difference map; a new one gives `_tau`, and closed forms where it has them.

    On a direct product every map acts factor by factor, on the opposite of a group as on the group, where dτ_ξ is the
    group's dτ_{−ξ}. Maps are static, hashable objects.
    """

    def _tau(self, group: LieGroup, xi: Array) -> Element:
        must_give(self, "_tau")

    def _dtau(self, group: LieGroup, xi: Array, chi: Array) -> Array:
        """By differentiation of τ."""
        velocity = jax.jvp(lambda x: group.matrix(self.tau(group, x)), (xi,), (chi,))[1]
        return group.vee(velocity @ group.matrix(self.tau(group, -xi)))

    def _dtau_inverse_dual(self, group: LieGroup, xi: Array, mu: Array) -> Array:
        return jnp.linalg.solve(self._tangent_matrix(group, xi).T, mu)

    def _inverse(self, group: LieGroup, g: Element) -> Array:
        """By Newton's iteration from log g: ξ ↦ ξ + dτ⁻¹_ξ ½(M − M⁻¹)ᵛ with M = g τ(ξ)⁻¹.

        Two further steps, from a ξ that counts as a constant, have the derivatives of the solution.
        """

        def step(xi: Array) -> Array:
            there, back = self.tau(group, xi), self.tau(group, -xi)
            M = group.matrix(group.compose(g, back)) - group.matrix(group.compose(there, group.inverse(g)))
            return xi + self.dtau_inverse(group, xi, group.vee(0.5 * M))

        found = lax.fori_loop(0, _NEWTON_STEPS, lambda _, xi: step(xi), group.log(g))
        return step(step(lax.stop_gradient(found)))

    def inverse(self, group: LieGroup, g: Element) -> Array:
        """ξ = τ⁻¹(g), (dim,), of an element g: τ(ξ) = g on the branch of ξ = 0 (P38, Definition 5).

        Of numbers it returns NumPy's float64, and raises GroupError where g is not on the group or outside the image of
        τ on that branch. Under jit, vmap and grad it is not finite there, or no solution.
        """
        if not traced(g):
            xi = evaluate(lambda g: self.inverse(group, g), g)
            require_solution(group, repr(self), xi, lambda xi: self.tau(group, xi), g)
            return xi
        if isinstance(group, Opposite):
            return self.inverse(group.group, g)
        if isinstance(group, DirectProduct):
            return jnp.concatenate([self.inverse(factor, part) for factor, part in zip(group.factors, g, strict=True)])
        if isinstance(group, Power):
            return jnp.reshape(jax.vmap(lambda one: self.inverse(group.factor, one))(g), -1)
        return self._inverse(group, g)

    def tau(self, group: LieGroup, xi: Array) -> Element:
        """τ(ξ), an element, of ξ (dim,)."""
        if isinstance(group, Opposite):
            return self.tau(group.group, xi)
        if isinstance(group, DirectProduct):
            parts = zip(group.factors, group.split(xi), strict=True)
            return tuple(self.tau(factor, part) for factor, part in parts)
        if isinstance(group, Power):
            return group.each(lambda one: self.tau(group.factor, one), xi)
        return self._tau(group, xi)

    def dtau(self, group: LieGroup, xi: Array, chi: Array) -> Array:
        """dτ_ξ χ = (Dτ(ξ)·χ) τ(ξ)⁻¹, (dim,), of ξ and χ (dim,) (P32)."""
        if isinstance(group, Opposite):
            return self.dtau(group.group, -xi, chi)
        if isinstance(group, DirectProduct):
            parts = zip(group.factors, group.split(xi), group.split(chi), strict=True)
            return jnp.concatenate([self.dtau(factor, x, c) for factor, x, c in parts])
        if isinstance(group, Power):
            return jnp.reshape(group.each(lambda x, c: self.dtau(group.factor, x, c), xi, chi), -1)
        return self._dtau(group, xi, chi)

    def dtau_dual(self, group: LieGroup, xi: Array, mu: Array) -> Array:
        """dτ*_ξ μ, (dim,), of ξ and μ (dim,), with ⟨dτ*_ξ μ, χ⟩ = ⟨μ, dτ_ξ χ⟩."""
        return transpose(lambda chi: self.dtau(group, xi, chi), group.dim, mu)

    def dtau_inverse(self, group: LieGroup, xi: Array, chi: Array) -> Array:
        """dτ⁻¹_ξ χ, (dim,), of ξ and χ (dim,) (P34); the dual of `dtau_inverse_dual`."""
        return transpose(lambda mu: self.dtau_inverse_dual(group, xi, mu), group.dim, chi)

    def dtau_inverse_dual(self, group: LieGroup, xi: Array, mu: Array) -> Array:
        """(dτ⁻¹_ξ)* μ, (dim,), of ξ and μ (dim,), with ⟨(dτ⁻¹_ξ)* μ, χ⟩ = ⟨μ, dτ⁻¹_ξ χ⟩."""
        if isinstance(group, Opposite):
            return self.dtau_inverse_dual(group.group, -xi, mu)
        if isinstance(group, DirectProduct):
            parts = zip(group.factors, group.split(xi), group.split(mu), strict=True)
            return jnp.concatenate([self.dtau_inverse_dual(factor, x, m) for factor, x, m in parts])
        if isinstance(group, Power):
            return jnp.reshape(group.each(lambda x, m: self.dtau_inverse_dual(group.factor, x, m), xi, mu), -1)
        return self._dtau_inverse_dual(group, xi, mu)

    def chart(self, group: LieGroup, xi: Array) -> Array | float:
        """How far ξ (dim,) lies in the domain of the chart, one number: below 1 inside, 1 at its end."""
        return group.rotation_angle(xi) / np.pi

    def _tangent(self, group: LieGroup, xi: Array, chi: Array) -> Array:
        """(Dτ(ξ)·χ) τ(ξ)⁻¹ as a matrix."""
        value, velocity = jax.jvp(lambda x: group.matrix(self.tau(group, x)), (xi,), (chi,))
        return jnp.linalg.solve(value.T, velocity.T).T

    def _tangent_matrix(self, group: LieGroup, xi: Array) -> Array:
        """dτ_ξ as a matrix (dim, dim)."""
        return jax.vmap(lambda chi: self.dtau(group, xi, chi), out_axes=1)(jnp.eye(group.dim))

    def require_fit(self, group: LieGroup) -> None:
        """Raise GroupError unless (Dτ(ξ)χ) τ(ξ)⁻¹ lies in 𝔤 and τ(ξ)⁻¹ = τ(−ξ) at random ξ, χ."""
        if isinstance(group, Opposite):
            self.require_fit(group.group)
            return
        if isinstance(group, DirectProduct):
            for factor in group.factors:
                self.require_fit(factor)
            return
        if isinstance(group, Power):
            self.require_fit(group.factor)
            return
        if not group.dim:  # {e}, of which there is one map
            return
        outside, asymmetry = _misfit(self, group)
        if not outside <= 1e-8:  # NaN does not fit
            raise GroupError(
                f"{self!r} does not map the algebra of {group!r} into the group: (Dτ(ξ)χ)τ(ξ)⁻¹ leaves the algebra by "
                f"{outside:.1e} of its size; use Exponential(), which fits every group."
            )
        if not asymmetry <= 1e-8:
            raise GroupError(
                f"{self!r} is not a group difference map on {group!r}: τ(ξ)τ(−ξ) differs from e by {asymmetry:.1e}."
            )


@lru_cache(maxsize=256)
def _misfit(difference_map: DifferenceMap, group: LieGroup) -> tuple[float, float]:
    """Over a few random ξ, χ: the largest part of (Dτ(ξ)χ)τ(ξ)⁻¹ outside 𝔤, relative to it, and of τ(ξ)τ(−ξ) − I."""
    found = disk_cache.recalled(("misfit", difference_map, group), lambda: _measured(difference_map, group))
    return found["outside"], found["asymmetry"]


def _measured(difference_map: DifferenceMap, group: LieGroup) -> dict[str, float]:
    def measure(xi: Array, chi: Array) -> tuple[Array, Array]:
        tangent = difference_map._tangent(group, xi, chi)
        outside = jnp.max(jnp.abs(tangent - group.hat(group.vee(tangent)))) / jnp.max(jnp.abs(tangent))
        back = group.matrix(difference_map.tau(group, xi)) @ group.matrix(difference_map.tau(group, -xi))
        return outside, jnp.max(jnp.abs(back - jnp.eye(back.shape[0])))

    random = np.random.default_rng(1879)
    pairs = random.normal(scale=0.3, size=(3, 2, group.dim)) / group.basis_sizes()
    outside, asymmetry = np.max([evaluate(measure, xi, chi) for xi, chi in pairs], axis=0)
    return {"outside": float(outside), "asymmetry": float(asymmetry)}
