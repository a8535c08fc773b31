"""A group as a curved space on which it acts itself, or on which another one does nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.errors import ArgumentError, GroupError
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element
from coadjoint.groups.matrix_functions import exponential_minus_one
from coadjoint.kernels.packing import flattened
from coadjoint.kernels.trace.evaluate import evaluate, traced
from coadjoint.spaces.space import Embedded, checked_vector

ON_GROUP = 1e-9
"""How far outside its group a point may be by round-off."""


@dataclass(frozen=True)
class GroupItself(Embedded):
    """Q = G, on which G acts by multiplication or by conjugation, or a group Q of shapes, on which G does nothing.

    action: "multiplication" (the default), g·x = gx, "conjugation", g·x = gxg⁻¹, or "trivial", g·x = x.
    of: with the trivial action, the group Q, by default G.
    The user's functions see an element x, and a velocity of the same structure: xη̂ for the body velocity η of x. So
    on SO(3) ℓ(ξ, n, ν) gets matrices n and ν = nη̂, and on SE(3) pairs, n = (R, x) and ν = (Rω̂, Rv) for η = (ω, v).
    Ambient coordinates are the numbers of an element; ρ(x, xη̂) = x exp η, and the frame is that of xê_i made
    orthonormal. Raises ArgumentError for another action, GroupError for a group whose product is not affine in the
    second factor.
    """

    action: Literal["multiplication", "conjugation", "trivial"] = "multiplication"
    of: LieGroup | None = None

    def __post_init__(self):
        checks.choice(self.action, "action", ("multiplication", "conjugation", "trivial"))
        if self.of is not None:
            checks.instance(self.of, "of", LieGroup, "a Lie group such as co.SO3()", error=GroupError)
            checks.expect(
                self.action == "trivial", self.action, "action", '"trivial" for a space that is another group'
            )

    def _own(self, group: LieGroup) -> LieGroup:
        """The group that the space is."""
        return group if self.of is None else self.of

    def ambient(self, group: LieGroup) -> int:
        return sum(int(np.prod(leaf.shape)) for leaf in jax.tree.leaves(jax.eval_shape(self._own(group).identity)))

    def dim(self, group: LieGroup) -> int:
        return self._own(group).dim

    def sample(self, group: LieGroup, random: np.random.Generator) -> np.ndarray:
        """A random element near e, (ambient,)."""
        own = self._own(group)
        return np.asarray(evaluate(lambda xi: flattened(own.exp(xi)), random.normal(scale=0.5, size=own.dim)))

    def view(self, group: LieGroup, x: Array) -> Element:
        leaves, structure = jax.tree.flatten(jax.eval_shape(self._own(group).identity))
        ends = np.cumsum([0, *(int(np.prod(leaf.shape)) for leaf in leaves)])
        parts = [jnp.reshape(x[a:b], s.shape) for a, b, s in zip(ends[:-1], ends[1:], leaves, strict=True)]
        return jax.tree.unflatten(structure, parts)

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        if self.action == "trivial":
            return x
        moved = group.compose(g, self.view(group, x))
        return flattened(moved if self.action == "multiplication" else group.compose(moved, group.inverse(g)))

    def _spanning(self, group: LieGroup, x: Array) -> Array:
        """The columns xê_i, (ambient, dim): tangent vectors at x."""
        own, at = self._own(group), self.view(group, x)
        one = own.identity()
        along = jax.vmap(lambda e: jax.jvp(lambda h: flattened(own.compose(at, h)), (one,), (own.tangent(e),))[1])
        return along(jnp.eye(own.dim)).T

    def body_velocity(self, group: LieGroup, x: Array, v: Array) -> Array:
        """η with v = xη̂, (dim,)."""
        B = self._spanning(group, x)
        return jnp.linalg.solve(B.T @ B, B.T @ v)

    def frame(self, group: LieGroup, x: Array) -> Array:
        """E = BL⁻ᵀ with BᵀB = LLᵀ for the columns B = (xê_i)."""
        B = self._spanning(group, x)
        return jax.scipy.linalg.solve_triangular(jnp.linalg.cholesky(B.T @ B), B.T, lower=True).T

    def difference(self, group: LieGroup, x: Array, u: Array) -> Array:
        """x(exp η − 1) for u = xη̂."""
        own, at = self._own(group), self.view(group, x)
        less = exponential_minus_one(own.hat(self.body_velocity(group, x, u)))
        return jax.jvp(lambda h: flattened(own.compose(at, h)), (own.identity(),), (own.from_matrix(less),))[1]

    def project(self, group: LieGroup, x: Array, b: Array) -> Array:
        frame = self.frame(group, x)
        return frame @ (frame.T @ b)

    def defect(self, group: LieGroup, x: Array) -> Array | float:
        own = self._own(group)
        return own.defect(self.view(group, x)) if own.constrained else 0.0

    def point(self, group: LieGroup, value: object, name: str) -> Array:
        array = self.velocity(group, value, name)
        if isinstance(array, np.ndarray):
            own = self._own(group)
            off = float(evaluate(lambda x: own.outside(self.view(group, x)), array))
            if not off <= ON_GROUP:
                raise ArgumentError(f"Argument `{name}` must be an element of {own!r}, but is outside by {off:.3g}.")
        return array

    def velocity(self, group: LieGroup, value: object, name: str) -> Array:
        """Numbers in the structure of an element, or end to end."""
        leaves, size = [np.ravel(leaf) for leaf in jax.tree.leaves(value)], self.ambient(group)
        if not leaves or traced(value):
            return checked_vector(value, size, name)
        numbers = np.concatenate(leaves)
        if numbers.dtype.kind in "fiub" and len(numbers) != size:
            own = self._own(group)
            shapes = ", ".join(str(leaf.shape) for leaf in jax.tree.leaves(jax.eval_shape(own.identity)))
            raise ArgumentError(
                f"Argument `{name}` must have the structure of an element of {own!r}, arrays of shape {shapes}, but "
                f"holds {len(numbers)} numbers."
            )
        return checked_vector(numbers, size, name)
