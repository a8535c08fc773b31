"""Momenta of U(n), SU(n) and SO(n) as matrices, and the operations of isospectral steps on them."""

from __future__ import annotations

import abc
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.groups import SO3, DirectProduct, LieGroup, Opposite, Power, SOn, SUn, Un
from coadjoint.groups.group import Element
from coadjoint.groups.unitary import ComplexMatrix, product
from coadjoint.methods import isospectral_products


class Algebra(abc.ABC):
    """Momenta W and velocities of a group as n × n matrices.

    In the bases of these groups μ and the matrix W of its coordinates are equivalent: ad*_ξ μ are the coordinates of
    [W, ξ̂]. An unknown W̃ has separate coordinates; their number is `unknowns`. Matrices of copies have a leading axis.
    """

    group: LieGroup
    copies = 1
    """The number of copies of one group."""

    @property
    @abc.abstractmethod
    def unknowns(self) -> int:
        """The number of coordinates of W̃."""

    @abc.abstractmethod
    def lifted(self, mu: Array) -> Array:
        """The coordinates of W̃ = W, (unknowns,), of μ (dim,)."""

    @abc.abstractmethod
    def momentum(self, z: Array) -> Array:
        """μ (dim,) of the coordinates of W̃, (unknowns,)."""

    @abc.abstractmethod
    def matrix(self, xi: Array) -> PyTree:
        """ξ̂, (n, n), of ξ (dim,)."""

    @abc.abstractmethod
    def unknown(self, z: Array) -> PyTree:
        """W̃, (n, n), of its coordinates (unknowns,)."""

    @abc.abstractmethod
    def products(self, P: PyTree, W: PyTree) -> tuple[Array, Array]:
        """The coordinates (unknowns,) of [P, W] and of PWP, of P and W (n, n)."""

    def products_of(self, eta: Array, z: Array) -> tuple[Array, Array]:
        """`products` of P = η̂ and the W̃ of coordinates z (unknowns,), in the precision of z; η (dim,)."""
        matrices = self.matrix(eta), self.unknown(z)
        return self.products(*jax.tree.map(lambda entries: entries.astype(z.dtype), matrices))

    @abc.abstractmethod
    def products_of_force(self, B: PyTree, Theta: PyTree, P: PyTree) -> tuple[Array, Array]:
        """The coordinates (unknowns,) of [B, Θ] and of BΘP + PΘB, of matrices (n, n): the action of B on W."""

    @abc.abstractmethod
    def turn(self, xi: Array, epsilon: Scalar) -> PyTree:
        """D = C − 1 = (1 − εξ̂)⁻¹ 2εξ̂, (n, n), of C = (1 − εξ̂)⁻¹(1 + εξ̂) and ξ (dim,)."""

    @abc.abstractmethod
    def element(self, D: PyTree) -> Element:
        """C†, (n, n), as an element of the group."""


class Orthogonal(Algebra):
    """Of SO(n): skew matrices (n, n)."""

    group: Any

    def __init__(self, group: SOn | SO3):
        self.group = group

    @property
    def unknowns(self) -> int:
        return self.group.dim

    def lifted(self, mu: Array) -> Array:
        return mu

    def momentum(self, z: Array) -> Array:
        return z

    def matrix(self, xi: Array) -> PyTree:
        return self.group.hat(xi)

    def unknown(self, z: Array) -> PyTree:
        return self.group.hat(z)

    def products(self, P: PyTree, W: PyTree) -> tuple[Array, Array]:
        """Of [P, W] = PW − (PW)ᵀ, and of PWP, which is skew."""
        Z = P @ W
        return 2 * self.group.vee(Z), self.group.vee(Z @ P)

    def products_of_force(self, B: PyTree, Theta: PyTree, P: PyTree) -> tuple[Array, Array]:
        Z = B @ Theta
        return 2 * self.group.vee(Z), 2 * self.group.vee(Z @ P)

    def turn(self, xi: Array, epsilon: Scalar) -> PyTree:
        X = epsilon * self.matrix(xi)
        return jnp.linalg.solve(np.eye(len(X)) - X, 2 * X)

    def element(self, D: PyTree) -> Element:
        return np.eye(len(D)) + D.T


class Unitary(Algebra):
    """Of U(n) and SU(n): anti-Hermitian matrices (n, n) by their parts; W̃ of SU(n) is one of U(n)."""

    group: Any

    def __init__(self, group: Un | SUn):
        self.group, self.hull = group, Un(group.size)

    @property
    def unknowns(self) -> int:
        return self.hull.dim

    def lifted(self, mu: Array) -> Array:
        return mu if self.hull == self.group else self.hull.coordinates(self.group.parts(mu))

    def momentum(self, z: Array) -> Array:
        return z if self.hull == self.group else self.group.coordinates(self.hull.parts(z))

    def matrix(self, xi: Array) -> ComplexMatrix:
        return self.group.parts(xi)

    def unknown(self, z: Array) -> ComplexMatrix:
        return self.hull.parts(z)

    def products(self, P: ComplexMatrix, W: ComplexMatrix) -> tuple[Array, Array]:
        return isospectral_products.plain(P, W, self.hull)

    def products_of(self, eta: Array, z: Array) -> tuple[Array, Array]:
        native = self.hull == self.group and self.hull.size >= isospectral_products.LEAST
        return isospectral_products.products(eta, z) if native else super().products_of(eta, z)

    def products_of_force(self, B: ComplexMatrix, Theta: ComplexMatrix, P: ComplexMatrix) -> tuple[Array, Array]:
        Z = product(B, Theta)
        return 2 * self.hull.coordinates(Z), 2 * self.hull.coordinates(product(Z, P))

    def turn(self, xi: Array, epsilon: Scalar) -> ComplexMatrix:
        A, B = self.matrix(xi)
        X = epsilon * (A + 1j * B)
        D = jnp.linalg.solve(np.eye(self.hull.size) - X, 2 * X)
        return ComplexMatrix(D.real, D.imag)

    def element(self, D: ComplexMatrix) -> Element:
        back = D.adjoint
        return ComplexMatrix(np.eye(self.hull.size) + back.real, back.imaginary)


