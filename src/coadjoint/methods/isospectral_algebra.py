"""Momenta of U(n), SU(n) and SO(n) as matrices, and what isospectral steps do with them."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.groups import SO3, LieGroup, Opposite, SOn, SUn, Un
from coadjoint.groups.group import Array, Element
from coadjoint.groups.unitary import ComplexMatrix, product


class Algebra:
    """Momenta W and velocities of a group as matrices.

    In the bases of these groups μ and the matrix of its coordinates say the same: ad*_ξ μ are the coordinates of
    [W, ξ̂]. An unknown W̃ has coordinates of its own, `unknowns` of them.
    """

    def __init__(self, group: LieGroup):
        self.group = group

    @property
    def unknowns(self) -> int:
        """How many coordinates W̃ has."""
        return self.group.dim

    def lifted(self, mu: Array) -> Array:
        """The coordinates of W̃ = W, (unknowns,), of μ (dim,)."""
        return mu

    def momentum(self, z: Array) -> Array:
        """μ (dim,) of the coordinates of W̃, (unknowns,)."""
        return z


class Orthogonal(Algebra):
    """Of SO(n): skew matrices (n, n)."""

    def matrix(self, xi: Array) -> Array:
        """ξ̂, (n, n), of ξ (dim,)."""
        return self.group.hat(xi)

    unknown = matrix

    def moved(self, P: Array, W: Array, epsilon: Array) -> Array:
        """The coordinates (dim,) of ε[P, W] + ε² PWP = ½(V − Vᵀ), V = PW(2ε + ε²P), of P and W (n, n)."""
        return self.group.vee((P @ W) @ (2 * epsilon * np.eye(len(P)) + epsilon**2 * P))

    def forced(self, B: Array, Theta: Array, P: Array, epsilon: Array) -> Array:
        """The coordinates (dim,) of ε[B, Θ] + ε²(BΘP + PΘB), of matrices (n, n): what B does to W."""
        return self.group.vee((B @ Theta) @ (2 * epsilon * np.eye(len(P)) + 2 * epsilon**2 * P))

    def kicked(self, D: Array, b: Array, a: Array, epsilon: Array) -> Array:
        """The coordinates (dim,) of [K, Θ], K = 2ε(1 − εP)⁻¹B(1 + εP)⁻¹ with (1 − εP)⁻¹ = 1 + ½D, of b, a (dim,)."""
        R = np.eye(len(D)) + 0.5 * D
        return self.group.vee((R @ self.matrix(b) @ R.T) @ (4 * epsilon * self.matrix(a)))

    def turn(self, xi: Array, epsilon: Array) -> Array:
        """D = C − 1 = (1 − εξ̂)⁻¹ 2εξ̂, (n, n), of C = (1 − εξ̂)⁻¹(1 + εξ̂)."""
        X = epsilon * self.matrix(xi)
        return jnp.linalg.solve(np.eye(len(X)) - X, 2 * X)

    def turned(self, D: Array, mu: Array) -> Array:
        """The coordinates of CWCᵀ, (dim,), of those of W: what D adds has no part in the round-off of W."""
        return mu + self.group.vee((D @ self.matrix(mu)) @ (2 * np.eye(len(D)) + D.T))

    def element(self, D: Array) -> Element:
        """Cᵀ, (n, n), as an element of the group."""
        return np.eye(len(D)) + D.T


class Unitary(Algebra):
    """Of U(n) and SU(n): anti-Hermitian matrices (n, n) by their parts; W̃ of SU(n) is one of U(n)."""

    group: Any

    def __init__(self, group: Un | SUn):
        super().__init__(group)
        self.hull = Un(group.size)

    @property
    def unknowns(self) -> int:
        return self.hull.dim

    def lifted(self, mu: Array) -> Array:
        return mu if self.hull == self.group else self.hull.coordinates(self.group.parts(mu))

    def momentum(self, z: Array) -> Array:
        return z if self.hull == self.group else self.group.coordinates(self.hull.parts(z))

    def matrix(self, xi: Array) -> ComplexMatrix:
        """ξ̂, (n, n), of ξ (dim,)."""
        return self.group.parts(xi)

    def unknown(self, z: Array) -> ComplexMatrix:
        """W̃, (n, n), of its coordinates (unknowns,)."""
        return self.hull.parts(z)

    def moved(self, P: ComplexMatrix, W: ComplexMatrix, epsilon: Array) -> Array:
        """The coordinates (unknowns,) of ε[P, W] + ε² PWP, which is the anti-Hermitian part of PW(2ε + ε²P)."""
        one = ComplexMatrix(2 * epsilon * np.eye(self.hull.size) + epsilon**2 * P.real, epsilon**2 * P.imaginary)
        return self.hull.coordinates(product(product(P, W), one))

    def forced(self, B: ComplexMatrix, Theta: ComplexMatrix, P: ComplexMatrix, epsilon: Array) -> Array:
        """The coordinates (unknowns,) of ε[B, Θ] + ε²(BΘP + PΘB), of matrices (n, n): what B does to W."""
        real = 2 * epsilon * np.eye(self.hull.size) + 2 * epsilon**2 * P.real
        return self.hull.coordinates(product(product(B, Theta), ComplexMatrix(real, 2 * epsilon**2 * P.imaginary)))

    def kicked(self, D: ComplexMatrix, b: Array, a: Array, epsilon: Array) -> Array:
        """The coordinates (dim,) of [K, Θ], K = 2ε(1 − εP)⁻¹B(1 + εP)⁻¹ with (1 − εP)⁻¹ = 1 + ½D, of b, a (dim,)."""
        R = ComplexMatrix(np.eye(self.hull.size) + 0.5 * D.real, 0.5 * D.imaginary)
        K = product(product(R, self.matrix(b)), R.adjoint)
        return 4 * epsilon * self.group.coordinates(product(K, self.matrix(a)))

    def turn(self, xi: Array, epsilon: Array) -> ComplexMatrix:
        """D = C − 1 = (1 − εξ̂)⁻¹ 2εξ̂, (n, n), of C = (1 − εξ̂)⁻¹(1 + εξ̂)."""
        A, B = self.matrix(xi)
        X = epsilon * (A + 1j * B)
        D = jnp.linalg.solve(np.eye(self.hull.size) - X, 2 * X)
        return ComplexMatrix(D.real, D.imag)

    def turned(self, D: ComplexMatrix, mu: Array) -> Array:
        """The coordinates of CWC†, (dim,), of those of W: what D adds has no part in the round-off of W."""
        back = D.adjoint
        both = ComplexMatrix(2 * np.eye(self.hull.size) + back.real, back.imaginary)
        return mu + self.group.coordinates(product(product(D, self.matrix(mu)), both))

    def element(self, D: ComplexMatrix) -> Element:
        """C†, (n, n), as an element of the group."""
        back = D.adjoint
        return ComplexMatrix(np.eye(self.hull.size) + back.real, back.imaginary)


def algebra_of(group: LieGroup) -> Any:
    """The matrices of a group; raises ArgumentError for one that is not SO(n), U(n) or SU(n)."""
    if isinstance(group, (Un, SUn)):
        return Unitary(group)
    if isinstance(group, (SOn, SO3)):
        return Orthogonal(group)
    if isinstance(group, Opposite):
        raise ArgumentError(
            "co.IsospectralMidpoint takes left-invariant systems, but this one is right-invariant: leave out "
            'invariance="right" and give ℋ of −μ, whose motion is minus that of μ.'
        )
    raise ArgumentError(
        f"co.IsospectralMidpoint needs co.SOn, co.SO3, co.Un or co.SUn, but got {group!r}: "
        "use co.HamiltonianMidpoint()."
    )
