"""The linear spaces on which every matrix group acts, and the points that rigid motions move."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.errors import GroupError
from coadjoint.groups import SE2, SE3, SO3, LieGroup, SemidirectProduct
from coadjoint.groups.group import Element
from coadjoint.spaces.space import Space


class Representation(Space):
    """A linear action: velocities and points transform alike."""

    def push(self, group: LieGroup, g: Element, x: Array, v: Array) -> Array:
        return self.act(group, g, v)

    def lifted(self, group: LieGroup, xi: Array, x: Array, v: Array) -> Array:
        return self.infinitesimal(group, xi, v)

    def lifted_diamond(self, group: LieGroup, b: Array, x: Array, v: Array) -> Array:
        return self.diamond(group, b, v)


@dataclass(frozen=True)
class Defining(Representation):
    """ℝᴺ with v ↦ gv, the matrices of the group themselves. On SO(3): ξ·x = ξ×x and b⋄x = b×x (Lemma 8)."""

    def ambient(self, group: LieGroup) -> int:
        return group.matrix_size

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        return group.matrix(g) @ x

    def infinitesimal(self, group: LieGroup, xi: Array, x: Array) -> Array:
        return jnp.cross(xi, x) if isinstance(group, SO3) else group.hat(xi) @ x

    def diamond(self, group: LieGroup, b: Array, x: Array) -> Array:
        return jnp.cross(b, x) if isinstance(group, SO3) else super().diamond(group, b, x)


@dataclass(frozen=True)
class Dual(Representation):
    """(ℝᴺ)* with a ↦ g⁻ᵀa, dual to `Defining`."""

    def ambient(self, group: LieGroup) -> int:
        return group.matrix_size

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        return group.matrix(group.inverse(g)).T @ x

    def infinitesimal(self, group: LieGroup, xi: Array, x: Array) -> Array:
        return -group.hat(xi).T @ x


@dataclass(frozen=True)
class Adjoint(Representation):
    """𝔤 with Ad_g; ξ·x = ad_ξ x."""

    def ambient(self, group: LieGroup) -> int:
        return group.dim

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        return group.Ad(g, x)

    def infinitesimal(self, group: LieGroup, xi: Array, x: Array) -> Array:
        return group.ad(xi, x)


@dataclass(frozen=True)
class Coadjoint(Representation):
    """𝔤* with the left coadjoint action Ad*_{g⁻¹}; ξ·x = −ad*_ξ x."""

    def ambient(self, group: LieGroup) -> int:
        return group.dim

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        return group.Ad_dual(group.inverse(g), x)

    def infinitesimal(self, group: LieGroup, xi: Array, x: Array) -> Array:
        return -group.ad_dual(xi, x)


@dataclass(frozen=True)
class Trivial(Representation):
    """ℝⁿ on which the group does nothing: shapes, amounts, charges.

    size: n ≥ 0, an integer. Raises GroupError for other values.
    """

    size: int

    def __post_init__(self):
        object.__setattr__(self, "size", checks.whole(self.size, "Argument `size` of Trivial", 0, error=GroupError))

    def ambient(self, group: LieGroup) -> int:
        return self.size

    def require_fit(self, group: LieGroup) -> None:
        """Nothing: g·x = x is an affine action of every group."""

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        return x

    def pull(self, group: LieGroup, g: Element, x: Array, b: Array) -> Array:
        return b

    def infinitesimal(self, group: LieGroup, xi: Array, x: Array) -> Array:
        return jnp.zeros_like(x)

    def diamond(self, group: LieGroup, b: Array, x: Array) -> Array:
        return jnp.zeros(group.dim)


@dataclass(frozen=True)
class Points(Space):
    """Points of V moved by G ⋉ V: x ↦ gx + v; velocities by u ↦ gu. Under SE(n): x ↦ Rx + p."""

    def ambient(self, group: LieGroup) -> int:
        if isinstance(group, SemidirectProduct):
            return group.representation.ambient(group.group)
        if not isinstance(group, (SE2, SE3)):
            raise GroupError(
                f"Points() needs a group of rigid motions, SE2() or SE3(), or a semidirect product, but got {group!r}."
            )
        return group.matrix_size - 1

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        return self.push(group, g, x, x) + g[1]

    def push(self, group: LieGroup, g: Element, x: Array, v: Array) -> Array:
        return group.representation.act(group.group, g[0], v) if isinstance(group, SemidirectProduct) else g[0] @ v

    def infinitesimal(self, group: LieGroup, xi: Array, x: Array) -> Array:
        if isinstance(group, SemidirectProduct):
            turn, velocity = group.split(xi)
            return group.representation.infinitesimal(group.group, turn, x) + velocity
        rotation, velocity = group.tangent(xi)
        return rotation @ x + velocity