class Copies(Algebra):
    """Of Gᴺ, as co.Power(G, N) or as a product of N equal factors: the matrices of each, with a leading axis."""

    def __init__(self, group: Power | DirectProduct, factor: LieGroup, count: int):
        self.group, self.inner, self.copies = group, algebra_of(factor), count

    @property
    def unknowns(self) -> int:
        return self.copies * self.inner.unknowns

    def _rows(self, x: Array) -> Array:
        return jnp.reshape(x, (self.copies, -1))

    def _each(self, function: Callable[..., object], *arguments: object) -> PyTree:
        """The results of a function for each copy, coordinates or a pair of them, concatenated."""
        return jax.tree.map(lambda found: jnp.reshape(found, -1), jax.vmap(function)(*arguments))

    def lifted(self, mu: Array) -> Array:
        return self._each(self.inner.lifted, self._rows(mu))

    def momentum(self, z: Array) -> Array:
        return self._each(self.inner.momentum, self._rows(z))

    def matrix(self, xi: Array) -> PyTree:
        return jax.vmap(self.inner.matrix)(self._rows(xi))

    def unknown(self, z: Array) -> PyTree:
        return jax.vmap(self.inner.unknown)(self._rows(z))

    def products(self, P: PyTree, W: PyTree) -> tuple[Array, Array]:
        return self._each(self.inner.products, P, W)

    def products_of(self, eta: Array, z: Array) -> tuple[Array, Array]:
        return self._each(self.inner.products_of, self._rows(eta), self._rows(z))

    def products_of_force(self, B: PyTree, Theta: PyTree, P: PyTree) -> tuple[Array, Array]:
        return self._each(self.inner.products_of_force, B, Theta, P)

    def turn(self, xi: Array, epsilon: Scalar) -> PyTree:
        return jax.vmap(lambda xi: self.inner.turn(xi, epsilon))(self._rows(xi))

    def element(self, D: PyTree) -> Element:
        found = jax.vmap(self.inner.element)(D)
        if isinstance(self.group, Power):
            return found
        return tuple(jax.tree.map(lambda leaf, k=k: leaf[k], found) for k in range(self.copies))


class Reversed(Algebra):
    """Of Gᵒᵖ, right-invariant systems: Ẇ = −[P, W] − [B, Θ], Θ̇ = −[P, Θ] and g_{k+1} = Cg_k, all by −P and −B."""

    def __init__(self, group: Opposite):
        self.group, self.inner = group.group, algebra_of(group.group)
        self.copies = self.inner.copies

    @property
    def unknowns(self) -> int:
        return self.inner.unknowns

    def lifted(self, mu: Array) -> Array:
        return self.inner.lifted(mu)

    def momentum(self, z: Array) -> Array:
        return self.inner.momentum(z)

    def matrix(self, xi: Array) -> PyTree:
        return self.inner.matrix(-xi)

    def unknown(self, z: Array) -> PyTree:
        return self.inner.unknown(z)

    def products(self, P: PyTree, W: PyTree) -> tuple[Array, Array]:
        return self.inner.products(P, W)

    def products_of(self, eta: Array, z: Array) -> tuple[Array, Array]:
        return self.inner.products_of(-eta, z)

    def products_of_force(self, B: PyTree, Theta: PyTree, P: PyTree) -> tuple[Array, Array]:
        return self.inner.products_of_force(B, Theta, P)

    def turn(self, xi: Array, epsilon: Scalar) -> PyTree:
        return self.inner.turn(-xi, epsilon)

    def element(self, D: PyTree) -> Element:
        return self.group.inverse(self.inner.element(D))


def algebra_of(group: LieGroup) -> Algebra:
    """The matrices of a group; raises ArgumentError for one but SO(n), U(n), SU(n) and copies of one."""
    if isinstance(group, (Un, SUn)):
        return Unitary(group)
    if isinstance(group, (SOn, SO3)):
        return Orthogonal(group)
    if isinstance(group, Opposite):
        return Reversed(group)
    if isinstance(group, Power):
        return Copies(group, group.factor, group.count)
    if isinstance(group, DirectProduct) and len(set(group.factors)) == 1:
        return Copies(group, group.factors[0], len(group.factors))
    raise ArgumentError(
        f"co.IsospectralMidpoint needs co.SOn, co.SO3, co.Un or co.SUn, or copies of one, but got {group!r}: "
        "use co.HamiltonianMidpoint()."
    )
