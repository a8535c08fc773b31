"""Spheres: curved additional dynamics or advected directions."""

from __future__ import annotations

from dataclasses import dataclass, field

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array
from coadjoint.errors import ArgumentError, GroupError, shown
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces.representations import Defining, Representation
from coadjoint.spaces.space import Embedded, checked_vector, random_motion


@dataclass(frozen=True)
class Sphere(Embedded, Representation):
    """The unit sphere |x| = 1 inside a representation by orthogonal matrices.

    inside: the representation, by default co.Defining().
    ρ(x, u) = (x + u)/r with r = √(1 + |u|²), and ρ(x, u) − x = (u − |u|² x/(1 + r))/r without cancellation.
    Raises ArgumentError unless `representation` is one; a system raises GroupError where the group acts by matrices
    that are not orthogonal.
    """

    inside: Representation = field(default_factory=Defining)

    def __post_init__(self):
        fits = isinstance(self.inside, Representation) and self.inside.flat
        checks.expect(fits, self.inside, "The space of Sphere", "a representation such as co.Defining()")

    def ambient(self, group: LieGroup) -> int:
        return self.inside.ambient(group)

    def dim(self, group: LieGroup) -> int:
        return self.ambient(group) - 1

    def require_fit(self, group: LieGroup) -> None:
        """Raise GroupError unless the group acts by orthogonal matrices, so that the sphere stays the sphere."""
        self.inside.require_fit(group)
        g, x, _ = random_motion(self, group)
        moved = np.asarray(evaluate(lambda g, x: self.act(group, g, x), g, x))
        if not abs(np.linalg.norm(moved) - np.linalg.norm(x)) <= 1e-9 * np.linalg.norm(x):
            raise GroupError(
                f"Sphere() needs a group that acts by orthogonal matrices, but {group!r} in {shown(self.inside)} "
                f"changes the length of a vector from {np.linalg.norm(x):.4g} to {np.linalg.norm(moved):.4g}."
            )

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        return self.inside.act(group, g, x)

    def infinitesimal(self, group: LieGroup, xi: Array, x: Array) -> Array:
        return self.inside.infinitesimal(group, xi, x)

    def diamond(self, group: LieGroup, b: Array, x: Array) -> Array:
        return self.inside.diamond(group, b, x)

    def sample(self, group: LieGroup, random: np.random.Generator) -> np.ndarray:
        """A random point of the sphere, (ambient,)."""
        x = random.normal(size=self.ambient(group))
        return x / np.linalg.norm(x)

    def frame(self, group: LieGroup, x: Array) -> Array:
        """An orthonormal basis of TₓS, (ambient, dim): a reflection that takes ±e₁ to x, its other columns."""
        sign = jnp.where(x[0] < 0, -1.0, 1.0)
        normal = jnp.asarray(x).at[0].add(sign)
        columns = jnp.eye(x.shape[0])[:, 1:]
        return columns - jnp.outer(normal, normal[1:]) / (1 + jnp.abs(x[0]))

    def tangent(self, group: LieGroup, x: Array, y: Array) -> Array:
        # Without the part along x, |x| − 1 shrinks by 1 + |u|² a step; with it, round-off there may grow like e^t.
        v = self.frame(group, x) @ y
        return v - (x @ v) * x

    def difference(self, group: LieGroup, x: Array, u: Array) -> Array:
        square = u @ u
        r = jnp.sqrt(1 + square)
        return (u - square * x / (1 + r)) / r

    def project(self, group: LieGroup, x: Array, b: Array) -> Array:
        return b - (b @ x) * x

    def defect(self, group: LieGroup, x: Array) -> Array:
        return jnp.abs(x @ x - 1)

    def point(self, group: LieGroup, value: object, name: str) -> Array:
        array = checked_vector(value, self.ambient(group), name)
        if isinstance(array, np.ndarray) and abs(array @ array - 1) > 1e-9:
            raise ArgumentError(
                f"Argument `{name}` must be a unit vector, but has length {np.linalg.norm(array):.6g}; divide by it."
            )
        return array
