"""What curved spaces have in common: an orthonormal frame of each tangent space."""

from __future__ import annotations

from coadjoint.groups import LieGroup
from coadjoint.groups.group import Array
from coadjoint.spaces.space import Space


class Embedded(Space):
    """A curved space in its ambient coordinates: velocities and momenta at x are in the span of its frame E(x)."""

    flat = False

    def frame(self, group: LieGroup, x: Array) -> Array:
        """E, an orthonormal basis of T_xQ, (ambient, dim)."""
        raise NotImplementedError

    def tangent(self, group: LieGroup, x: Array, y: Array) -> Array:
        return self.frame(group, x) @ y

    def coordinates(self, group: LieGroup, x: Array, b: Array) -> Array:
        return self.frame(group, x).T @ b

    def momentum(self, group: LieGroup, x: Array, transported: Array, legendre: Array) -> Array:
        return self.project(group, x, legendre)
