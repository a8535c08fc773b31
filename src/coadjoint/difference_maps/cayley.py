"""The Cayley transform."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, singledispatch

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.difference_maps.difference_map import DifferenceMap
from coadjoint.groups import (
    SE2,
    SE3,
    SO2,
    SO3,
    Heisenberg,
    LieGroup,
    SemidirectProduct,
    Translation,
    UnitQuaternion,
)
from coadjoint.groups.group import Element, transpose
from coadjoint.groups.rotation_vector import quaternion
from coadjoint.groups.rotations import skew
from coadjoint.kernels.trace.evaluate import evaluate


@dataclass(frozen=True)
class Cayley(DifferenceMap):
    """τ(ξ) = (I − ξ̂/2)⁻¹(I + ξ̂/2), dτ⁻¹_ξ χ = (I − ξ̂/2) χ̂ (I + ξ̂/2) (P79, P80), dτ_ξ χ = ¼(I + τ(ξ)) χ̂ (I + τ(−ξ)).

    It fits quadratic groups and their homogeneous extensions (SO(n), Sp(2n), SE(n)), GL(n), SL(2) and unipotent
    groups. On a semidirect product G ⋉ V it is (F, ½(u + Fu)) with F = τ(ξ) that of G: the same formula where ρ(g)
    is g, and a difference map in every representation. A rotation by π is out of reach. A step counts as beyond the
    chart from |hω| = π on, where the transform turns by 2 atan(π/2), 115°: a guard against steps that no longer follow
    the motion.
    """

    def _tau(self, group: LieGroup, xi: Array) -> Element:
        return _tau(group, xi)

    def _inverse(self, group: LieGroup, g: Element) -> Array:
        return _inverse(group, g)

    def _dtau(self, group: LieGroup, xi: Array, chi: Array) -> Array:
        return _dtau(group, xi, chi)

    def _dtau_inverse_dual(self, group: LieGroup, xi: Array, mu: Array) -> Array:
        return _dtau_inverse_dual(group, xi, mu)


@singledispatch
def _tau(group: LieGroup, xi: Array) -> Element:
    half = 0.5 * group.hat(xi)
    one = jnp.eye(group.matrix_size)
    return group.from_matrix(jnp.linalg.solve(one - half, one + half))


@singledispatch
def _inverse(group: LieGroup, g: Element) -> Array:
    """2 ((g + 1)⁻¹(g − 1))ᵛ."""
    matrix, one = group.matrix(g), jnp.eye(group.matrix_size)
    return 2 * group.vee(jnp.linalg.solve(matrix + one, matrix - one))


@singledispatch
def _dtau(group: LieGroup, xi: Array, chi: Array) -> Array:
    """(I − ξ̂/2)⁻¹ χ̂ (I + ξ̂/2)⁻¹, where 2(I − ξ̂/2)⁻¹ = I + τ(ξ)."""
    one = jnp.eye(group.matrix_size)
    left, right = (one + group.matrix(_tau(group, x)) for x in (xi, -xi))
    return 0.25 * group.vee(left @ group.hat(chi) @ right)


@singledispatch
def _dtau_inverse_dual(group: LieGroup, xi: Array, mu: Array) -> Array:
    half = 0.5 * group.hat(xi)
    one = jnp.eye(group.matrix_size)
    return transpose(lambda chi: group.vee((one - half) @ group.hat(chi) @ (one + half)), group.dim, mu)


@_tau.register
def _(group: Translation, xi: Array) -> Element:
    return xi


@_dtau.register
def _(group: Translation, xi: Array, chi: Array) -> Array:
    return chi


@_dtau_inverse_dual.register
def _(group: Translation, xi: Array, mu: Array) -> Array:
    return mu


@_tau.register
def _(group: SO2, xi: Array) -> Element:
    half = 0.5 * xi[0]
    scale = 1 / (1 + half * half)
    cosine, sine = (1 - half * half) * scale, 2 * half * scale
    return jnp.stack([jnp.stack([cosine, -sine]), jnp.stack([sine, cosine])])


@_dtau.register
def _(group: SO2, xi: Array, chi: Array) -> Array:
    return chi / (1 + 0.25 * xi * xi)


@_dtau_inverse_dual.register
def _(group: SO2, xi: Array, mu: Array) -> Array:
    return (1 + 0.25 * xi * xi) * mu


@_tau.register
def _(group: SO3, xi: Array) -> Element:
    """I + (ω^× + (ω^×)²/2) / (1 + |ω|²/4)."""
    omega = skew(xi)
    return jnp.eye(3) + (omega + 0.5 * (omega @ omega)) / (1 + 0.25 * (xi @ xi))


@_dtau.register
def _(group: SO3, xi: Array, chi: Array) -> Array:
    """(χ + ½ ξ×χ) / (1 + |ξ|²/4)."""
    return (chi + 0.5 * jnp.cross(xi, chi)) / (1 + 0.25 * (xi @ xi))


@_dtau_inverse_dual.register
def _(group: SO3, xi: Array, mu: Array) -> Array:
    """μ + ½ ξ×μ + ¼ ξ (ξ·μ)."""
    return mu + 0.5 * jnp.cross(xi, mu) + 0.25 * xi * (xi @ mu)


@_tau.register
def _(group: SE2, xi: Array) -> Element:
    """x = (I − θJ/2)⁻¹ v, with J the quarter turn."""
    half = 0.5 * xi[0]
    v = xi[1:]
    turned = jnp.stack([-v[1], v[0]])
    return _tau(SO2(), xi[:1]), (v + half * turned) / (1 + half * half)


@_tau.register
def _(group: SE3, xi: Array) -> Element:
    """x = (I − ω^×/2)⁻¹ v = (v + ½ ω×v + ¼ ω (ω·v)) / (1 + |ω|²/4)."""
    omega, v = xi[:3], xi[3:]
    x = (v + 0.5 * jnp.cross(omega, v) + 0.25 * omega * (omega @ v)) / (1 + 0.25 * (omega @ omega))
    return _tau(SO3(), omega), x


@_dtau_inverse_dual.register
def _(group: SE2, xi: Array, mu: Array) -> Array:
    """((1 + θ²/4) m + ½ q·Jv, q) of ξ = (θ, v) and μ = (m, p), with q = p + ½ θJp and J the quarter turn."""
    theta, v, p = xi[0], xi[1:], mu[1:]
    q = p + 0.5 * theta * jnp.stack([-p[1], p[0]])
    return jnp.concatenate([(1 + 0.25 * theta**2) * mu[:1] + 0.5 * (v[0] * q[1] - v[1] * q[0]), q])


@_dtau_inverse_dual.register
def _(group: SE3, xi: Array, mu: Array) -> Array:
    """(m + ½ ω×m + ¼ ω (ω·m) + ½ v×q, q) of ξ = (ω, v) and μ = (m, p), with q = p + ½ ω×p."""
    omega, v = xi[:3], xi[3:]
    q = mu[3:] + 0.5 * jnp.cross(omega, mu[3:])
    return jnp.concatenate([_dtau_inverse_dual(SO3(), omega, mu[:3]) + 0.5 * jnp.cross(v, q), q])


@_tau.register
def _(group: UnitQuaternion, xi: Array) -> Element:
    """(1 + ¼ξ)(1 − ¼ξ)⁻¹ = (1 − |ξ|²/16, ½ξ) / (1 + |ξ|²/16)."""
    square = xi @ xi / 16
    return jnp.concatenate([(1 - square)[None], 0.5 * xi]) / (1 + square)


@_dtau_inverse_dual.register
def _(group: UnitQuaternion, xi: Array, mu: Array) -> Array:
    """(1 − |ξ|²/16) μ + ½ ξ×μ + ⅛ ξ (ξ·μ)."""
    return (1 - xi @ xi / 16) * mu + 0.5 * jnp.cross(xi, mu) + 0.125 * xi * (xi @ mu)


@_tau.register
def _(group: Heisenberg, xi: Array) -> Element:
    """(I − ξ̂/2)⁻¹(I + ξ̂/2) = I + ξ̂ + ½ξ̂², because ξ̂³ = 0: the exponential."""
    return group.exp(xi)


@_dtau_inverse_dual.register
def _(group: Heisenberg, xi: Array, mu: Array) -> Array:
    return mu - 0.5 * group.ad_dual(xi, mu)


@_tau.register
def _(group: SemidirectProduct, xi: Array) -> Element:
    turn, u = group.split(xi)
    F = Cayley().tau(group.group, turn)
    return F, 0.5 * (u + group.representation.act(group.group, F, u))


@_dtau.register
def _(group: SemidirectProduct, xi: Array, chi: Array) -> Array:
    """(η, ½(w + Fw) − ½ η·u) for χ = (χ, w) and η = dτ_ξχ on G."""
    (turn, u), (along, w), V = group.split(xi), group.split(chi), group.representation
    eta, F = Cayley().dtau(group.group, turn, along), Cayley().tau(group.group, turn)
    both = w + V.act(group.group, F, w) - V.infinitesimal(group.group, eta, u)
    return jnp.concatenate([eta, 0.5 * both])


@_dtau_inverse_dual.register
def _(group: SemidirectProduct, xi: Array, mu: Array) -> Array:
    """((dτ⁻¹_ξ)*μ − ½ γ⋄u, γ) with ½(1 + F*)γ = β; γ = β − ½ L*_ξβ where V is of matrices that F transforms."""
    (turn, u), (m, beta) = group.split(xi), group.split(mu)
    if _transforms(group):
        gamma = beta - 0.5 * group.lifted_dual(turn, beta)
    else:
        F = Cayley().tau(group.group, turn)
        half = jax.vmap(lambda b: 0.5 * (b + group.representation.pull(group.group, F, u, b)), out_axes=1)
        gamma = jnp.linalg.solve(half(jnp.eye(beta.shape[0])), beta)
    moved = Cayley().dtau_inverse_dual(group.group, turn, m) - 0.5 * group.representation.diamond(group.group, gamma, u)
    return jnp.concatenate([moved, gamma])


@lru_cache(maxsize=256)
def _transforms(S: SemidirectProduct) -> bool:
    """Whether ½(1 + ρ(τ(ξ))) inverts v ↦ v − ½ξ·v: the Cayley transform of V is that of G."""
    V, group = S.representation, S.group
    xi, v = np.random.default_rng(1846).normal(scale=0.5, size=(2, max(group.dim, V.ambient(group))))

    def back(xi: Array, v: Array):
        u = v - 0.5 * V.infinitesimal(group, xi, v)
        return 0.5 * (u + V.act(group, Cayley().tau(group, xi), u)) - v

    xi, v = xi[: group.dim], v[: V.ambient(group)]
    return bool(np.max(np.abs(evaluate(back, xi, v))) <= 1e-12)


@_inverse.register
def _(group: Translation, g: Element) -> Array:
    return g


@_inverse.register
def _(group: SO2, g: Element) -> Array:
    """2 tan(θ/2)."""
    return 2 * jnp.tan(0.5 * group.log(g))


@_inverse.register
def _(group: SO3, g: Element) -> Array:
    """2v/w of the unit quaternion (w, v), w ≥ 0."""
    q = quaternion(g)
    return 2 * q[1:] / q[0]


@_inverse.register
def _(group: SE2, g: Element) -> Array:
    """(θ, x − ½θJx) with θ that of SO(2)."""
    theta = _inverse(SO2(), g[0])
    return jnp.concatenate([theta, g[1] - 0.5 * theta * jnp.stack([-g[1][1], g[1][0]])])


@_inverse.register
def _(group: SE3, g: Element) -> Array:
    """(ω, x − ½ω×x) with ω that of SO(3)."""
    omega = _inverse(SO3(), g[0])
    return jnp.concatenate([omega, g[1] - 0.5 * jnp.cross(omega, g[1])])


@_inverse.register
def _(group: UnitQuaternion, g: Element) -> Array:
    """4v/(1 + w) of g = (w, v)."""
    return 4 * g[1:] / (1 + g[0])


@_inverse.register
def _(group: Heisenberg, g: Element) -> Array:
    return group.log(g)


@_inverse.register
def _(group: SemidirectProduct, g: Element) -> Array:
    """(τ⁻¹(F), u) with ½(1 + F)u = v."""
    F, v = g
    half = jax.vmap(lambda u: 0.5 * (u + group.representation.act(group.group, F, u)), out_axes=1)
    return jnp.concatenate([Cayley().inverse(group.group, F), jnp.linalg.solve(half(jnp.eye(v.shape[0])), v)])
