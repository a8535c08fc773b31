"""Unit quaternions and SU(2): the group that covers SO(3) twice."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.groups.group import LieGroup
from coadjoint.groups.rotation_vector import of_quaternion
from coadjoint.groups.rotations import skew
from coadjoint.groups.small_angle import sine_ratio


@dataclass(frozen=True)
class UnitQuaternion(LieGroup):
    """Unit quaternions; an element is (w, x, y, z), scalar first; ξ = ω the body angular velocity; ad = ×.

    ξ̂ = ½(ξ₁i + ξ₂j + ξ₃k), so that q and −q turn a body by the same R(q) and R(exp ξ) = exp ξ^×. Matrices (4, 4) are
    p ↦ qp, so Defining() is ℝ⁴ = ℍ; vectors turned by R(q) are Adjoint().
    """

    @property
    def leaf_names(self) -> tuple[str, ...]:
        return ("quaternion",)

    @property
    def basis(self) -> np.ndarray:
        units = np.eye(4)[1:]
        return np.stack([0.5 * np.stack([_times(unit, e) for e in np.eye(4)], axis=1) for unit in units])

    def identity(self) -> Array:
        return jnp.eye(4)[0]

    def compose(self, g: Array, h: Array) -> Array:
        vector = g[0] * h[1:] + h[0] * g[1:] + jnp.cross(g[1:], h[1:])
        return jnp.concatenate([(g[0] * h[0] - g[1:] @ h[1:])[None], vector])

    def inverse(self, g: Array) -> Array:
        return g * np.array([1.0, -1.0, -1.0, -1.0])

    def matrix(self, g: Array) -> Array:
        return g[0] * np.eye(4) + 2 * self.hat(g[1:])

    def from_matrix(self, matrix: Array) -> Array:
        return jnp.concatenate([jnp.trace(matrix)[None] / 4, 0.5 * self.vee(matrix)])

    def tangent(self, xi: Array) -> Array:
        return jnp.concatenate([jnp.zeros(1), 0.5 * xi])

    def rotation(self, g: Array) -> Array:
        """R(q) = 1 + 2w v^× + 2(v^×)² for q = (w, v)."""
        turned = skew(g[1:])
        return jnp.eye(3) + 2 * g[0] * turned + 2 * (turned @ turned)

    def Ad(self, g: Array, xi: Array) -> Array:
        once = jnp.cross(g[1:], xi)
        return xi + 2 * g[0] * once + 2 * jnp.cross(g[1:], once)

    def Ad_dual(self, g: Array, mu: Array) -> Array:
        return self.Ad(self.inverse(g), mu)

    def ad(self, xi: Array, eta: Array) -> Array:
        return jnp.cross(xi, eta)

    def ad_dual(self, xi: Array, mu: Array) -> Array:
        return jnp.cross(mu, xi)

    def exp(self, xi: Array) -> Array:
        """(cos ½θ, ½ξ sin ½θ / ½θ), θ = |ξ|, with cos ½θ = 1 − 2 sin² ¼θ."""
        t = xi @ xi
        cosine = 1 - t / 8 * sine_ratio(t / 16) ** 2
        return jnp.concatenate([cosine[None], 0.5 * sine_ratio(t / 4) * xi])

    def _log(self, g: Array) -> Array:
        return of_quaternion(g)

    def angle_squared(self, xi: Array) -> Array:
        return xi @ xi

    def rotation_angle(self, xi: Array) -> Array:
        return jnp.sqrt(xi @ xi)

    def project(self, g: Array) -> Array:
        """½q(3 − |q|²) = q − ½q(|q|² − 1): removes round-off quadratically.

        With x = q − 1, |q|² − 1 = 2x₀ + |x|², which near the identity rounds by a share of x, not of 1.
        """
        x = g - self.identity()
        return g - 0.5 * g * (2 * x[0] + x @ x)

    def defect(self, g: Array) -> Array:
        return jnp.abs(g @ g - 1)


@dataclass(frozen=True)
class SU2(UnitQuaternion):
    """SU(2), with elements and coordinates as `UnitQuaternion`; Defining() is ℝ⁴ = ℂ².

    q stands for U = w − i(xσ₁ + yσ₂ + zσ₃), real as [[Re U, −Im U], [Im U, Re U]]; the basis is −iσ_k/2.
    """

    @property
    def basis(self) -> np.ndarray:
        sigma = np.array([[[0, 1], [1, 0]], [[0, -1j], [1j, 0]], [[1, 0], [0, -1]]])
        return np.stack([np.block([[s.imag, s.real], [-s.real, s.imag]]) / 2 for s in sigma])


def _times(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """The product of quaternions."""
    vector = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.array([p[0] * q[0] - p[1:] @ q[1:], *vector])
