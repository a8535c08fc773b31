"""The rotations SO(2) and SO(3)."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.groups.matrix_elements import MatrixElements
from coadjoint.groups.rotation_vector import of_quaternion, quaternion
from coadjoint.groups.small_angle import sine_ratio, versine_ratio


def skew(omega: Array) -> Array:
    """ω ↦ ω^× (3, 3), with ω^× v = ω × v (P56)."""
    x, y, z = omega[0], omega[1], omega[2]
    zero = jnp.zeros_like(x)
    return jnp.stack([jnp.stack([zero, -z, y]), jnp.stack([z, zero, -x]), jnp.stack([-y, x, zero])])


def turn(theta: Array) -> Array:
    """The plane rotation by θ, (2, 2)."""
    c, s = jnp.cos(theta), jnp.sin(theta)
    return jnp.stack([jnp.stack([c, -s]), jnp.stack([s, c])])


def plane_angle(R: Array) -> Array:
    """The angle in (−π, π] of a plane rotation R (2, 2)."""
    return jnp.arctan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])


def orthogonal_defect(R: Array) -> Array:
    """max |RᵀR − I|, one number, of R (n, n)."""
    return jnp.max(jnp.abs(R.T @ R - jnp.eye(R.shape[0])))


def orthogonal_projection(R: Array) -> Array:
    """One step of Newton's iteration for the polar factor, R − ½R(RᵀR − I), (n, n): removes round-off quadratically.

    With X = R − I, RᵀR − I = X + Xᵀ + XᵀX. Near the identity that rounds by a share of X; RᵀR rounds by a share of 1,
    finer below 1 than above, and its rounding errors accumulate over many steps.
    """
    X = R - jnp.eye(R.shape[0])
    return R - 0.5 * R @ (X + X.T + X.T @ X)


def reflection(R: Array) -> Array:
    """|det R − 1| of a matrix (2, 2) or (3, 3): 0 for a rotation, 2 for a reflection."""
    if R.shape[0] == 2:
        return jnp.abs(R[0, 0] * R[1, 1] - R[0, 1] * R[1, 0] - 1)
    return jnp.abs(R[0] @ jnp.cross(R[1], R[2]) - 1)


class _Rotations(MatrixElements):
    """What SO(2) and SO(3) share: an element is the matrix R itself."""

    @property
    def leaf_names(self) -> tuple[str, ...]:
        return ("R",)

    def inverse(self, g: Array) -> Array:
        return g.T

    def project(self, g: Array) -> Array:
        return orthogonal_projection(g)

    def defect(self, g: Array) -> Array:
        return orthogonal_defect(g)

    def outside(self, g: Array) -> Array:
        return jnp.maximum(self.defect(g), reflection(g))


@dataclass(frozen=True)
class SO2(_Rotations):
    """Rotations of the plane; an element is R (2, 2), ξ = (θ̇,); abelian."""

    @property
    def basis(self) -> np.ndarray:
        return np.array([[[0.0, -1.0], [1.0, 0.0]]])

    def vee(self, matrix: Array) -> Array:
        return jnp.stack([0.5 * (matrix[1, 0] - matrix[0, 1])])

    def Ad(self, g: Array, xi: Array) -> Array:
        return xi

    def Ad_dual(self, g: Array, mu: Array) -> Array:
        return mu

    def ad(self, xi: Array, eta: Array) -> Array:
        return jnp.zeros_like(xi)

    def ad_dual(self, xi: Array, mu: Array) -> Array:
        return jnp.zeros_like(mu)

    def exp(self, xi: Array) -> Array:
        return turn(xi[0])

    def _log(self, g: Array) -> Array:
        return plane_angle(g)[None]

    def angle_squared(self, xi: Array) -> Array:
        return jnp.zeros(())

    def rotation_angle(self, xi: Array) -> Array:
        return jnp.abs(xi[0])


@dataclass(frozen=True)
class SO3(_Rotations):
    """Rotations of space; an element is R (3, 3), body to space; ξ = ω the body angular velocity; ad = × (P53–P56)."""

    @property
    def basis(self) -> np.ndarray:
        basis = np.zeros((3, 3, 3))
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            basis[i, k, j], basis[i, j, k] = 1.0, -1.0
        return basis

    def hat(self, xi: Array) -> Array:
        return skew(xi)

    def vee(self, matrix: Array) -> Array:
        m = matrix
        return 0.5 * jnp.stack([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])

    def Ad(self, g: Array, xi: Array) -> Array:
        return g @ xi

    def Ad_dual(self, g: Array, mu: Array) -> Array:
        return g.T @ mu

    def ad(self, xi: Array, eta: Array) -> Array:
        return jnp.cross(xi, eta)

    def ad_dual(self, xi: Array, mu: Array) -> Array:
        return jnp.cross(mu, xi)

    def exp(self, xi: Array) -> Array:
        """Rodrigues' formula (P91)."""
        t, omega = xi @ xi, skew(xi)
        return jnp.eye(3) + sine_ratio(t) * omega + versine_ratio(t) * (omega @ omega)

    def _log(self, g: Array) -> Array:
        return of_quaternion(quaternion(g))

    def angle_squared(self, xi: Array) -> Array:
        return xi @ xi

    def rotation_angle(self, xi: Array) -> Array:
        return jnp.sqrt(xi @ xi)

    def rotation(self, g: Array) -> Array:
        return g
