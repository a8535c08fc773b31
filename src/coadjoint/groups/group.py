"""The contract of a matrix Lie group, with everything that follows from its basis derived once.

An element is a PyTree of arrays (SO3: R; SE3: (R, x); products: tuples); ξ, η ∈ 𝔤 are coordinate vectors
(dim,) in a fixed basis and μ ∈ 𝔤* coordinate vectors in the dual basis, so the pairing is the dot product.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array as Array
from coadjoint.arrays import PyTree
from coadjoint.errors import GroupError, must_give
from coadjoint.groups.matrix_functions import exponential, logarithm
from coadjoint.kernels.trace.evaluate import evaluate, traced

Element = PyTree
"""A group element: a PyTree of arrays."""


def require_group(value: object, what: str) -> None:
    """Raise GroupError unless this is a group; what: the subject of the sentence."""
    checks.instance(value, what, LieGroup, "a Lie group such as co.SO3()", GroupError)


class LieGroup:
    """A matrix Lie group G with algebra 𝔤; a new group defines its elements and basis, and faster operations if it has
    any.

    To be given: `basis`, `identity`, `compose`, `inverse`, `matrix`, `from_matrix`, `tangent`. Groups are static,
    hashable objects that compare by value.
    """

    @property
    def basis(self) -> np.ndarray:
        """The basis of 𝔤 as matrices, shape (dim, N, N)."""
        must_give(self, "basis")

    @property
    def dim(self) -> int:
        """dim 𝔤."""
        return self.basis.shape[0]

    @property
    def matrix_size(self) -> int:
        """N, the size of the matrices."""
        return self.basis.shape[-1]

    @property
    def leaf_names(self) -> tuple[str, ...]:
        """The names of the arrays of an element in a dataset."""
        return ("g",)

    def basis_sizes(self) -> np.ndarray:
        """The largest entry of every matrix of the basis, (dim,): the units in which coordinates are integers."""
        return np.max(np.abs(self.basis), axis=(1, 2), initial=0.0)

    def identity(self) -> Element:
        """e."""
        must_give(self, "identity")

    def compose(self, g: Element, h: Element) -> Element:
        """gh, of two elements."""
        must_give(self, "compose")

    def inverse(self, g: Element) -> Element:
        """g⁻¹."""
        must_give(self, "inverse")

    def matrix(self, g: Element) -> Array:
        """g as a matrix (N, N)."""
        must_give(self, "matrix")

    def from_matrix(self, matrix: Array) -> Element:
        """The element whose matrix this is, (N, N)."""
        must_give(self, "from_matrix")

    def tangent(self, xi: Array) -> Element:
        """ξ (dim,) as a tangent vector at e: a PyTree like an element, the derivative of any curve e + εξ + O(ε²)."""
        must_give(self, "tangent")

    def view(self, xi: Array) -> Array:
        """ξ or μ (dim,) as the user's functions see it: unchanged, but by links on `co.Power`."""
        return xi

    def hat(self, xi: Array) -> Array:
        """ξ̂ = Σ ξ_k e_k ∈ 𝔤, the matrix (N, N) of coordinates ξ (dim,)."""
        return jnp.tensordot(xi, self.basis, axes=1)

    def vee(self, matrix: Array) -> Array:
        """The coordinates (dim,) of a matrix ξ̂ (N, N); of one outside 𝔤, those of its orthogonal projection."""
        return jnp.asarray(_projection(self)) @ jnp.reshape(matrix, -1)

    def Ad(self, g: Element, xi: Array) -> Array:
        """Ad_g ξ = (g ξ̂ g⁻¹)ᵛ, (dim,), of ξ (dim,)."""
        return self.vee(self.matrix(g) @ self.hat(xi) @ self.matrix(self.inverse(g)))

    def Ad_dual(self, g: Element, mu: Array) -> Array:
        """Ad*_g μ, (dim,), of μ (dim,): ⟨Ad*_g μ, ξ⟩ = ⟨μ, Ad_g ξ⟩, so that Ad*_{gh} = Ad*_h Ad*_g."""
        return transpose(lambda xi: self.Ad(g, xi), self.dim, mu)

    def ad(self, xi: Array, eta: Array) -> Array:
        """ad_ξ η = [ξ, η], (dim,), of ξ and η (dim,)."""
        return jnp.einsum("kij,i,j->k", _structure_constants(self), xi, eta)

    def ad_dual(self, xi: Array, mu: Array) -> Array:
        """ad*_ξ μ, (dim,), of ξ and μ (dim,): ⟨ad*_ξ μ, η⟩ = ⟨μ, ad_ξ η⟩ (P5)."""
        return jnp.einsum("kij,i,k->j", _structure_constants(self), xi, mu)

    def exp(self, xi: Array) -> Element:
        """e^ξ̂ of ξ (dim,), an element; NaN where |ξ̂| is over 19, the reach of `matrix_exponential`."""
        return self.from_matrix(exponential(self.hat(xi)))

    def log(self, g: Element) -> Array:
        """ξ (dim,) with exp(ξ) = g, of an element g: the inverse of `exp` near e, on its principal branch.

        Rotations have |ω| ≤ π. At half a turn, where ω and −ω agree, the component of ω that is largest in size is
        positive, the first among equals. −1 of the unit quaternions has ξ = (2π, 0, 0). Groups without a closed form
        take the principal logarithm of the matrix, whose eigenvalues have imaginary parts in (−π, π).

        Of numbers it returns NumPy's float64, and raises GroupError where g is not on the group or has no such
        logarithm in 𝔤. Under jit, vmap and grad it is NaN there.
        """
        if traced(g):
            return self._log(g)
        xi = evaluate(self._log, g)
        require_solution(self, "exp", xi, self.exp, g)
        return xi

    def _log(self, g: Element) -> Array:
        """The logarithm of the matrix; groups with a closed form override it."""
        return self.vee(logarithm(self.matrix(g), orthogonal=_is_orthogonal(self)))

    def angle_squared(self, xi: Array) -> Array | None:
        """θ², one number, where ad_ξ has no eigenvalues but 0 and ±iθ, in Jordan blocks of size ≤ 2; else None.

        xi: ξ (dim,). With θ², functions of ad_ξ have closed forms.
        """
        return None

    def rotation_angle(self, xi: Array) -> Array | float:
        """The angle by which exp(ξ) rotates, one number in rad, for ξ (dim,): it limits the charts of difference maps.

        0 where nothing rotates.
        """
        return 0.0

    @property
    def constrained(self) -> bool:
        """Whether the group knows its defining equations, so that `project` and `defect` exist."""
        return True

    def project(self, g: Element) -> Element:
        """g moved onto G by a step that removes round-off quadratically. Raises GroupError without a constraint."""
        raise GroupError(f"{self!r} has no projection, because it was given no constraint.")

    def defect(self, g: Element) -> Array:
        """How far g is from G, one number: the largest entry of its defining equations, zero on G.

        Raises GroupError where the group was given no constraint.
        """
        raise GroupError(f"{self!r} has no defect, because it was given no constraint.")

    def outside(self, g: Element) -> Array:
        """How far g is from G, one number, zero on G alone.

        It adds to the defect what no smooth equation sees, such as reflections. Zero where G was given no constraint.
        """
        return self.defect(g) if self.constrained else jnp.zeros(())

    def rotation(self, g: Element) -> Array | None:
        """The attitude R (3, 3) within an element, where the group has one; for output and plots."""
        return None


