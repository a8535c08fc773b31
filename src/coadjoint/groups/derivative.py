"""Derivatives of functions on a group, as covectors of 𝔤*."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp

from coadjoint.arrays import Array, Scalar
from coadjoint.groups.group import Element, LieGroup, transpose


def right_derivative(group: LieGroup, function: Callable[[Element], Scalar], F: Element) -> Array:
    """D^R_F f ∈ 𝔤*, shape (dim,): ⟨D^R_F f, χ⟩ = d/dε f(e^{εχ}F) at ε = 0."""
    return _at_identity(group, lambda e: function(group.compose(e, F)))


def left_derivative(group: LieGroup, function: Callable[[Element], Scalar], F: Element) -> Array:
    """D^L_F f ∈ 𝔤*, shape (dim,): ⟨D^L_F f, χ⟩ = d/dε f(Fe^{εχ}) at ε = 0, so that D^L_F f = Ad*_F D^R_F f."""
    return _at_identity(group, lambda e: function(group.compose(F, e)))


def _at_identity(group: LieGroup, function: Callable[[Element], Scalar]) -> Array:
    e = group.identity()
    slope = jax.grad(function)(e)

    def along(chi: Array) -> Array:
        parts = zip(jax.tree.leaves(slope), jax.tree.leaves(group.tangent(chi)), strict=True)
        return sum((jnp.sum(s * d) for s, d in parts), jnp.zeros(()))

    return transpose(along, group.dim, jnp.ones(()))
