"""Spaces of a chain: one for each link, and the poses of links relative to each other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from operator import index
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, GroupError, shown
from coadjoint.groups import LieGroup, Power
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import evaluate, traced
from coadjoint.spaces.rows import LinkRows
from coadjoint.spaces.several import Several
from coadjoint.spaces.space import Space, checked_vector

GROUND = -1
"""The link that stands still at e, in a pair of `RelativePoses`."""

OUTSIDE = 1e-9
"""How far a given pose may be from its group."""


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
        return _power(group).count * self.space.ambient(_power(group).factor)

    def dim(self, group: LieGroup) -> int:
        return _power(group).count * self.space.dim(_power(group).factor)

    def _map(self, group: LieGroup, function: Callable[..., Array], *arguments: Any) -> Array:
        """function(G, …) of every link, end to end; an argument that is not a flat array is an element."""
        power = _power(group)
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
        power = _power(group)
        return jax.vmap(lambda one: self.space.view(power.factor, one))(jnp.reshape(x, (power.count, -1)))

    def point(self, group: LieGroup, value: object, name: str) -> Array:
        return self._given(group, self.space.point, value, name)

    def velocity(self, group: LieGroup, value: object, name: str) -> Array:
        return self._given(group, self.space.velocity, value, name)

    def _given(self, group: LieGroup, check: Callable[..., Array], value: object, name: str) -> Array:
        power = _power(group)
        rows = _rows(value, power.count, self.space.ambient(power.factor))
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


@dataclass(frozen=True)
class RelativePoses(Space):
    """The poses of links relative to others: e = g_i⁻¹ e₀ g_j for every pair (i, j), on which Gᴺ acts by g_i e g_j⁻¹.

        system = co.System(co.Power(co.SE3(), 50), rod, advected=dict(joint=co.spaces.RelativePoses(),
                           height=co.spaces.Dual()))

    With e₀ = e, its value at the start where `a0` leaves it out, it is g_i⁻¹g_j, the pose of link j as link i sees it.
    So an energy of the joints is a function of `a.joint`, elements of G with a leading axis of pairs. With e₀ = e and
    without the ground, moving all links together leaves it unchanged, and the total momentum is conserved. Where g are
    displacements from poses A_i at rest, e₀ = A_i⁻¹A_j; the symmetry is then k_i = A_i⁻¹kA_i, another one at each link.

    pairs: of links, by default those of the group's `coupling`; −1 stands for the ground, which stays at e: (−1, 0) is
    the pose of the first link itself. Raises GroupError unless it is a list of pairs.
    """

    pairs: tuple[tuple[int, int], ...] | None = None
    at_start = True

    def __post_init__(self):
        if self.pairs is None:
            return
        try:
            given = tuple((index(i), index(j)) for i, j in self.pairs)
            if not given:
                raise ValueError
        except (TypeError, ValueError):
            raise GroupError(
                f"Argument `pairs` of RelativePoses must be pairs of links such as [(0, 1), (1, 2)], but is "
                f"{shown(self.pairs)}."
            ) from None
        object.__setattr__(self, "pairs", given)

    def require_fit(self, group: LieGroup) -> None:
        power = _power(group)
        if not self.of(group):
            raise GroupError(
                f"{power!r} couples no two links, so that RelativePoses has no pairs: give `pairs`, as [(-1, 0)] for "
                "the pose of the first link itself."
            )
        wrong = [
            pair for pair in self.of(group) if min(pair) < GROUND or max(pair) >= power.count or pair[0] == pair[1]
        ]
        if wrong:
            raise GroupError(
                f"The pair {wrong[0]} of RelativePoses must be of two links from 0 to {power.count - 1}, or −1 for "
                "the ground."
            )
        super().require_fit(group)

    def of(self, group: LieGroup) -> tuple[tuple[int, int], ...]:
        """The pairs (i, j)."""
        return _power(group).pairs if self.pairs is None else self.pairs

    def ambient(self, group: LieGroup) -> int:
        return len(self.of(group)) * _size(_power(group).factor)

    def _ends(self, group: LieGroup, tree: PyTree, still: object) -> tuple[PyTree, PyTree]:
        """Of a tree with an axis of links what belongs to both ends of each pair; `still`: ground's."""
        first, second = self._rows(group)
        grounded = jax.tree.map(lambda leaf, ground: jnp.concatenate([ground[None], leaf]), tree, still)
        return jax.tree.map(first.of, grounded), jax.tree.map(second.of, grounded)

    def _rows(self, group: LieGroup) -> tuple[LinkRows, LinkRows]:
        """The ends of the pairs as rows of an array whose first row is ground's, and the others the links'."""
        first, second = np.array(self.of(group), int).reshape(-1, 2).T - GROUND
        return LinkRows(first), LinkRows(second)

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        G = _power(group).factor
        first, second = self._ends(group, g, G.identity())
        moved = jax.vmap(lambda a, e, b: G.compose(G.compose(a, e), G.inverse(b)))(first, self.view(group, x), second)
        return _flat(moved)

    def infinitesimal(self, group: LieGroup, xi: Array, x: Array) -> Array:
        """(ξ_i − Ad_e ξ_j)^ e."""
        G = _power(group).factor
        first, second = self._ends(group, _power(group).view(xi), jnp.zeros(G.dim))

        def along(a: Array, e: Element, b: Array) -> Element:
            return _moved(G, e, a - G.Ad(e, b))

        return _flat(jax.vmap(along)(first, self.view(group, x), second))

    def diamond(self, group: LieGroup, b: Array, x: Array) -> Array:
        """−m at link i and Ad*_e m at link j of each pair, where ⟨m, η⟩ = ⟨b, η̂e⟩."""
        G, count = _power(group).factor, _power(group).count
        e = self.view(group, x)

        def lifted(at: Element, covector: Element) -> tuple[Array, Array]:
            (m,) = jax.vjp(lambda eta: _moved(G, at, eta), jnp.zeros(G.dim))[1](covector)
            return -m, G.Ad_dual(at, m)

        first, second = self._rows(group)
        at_first, at_second = jax.vmap(lifted)(e, self.view(group, b))
        rows = first.summed(at_first, count + 1) + second.summed(at_second, count + 1)
        return jnp.reshape(rows[1:], -1)

    def lifted(self, group: LieGroup, xi: Array, x: Array, v: Array) -> Array:
        raise GroupError("Poses between links are advected parameters: as additional dynamics they have no velocity.")

    def view(self, group: LieGroup, x: Array) -> Element:
        leaves, structure = jax.tree.flatten(jax.eval_shape(_power(group).factor.identity))
        rows = jnp.reshape(x, (len(self.of(group)), -1))
        ends = np.cumsum([0, *(int(np.prod(leaf.shape)) for leaf in leaves)])
        parts = [
            jnp.reshape(rows[:, a:b], (len(rows), *leaf.shape))
            for a, b, leaf in zip(ends[:-1], ends[1:], leaves, strict=True)
        ]
        return jax.tree.unflatten(structure, parts)

    def point(self, group: LieGroup, value: object, name: str) -> Array:
        count, G = len(self.of(group)), _power(group).factor
        if value is None:
            one = jax.tree.leaves(evaluate(G.identity))
            return np.tile(np.concatenate([np.ravel(leaf) for leaf in one]), count)
        rows = _rows(value, count, _size(G))
        if rows is None:
            raise ArgumentError(
                f"Argument `{name}` must hold an element of {G!r} for each of {count} pairs, or be left out for e, but "
                f"is {shown(value)}."
            )
        checked = checked_vector(rows.reshape(-1), self.ambient(group), name)
        if not traced(checked):
            self._require_poses(group, checked, name)
        return checked

    def _require_poses(self, group: LieGroup, x: Array, name: str) -> None:
        """Raise ArgumentError unless a given pose is an element of G."""
        G = _power(group).factor
        away = evaluate(lambda x: jax.vmap(lambda e: jnp.asarray(G.outside(e)))(self.view(group, x)), x)
        worst = int(np.argmax(away))
        if not away[worst] <= OUTSIDE:
            raise ArgumentError(
                f"The pose of the pair {self.of(group)[worst]} in `{name}` must be an element of {G!r}, but is off by "
                f"{away[worst]:.1e}: give it with all its digits, or leave `{name}` out for e."
            )


