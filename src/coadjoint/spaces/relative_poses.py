"""The poses of the links of a chain relative to each other."""

from __future__ import annotations

from dataclasses import dataclass
from operator import index

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, GroupError, shown
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import evaluate, traced
from coadjoint.spaces.rows import LinkRows, power_of, rows_of
from coadjoint.spaces.space import Space, checked_vector

GROUND = -1
"""The link that stands still at e, in a pair of `RelativePoses`."""

OUTSIDE = 1e-9
"""How far a given pose may be from its group."""


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
        power = power_of(group)
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
        return power_of(group).pairs if self.pairs is None else self.pairs

    def ambient(self, group: LieGroup) -> int:
        return len(self.of(group)) * _size(power_of(group).factor)

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
        G = power_of(group).factor
        first, second = self._ends(group, g, G.identity())
        moved = jax.vmap(lambda a, e, b: G.compose(G.compose(a, e), G.inverse(b)))(first, self.view(group, x), second)
        return _flat(moved)

    def infinitesimal(self, group: LieGroup, xi: Array, x: Array) -> Array:
        """(ξ_i − Ad_e ξ_j)^ e."""
        G = power_of(group).factor
        first, second = self._ends(group, power_of(group).view(xi), jnp.zeros(G.dim))

        def along(a: Array, e: Element, b: Array) -> Element:
            return _moved(G, e, a - G.Ad(e, b))

        return _flat(jax.vmap(along)(first, self.view(group, x), second))

    def diamond(self, group: LieGroup, b: Array, x: Array) -> Array:
        """−m at link i and Ad*_e m at link j of each pair, where ⟨m, η⟩ = ⟨b, η̂e⟩."""
        G, count = power_of(group).factor, power_of(group).count
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
        leaves, structure = jax.tree.flatten(jax.eval_shape(power_of(group).factor.identity))
        rows = jnp.reshape(x, (len(self.of(group)), -1))
        ends = np.cumsum([0, *(int(np.prod(leaf.shape)) for leaf in leaves)])
        parts = [
            jnp.reshape(rows[:, a:b], (len(rows), *leaf.shape))
            for a, b, leaf in zip(ends[:-1], ends[1:], leaves, strict=True)
        ]
        return jax.tree.unflatten(structure, parts)

    def point(self, group: LieGroup, value: object, name: str) -> Array:
        count, G = len(self.of(group)), power_of(group).factor
        if value is None:
            one = jax.tree.leaves(evaluate(G.identity))
            return np.tile(np.concatenate([np.ravel(leaf) for leaf in one]), count)
        rows = rows_of(value, count, _size(G))
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
        G = power_of(group).factor
        away = evaluate(lambda x: jax.vmap(lambda e: jnp.asarray(G.outside(e)))(self.view(group, x)), x)
        worst = int(np.argmax(away))
        if not away[worst] <= OUTSIDE:
            raise ArgumentError(
                f"The pose of the pair {self.of(group)[worst]} in `{name}` must be an element of {G!r}, but is off by "
                f"{away[worst]:.1e}: give it with all its digits, or leave `{name}` out for e."
            )


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