_ON_GROUP = 1e-6
"""The largest distance of an element from the group and from the element of its coordinates, for drift and single
precision."""


def require_solution(group: LieGroup, name: str, xi: Array, map_: Callable[[Array], Element], g: Element) -> None:
    """Raise GroupError unless `map_`, called `name`, takes ξ (dim,) to the element g, to 1e-6 of its largest entry."""

    def misfit(xi: Array, g: Element) -> tuple[Array, Array]:
        found, given = group.matrix(map_(xi)), group.matrix(g)
        return jnp.max(jnp.abs(found - given), initial=0.0), jnp.max(jnp.abs(given), initial=1.0)

    off, size = map(float, evaluate(misfit, xi, g))
    if off <= _ON_GROUP * size:
        return
    outside = float(evaluate(group.outside, g))
    if not outside <= _ON_GROUP * size:
        raise GroupError(
            f"The argument must be an element of {group!r}, but is off it by {outside:.1e}: take `group.project` of it."
        )
    raise GroupError(
        f"The element of {group!r} is outside the image of {name} on its principal branch: {name}(ξ) = g has no "
        "solution ξ there; take an element nearer to the identity."
    )


def transpose(linear: Callable[[Array], Array], size: int, covector: Array) -> Array:
    """The dual of a linear map of ℝ^size, applied to a covector, an array like the map's result. Returns (size,)."""
    _, pull = jax.vjp(linear, jnp.zeros(size))
    return pull(covector)[0]


def _tidy(array: np.ndarray) -> np.ndarray:
    """The array without round-off next to multiples of ½, so that zeros are recognised as structure."""
    nearest = np.round(2 * array) / 2
    return np.where(np.abs(array - nearest) < 1e-13, nearest, array)


@lru_cache(maxsize=256)
def _projection(group: LieGroup) -> np.ndarray:
    """The matrix (dim, N²) that takes the entries of ξ̂ to its coordinates."""
    sizes = group.basis_sizes()[:, None]
    return _tidy(np.linalg.pinv((group.basis / sizes[..., None]).reshape(group.dim, -1).T)) / sizes


@lru_cache(maxsize=256)
def _is_orthogonal(group: LieGroup) -> bool:
    """Whether all elements are orthogonal matrices, those of the basis skew."""
    return bool(np.all(group.basis == -np.swapaxes(group.basis, 1, 2)))


@lru_cache(maxsize=256)
def _structure_constants(group: LieGroup) -> np.ndarray:
    """c[k, i, j] with [e_i, e_j] = Σ_k c[k, i, j] e_k."""
    products = np.einsum("iab,jbc->ijac", group.basis, group.basis)
    brackets = (products - products.transpose(1, 0, 2, 3)).reshape(group.dim**2, -1)
    found = (_projection(group) @ brackets.T).reshape(group.dim, group.dim, group.dim)
    sizes = group.basis_sizes()
    units = sizes[:, None] * sizes / sizes[:, None, None]
    return _tidy(found / units) * units
