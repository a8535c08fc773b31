"""A space on which a group acts, as a space of the opposite group, which acts by inverses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import GroupError
from coadjoint.groups import LieGroup, Opposite
from coadjoint.groups.group import Element
from coadjoint.spaces.representations import Trivial
from coadjoint.spaces.several import Several
from coadjoint.spaces.space import Space


@dataclass(frozen=True)
class ByInverse(Space):
    """A space of G as one of the opposite group: g acts as g⁻¹ does under G, ξ·x = −(ξ·x under G).

    So what a left-invariant system on Gᵒᵖ calls n = g⁻¹·q is gq, and a = g⁻¹·a₀ is ga₀.

    space: a space of G. Raises GroupError unless it is a Space.
    """

    space: Space

    def __post_init__(self):
        checks.instance(self.space, "The space of ByInverse", Space, "a space such as co.Defining()", GroupError)

    @property
    def flat(self) -> bool:  # type: ignore[override]
        return self.space.flat

    @property
    def affine(self) -> bool:  # type: ignore[override]
        return self.space.affine

    def require_fit(self, group: LieGroup) -> None:
        self.space.require_fit(_of(group))

    def ambient(self, group: LieGroup) -> int:
        return self.space.ambient(_of(group))

    def dim(self, group: LieGroup) -> int:
        return self.space.dim(_of(group))

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        return self.space.act(_of(group), group.inverse(g), x)

    def push(self, group: LieGroup, g: Element, x: Array, v: Array) -> Array:
        return self.space.push(_of(group), group.inverse(g), x, v)

    def pull(self, group: LieGroup, g: Element, x: Array, b: Array) -> Array:
        return self.space.pull(_of(group), group.inverse(g), x, b)

    def infinitesimal(self, group: LieGroup, xi: Array, x: Array) -> Array:
        return -self.space.infinitesimal(_of(group), xi, x)

    def lifted(self, group: LieGroup, xi: Array, x: Array, v: Array) -> Array:
        return -self.space.lifted(_of(group), xi, x, v)

    def diamond(self, group: LieGroup, b: Array, x: Array) -> Array:
        return -self.space.diamond(_of(group), b, x)

    def lifted_diamond(self, group: LieGroup, b: Array, x: Array, v: Array) -> Array:
        return -self.space.lifted_diamond(_of(group), b, x, v)

    def tangent(self, group: LieGroup, x: Array, y: Array) -> Array:
        return self.space.tangent(_of(group), x, y)

    def coordinates(self, group: LieGroup, x: Array, b: Array) -> Array:
        return self.space.coordinates(_of(group), x, b)

    def difference(self, group: LieGroup, x: Array, u: Array) -> Array:
        return self.space.difference(_of(group), x, u)

    def project(self, group: LieGroup, x: Array, b: Array) -> Array:
        return self.space.project(_of(group), x, b)

    def momentum(self, group: LieGroup, x: Array, transported: Array, legendre: Array) -> Array:
        return self.space.momentum(_of(group), x, transported, legendre)

    def defect(self, group: LieGroup, x: Array) -> Array | float:
        return self.space.defect(_of(group), x)

    def sample(self, group: LieGroup, random: np.random.Generator) -> np.ndarray:
        return self.space.sample(_of(group), random)

    def view(self, group: LieGroup, x: Array) -> PyTree:
        return self.space.view(_of(group), x)

    def point(self, group: LieGroup, value: object, name: str) -> Array:
        return self.space.point(_of(group), value, name)

    def velocity(self, group: LieGroup, value: object, name: str) -> Array:
        return self.space.velocity(_of(group), value, name)

    def components(self, group: LieGroup, name: str) -> dict[str, slice]:
        return self.space.components(_of(group), name)


def by_inverse(space: Space) -> Space:
    """The space as one of the opposite group; of several each by itself, and unchanged where nothing acts."""
    if isinstance(space, Several):
        return Several({name: by_inverse(part) for name, part in zip(space.names, space.factors, strict=True)})
    return space if isinstance(space, Trivial) else ByInverse(space)


def _of(group: LieGroup) -> LieGroup:
    """G of Gᵒᵖ."""
    if not isinstance(group, Opposite):
        raise GroupError(f"ByInverse() is a space of the opposite of a group, but the group is {group!r}.")
    return group.group
