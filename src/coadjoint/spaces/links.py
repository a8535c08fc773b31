"""Spaces of a chain: one for each link."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.groups import LieGroup, Power
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import traced
from coadjoint.spaces.relative_poses import RelativePoses
from coadjoint.spaces.rows import power_of, rows_of
from coadjoint.spaces.several import Several
from coadjoint.spaces.space import Space, checked_vector


@dataclass(frozen=True)
class Links(Space):
    """A space for each link of `co.Power(G, N)`: what co.System makes of a space that it is given with such a group.

    The arrays of the links stand end to end, and ℓ gets them with a leading axis of links: of `co.Defining()` on SO(3)
    (N, 3). Points may be given for all links, (N, …), or once, as that of every link.

    space: the space of one link.
    """

    space: Space

    @property
    def flat(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Whether the space of a link is its own ambient space."""
        return self.space.flat

    @property
    def affine(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.space.affine

    def ambient(self, group: LieGroup) -> int:
        return power_of(group).count * self.space.ambient(power_of(group).factor)

    def dim(self, group: LieGroup) -> int:
        return power_of(group).count * self.space.dim(power_of(group).factor)

    def _map(self, group: LieGroup, function: Callable[..., Array], *arguments: Any) -> Array:
        """function(G, …) of every link, end to end; an argument that is not a flat array is an element."""
        power = power_of(group)
        rows = [x if isinstance(x, _Element) else _Value(jnp.reshape(x, (power.count, -1))) for x in arguments]
        found = jax.vmap(lambda *parts: function(power.factor, *parts))(*(row.values for row in rows))
        return jnp.reshape(found, -1)

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        return self._map(group, self.space.act, _Element(g), x)

    def push(self, group: LieGroup, g: Element, x: Array, v: Array) -> Array:
        return self._map(group, self.space.push, _Element(g), x, v)

    def pull(self, group: LieGroup, g: Element, x: Array, b: Array) -> Array:
        return self._map(group, self.space.pull, _Element(g), x, b)

    def infinitesimal(self, group: LieGroup, xi: Array, x: Array) -> Array:
        return self._map(group, self.space.infinitesimal, xi, x)

    def lifted(self, group: LieGroup, xi: Array, x: Array, v: Array) -> Array:
        return self._map(group, self.space.lifted, xi, x, v)

    def diamond(self, group: LieGroup, b: Array, x: Array) -> Array:
        return self._map(group, self.space.diamond, b, x)

    def lifted_diamond(self, group: LieGroup, b: Array, x: Array, v: Array) -> Array:
        return self._map(group, self.space.lifted_diamond, b, x, v)

    def tangent(self, group: LieGroup, x: Array, y: Array) -> Array:
        return y if self.flat else self._map(group, self.space.tangent, x, y)

    def coordinates(self, group: LieGroup, x: Array, b: Array) -> Array:
        return b if self.flat else self._map(group, self.space.coordinates, x, b)

    def difference(self, group: LieGroup, x: Array, u: Array) -> Array:
        return u if self.flat else self._map(group, self.space.difference, x, u)

    def project(self, group: LieGroup, x: Array, b: Array) -> Array:
        return b if self.flat else self._map(group, self.space.project, x, b)

    def momentum(self, group: LieGroup, x: Array, transported: Array, legendre: Array) -> Array:
        return transported if self.flat else self._map(group, self.space.momentum, x, transported, legendre)

    def defect(self, group: LieGroup, x: Array) -> Array | float:
        if self.flat:
            return 0.0
        return jnp.max(self._map(group, lambda G, one: jnp.asarray(self.space.defect(G, one)), x))

    def view(self, group: LieGroup, x: Array) -> PyTree:
        power = power_of(group)
        return jax.vmap(lambda one: self.space.view(power.factor, one))(jnp.reshape(x, (power.count, -1)))

    def point(self, group: LieGroup, value: object, name: str) -> Array:
        return self._given(group, self.space.point, value, name)

    def velocity(self, group: LieGroup, value: object, name: str) -> Array:
        return self._given(group, self.space.velocity, value, name)

    def _given(self, group: LieGroup, check: Callable[..., Array], value: object, name: str) -> Array:
        power = power_of(group)
        rows = rows_of(value, power.count, self.space.ambient(power.factor))
        if rows is None:
            return np.tile(check(power.factor, value, name), power.count)
        if traced(rows) or (self.flat and self.affine):
            return checked_vector(rows.reshape(-1), self.ambient(group), name)
        return np.concatenate([check(power.factor, row, name) for row in rows])


class _Value:
    def __init__(self, values: object):
        self.values = values


class _Element(_Value):
    """An element of Gᴺ among arguments."""


def on_links(group: LieGroup, space: Space) -> Space:
    """A space as it stands on a group: on Gᴺ that of every link, unless it is of links already or has no points."""
    if not isinstance(group, Power) or isinstance(space, (Links, RelativePoses)):
        return space
    if isinstance(space, Several):
        parts = zip(space.names, space.factors, strict=True)
        return Several({name: on_links(group, part) for name, part in parts})
    return space if space.ambient(group.factor) == 0 else Links(space)
