"""The rigid motions SE(2) and SE(3)."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.groups.group import Element, LieGroup
from coadjoint.groups.rotations import (
    SO3,
    orthogonal_defect,
    orthogonal_projection,
    plane_angle,
    reflection,
    skew,
    turn,
)
from coadjoint.groups.small_angle import cotangent_ratio, cubic_ratio, sine_ratio, versine_ratio

_QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])


class _RigidMotions(LieGroup):
    """What SE(2) and SE(3) share: an element is (R, x), acting by v ↦ Rv + x."""

    @property
    def leaf_names(self) -> tuple[str, ...]:
        return ("R", "x")

    def compose(self, g: Element, h: Element) -> Element:
        return g[0] @ h[0], g[0] @ h[1] + g[1]

    def inverse(self, g: Element) -> Element:
        return g[0].T, -g[0].T @ g[1]

    def matrix(self, g: Element) -> Array:
        size = g[1].shape[0]
        top = jnp.concatenate([g[0], g[1][:, None]], axis=1)
        return jnp.concatenate([top, jnp.eye(size + 1)[-1:]], axis=0)

    def from_matrix(self, matrix: Array) -> Element:
        return matrix[:-1, :-1], matrix[:-1, -1]

    def project(self, g: Element) -> Element:
        return orthogonal_projection(g[0]), g[1]

    def defect(self, g: Element) -> Array:
        return orthogonal_defect(g[0])

    def outside(self, g: Element) -> Array:
        return jnp.maximum(self.defect(g), reflection(g[0]))


@dataclass(frozen=True)
class SE2(_RigidMotions):
    """Rigid motions of the plane; an element is (R, x), ξ = (θ̇, v_x, v_y) in the body frame."""

    @property
    def basis(self) -> np.ndarray:
        basis = np.zeros((3, 3, 3))
        basis[0, :2, :2] = _QUARTER
        basis[1, 0, 2] = basis[2, 1, 2] = 1.0
        return basis

    def identity(self) -> Element:
        return jnp.eye(2), jnp.zeros(2)

    def tangent(self, xi: Array) -> Element:
        return xi[0] * _QUARTER, xi[1:]

    def Ad(self, g: Element, xi: Array) -> Array:
        return jnp.concatenate([xi[:1], g[0] @ xi[1:] - xi[0] * (_QUARTER @ g[1])])

    def ad(self, xi: Array, eta: Array) -> Array:
        return jnp.concatenate([jnp.zeros(1), _QUARTER @ (xi[0] * eta[1:] - eta[0] * xi[1:])])

    def exp(self, xi: Array) -> Element:
        t = xi[0] * xi[0]
        side = xi[0] * versine_ratio(t) * (_QUARTER @ xi[1:])
        return turn(xi[0]), sine_ratio(t) * xi[1:] + side

    def _log(self, g: Element) -> Array:
        """(θ, ½θ cot(½θ) x − ½θ Jx) with J the quarter turn."""
        theta = plane_angle(g[0])
        along = (1 - theta * theta * cotangent_ratio(theta * theta)) * g[1]
        return jnp.concatenate([theta[None], along - 0.5 * theta * (_QUARTER @ g[1])])

    def angle_squared(self, xi: Array) -> Array:
        return xi[0] * xi[0]

    def rotation_angle(self, xi: Array) -> Array:
        return jnp.abs(xi[0])


@dataclass(frozen=True)
class SE3(_RigidMotions):
    """Rigid motions of space; an element is (R, x), ξ = (ω, v) in the body frame, ξ̂ = [[ω^×, v], [0, 0]]."""

    @property
    def basis(self) -> np.ndarray:
        basis = np.zeros((6, 4, 4))
        basis[:3, :3, :3] = SO3().basis
        basis[np.arange(3, 6), np.arange(3), 3] = 1.0
        return basis

    def identity(self) -> Element:
        return jnp.eye(3), jnp.zeros(3)

    def tangent(self, xi: Array) -> Element:
        return skew(xi[:3]), xi[3:]

    def Ad(self, g: Element, xi: Array) -> Array:
        omega, v = jnp.reshape(xi, (2, 3)) @ g[0].T
        return jnp.concatenate([omega, v + jnp.cross(g[1], omega)])

    def Ad_dual(self, g: Element, mu: Array) -> Array:
        moved = mu[:3] + jnp.cross(mu[3:], g[1])
        return jnp.reshape(jnp.stack([moved, mu[3:]]) @ g[0], -1)

    def ad(self, xi: Array, eta: Array) -> Array:
        linear = jnp.cross(xi[:3], eta[3:]) + jnp.cross(xi[3:], eta[:3])
        return jnp.concatenate([jnp.cross(xi[:3], eta[:3]), linear])

    def ad_dual(self, xi: Array, mu: Array) -> Array:
        angular = jnp.cross(mu[:3], xi[:3]) + jnp.cross(mu[3:], xi[3:])
        return jnp.concatenate([angular, jnp.cross(mu[3:], xi[:3])])

    def exp(self, xi: Array) -> Element:
        t, omega, v = xi[:3] @ xi[:3], xi[:3], xi[3:]
        turned = jnp.cross(omega, v)
        x = v + versine_ratio(t) * turned + cubic_ratio(t) * jnp.cross(omega, turned)
        return SO3().exp(omega), x

    def _log(self, g: Element) -> Array:
        """(ω, x − ½ ω×x + β ω×(ω×x)) with β = (1 − ½θ cot(½θ))/θ²."""
        omega = SO3().log(g[0])
        turned = jnp.cross(omega, g[1])
        v = g[1] - 0.5 * turned + cotangent_ratio(omega @ omega) * jnp.cross(omega, turned)
        return jnp.concatenate([omega, v])

    def angle_squared(self, xi: Array) -> Array:
        return xi[:3] @ xi[:3]

    def rotation_angle(self, xi: Array) -> Array:
        return jnp.sqrt(xi[:3] @ xi[:3])

    def rotation(self, g: Element) -> Array:
        return g[0]
