"""Symmetrised canonical coordinates of the second kind."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, reduce

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, Scalar
from coadjoint.difference_maps.difference_map import DifferenceMap
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element


@dataclass(frozen=True)
class SecondKind(DifferenceMap):
    """τ(ξ) = e^{ξ₁e₁/2} ⋯ e^{ξ_d e_d/2} · e^{ξ_d e_d/2} ⋯ e^{ξ₁e₁/2} in the basis e₁, …, e_d of 𝔤. It fits every group.

    Forwards, then backwards: the plain product has no τ(ξ)⁻¹ = τ(−ξ). It is not its own squared map, and depends on
    the basis and its order. With P_i and Q_i what stands before the factors of e_i,
    dτ_ξχ = Σ_i ½χ_i (Ad_{P_i}e_i + Ad_{Q_i}e_i); (dτ⁻¹_ξ)* solves with the transpose of it.
    """

    def _tau(self, group: LieGroup, xi: Array) -> Element:
        return reduce(group.compose, [group.from_matrix(factor) for factor in _factors(group, xi)])

    def _dtau_inverse_dual(self, group: LieGroup, xi: Array, mu: Array) -> Array:
        factors, units = _factors(group, xi), np.eye(group.dim)
        both = [*range(group.dim), *reversed(range(group.dim))]
        rows: list[Array] = [jnp.zeros(group.dim)] * group.dim
        before = group.identity()
        for i, factor in zip(both, factors, strict=True):
            rows[i] = rows[i] + 0.5 * group.Ad(before, units[i])
            before = group.compose(before, group.from_matrix(factor))
        return jnp.linalg.solve(jnp.stack(rows), mu)


def _factors(group: LieGroup, xi: Array) -> list[Array]:
    """e^{ξ_i e_i/2} forwards and backwards, as matrices."""
    first = [_one_parameter(group, i, 0.5 * xi[i]) for i in range(group.dim)]
    return [*first, *reversed(first)]


def _one_parameter(group: LieGroup, i: int, t: Scalar) -> Array:
    """e^{t e_i}: 1 + s(t) e_i + c(t) e_i² where e_i³ = κ e_i, s″ = κs; else the exponential of the group."""
    e, kappa = group.basis[i], _cubic(group)[i]
    if kappa is None:
        return group.matrix(group.exp(t * np.eye(group.dim)[i]))
    if kappa == 0:
        sine, versine = t, 0.5 * t * t
    else:
        root = np.sqrt(abs(kappa))
        s = jnp.sin if kappa < 0 else jnp.sinh
        sine, versine = s(root * t) / root, 2 * (s(0.5 * root * t) / root) ** 2
    return jnp.eye(len(e)) + sine * e + versine * (e @ e)


@lru_cache(maxsize=256)
def _cubic(group: LieGroup) -> tuple[float | None, ...]:
    """κ with e³ = κe for each matrix of the basis; None where there is none."""
    found: list[float | None] = []
    for e in group.basis:
        cube = e @ e @ e
        kappa = float(np.sum(cube * e) / np.sum(e * e))
        exact = np.max(np.abs(cube - kappa * e)) <= 1e-14 * np.max(np.abs(e)) ** 3
        found.append(kappa if exact and abs(kappa) > 1e-14 * np.max(np.abs(e)) ** 2 else 0.0 if exact else None)
    return tuple(found)