def on_links(group: LieGroup, space: Space) -> Space:
    """A space as it stands on a group: on Gᴺ that of every link, unless it is of links already or has no points."""
    if not isinstance(group, Power) or isinstance(space, (Links, RelativePoses)):
        return space
    if isinstance(space, Several):
        parts = zip(space.names, space.factors, strict=True)
        return Several({name: on_links(group, part) for name, part in parts})
    return space if space.ambient(group.factor) == 0 else Links(space)


def _power(group: LieGroup) -> Power:
    if not isinstance(group, Power):
        raise GroupError(f"Spaces of links need a group of links such as co.Power(co.SE3(), 10), but got {group!r}.")
    return group


def _moved(group: LieGroup, e: Element, eta: Array) -> Element:
    """η̂e, as a tangent vector at e."""
    return jax.jvp(lambda g: group.compose(g, e), (group.identity(),), (group.tangent(eta),))[1]


def _size(group: LieGroup) -> int:
    """How many numbers an element has."""
    return sum(int(np.prod(leaf.shape)) for leaf in jax.tree.leaves(jax.eval_shape(group.identity)))


def _flat(tree: PyTree) -> Array:
    """Elements with a leading axis as numbers, end to end."""
    leaves = jax.tree.leaves(tree)
    return jnp.reshape(jnp.concatenate([jnp.reshape(leaf, (leaf.shape[0], -1)) for leaf in leaves], axis=1), -1)


def _rows(value: object, count: int, size: int) -> Array | None:
    """The numbers (count, size) given for all links, end to end or by leaves; None where they are not given for all."""
    try:
        leaves = (
            [leaf if traced(leaf) else np.asarray(leaf, dtype=float) for leaf in jax.tree.leaves(value)]
            if not isinstance(value, list)
            else [np.asarray(value, dtype=float)]
        )
    except (TypeError, ValueError):
        return None
    if len(leaves) == 1 and leaves[0].shape == (count * size,):
        return leaves[0].reshape(count, size)
    if any(leaf.ndim < 2 or leaf.shape[0] != count for leaf in leaves):
        return None
    parts = [leaf.reshape(count, -1) for leaf in leaves]
    if sum(part.shape[1] for part in parts) != size:
        return None
    return jnp.concatenate(parts, axis=1) if traced(value) else np.concatenate(parts, axis=1)
