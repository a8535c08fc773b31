"""Kelvin–Noether quantities (Theorems 2 and 7) and the momentum that they pair with."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from coadjoint import checks
from coadjoint.arrays import Array, Scalar
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError
from coadjoint.groups import LieGroup, Power
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.coupling import large
from coadjoint.mechanics.invariance import acted_on
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.trace_checks import in_words, require_float64
from coadjoint.spaces import Adjoint, Space


def total_momentum(system: System, state: State) -> Array:
    """m = μ − π⋄n ∈ 𝔤*, (dim G,), the total momentum in the body frame."""
    return state.mu - system.additional.diamond(system.group, state.pi, state.n)


def spatial_momentum(system: System, state: State) -> Array:
    """Ad*_{g⁻¹} m ∈ 𝔤*, (dim G,), the total momentum in the space frame (P78); Ad*_g m of right-invariant systems."""
    return system.group.Ad_dual(system.group.inverse(state.g), total_momentum(system, state))


def momentum_scale(system: System, state: State) -> Array:
    """|μ| + |π⋄n| or |μ| + |π||n|, the larger, one number: round-off in m is relative to this size.

    The product counts where n and π are parallel, so that π⋄n vanishes.
    """
    orbital = jnp.max(jnp.abs(system.additional.diamond(system.group, state.pi, state.n)), initial=0.0)
    product = jnp.sqrt((state.pi @ state.pi) * (state.n @ state.n))
    return jnp.max(jnp.abs(state.mu), initial=0.0) + jnp.maximum(orbital, product)


class KelvinNoether:
    """I = ⟨𝒦(c, a), m⟩ with c = g⁻¹c₀ (P27) for an equivariant 𝒦: C × V* → 𝔤, 𝒦(gc, ga) = Ad_g 𝒦(c, a) (P25).

        co.simulate(top, start, dt=0.01, steps=100, kelvin_noether=co.mechanics.KelvinNoether([0.0, 0.0, 1.0]))

    c0: c₀, a point of C in the space frame, (dim C,); by default C = 𝔤, (dim G,). K: 𝒦, a function (c, a) → (dim G,) in
    terms of jax.numpy; by default 𝒦(c, a) = c. space: C, by default `co.spaces.Adjoint()`.
    Unforced, I is conserved for every c₀ with c₀·a₀ = 0 for all advected parameters. m = μ − π⋄n is the total momentum.

    Raises ArgumentError for a c₀ of numbers that are not float64; a run raises it for a 𝒦 that is not equivariant.
    """

    def __init__(self, c0: ArrayLike, K: Callable[[Array, Any], Array] | None = None, space: Space | None = None):
        self.c0 = float64(c0, "Argument `c0`")
        self.K = K
        if space is not None:
            checks.instance(space, "space", Space, "a space such as co.spaces.Adjoint()")
        if K is not None:
            checks.function(K, "K", "a function of (c, a)")
        self.space = Adjoint() if space is None else space
        if isinstance(self.c0, np.ndarray):
            self.c0.flags.writeable = False

    def _key(self) -> tuple[object, ...]:
        return np.shape(self.c0), np.asarray(self.c0).tobytes(), self.K, self.space

    def __eq__(self, other: object) -> bool:
        return isinstance(other, KelvinNoether) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def momentum_map(self, system: System, state: State) -> Array:
        """𝒦(c, a) ∈ 𝔤, (dim G,), at a state."""
        group = system.group
        c = acted_on(system.places, self.space).act(group, group.inverse(state.g), self.c0)
        return c if self.K is None else self.K(c, system.advected.view(group, state.a))

    def quantity(self, system: System, state: State) -> Array:
        """I = ⟨𝒦(c, a), m⟩ at a node, one number."""
        return self.momentum_map(system, state) @ total_momentum(system, state)

    def paper_quantity(self, system: System, step: Any, record: State, h: Scalar) -> Array:
        """(P51) of the step that starts at the record, one number: I_k + ⟨𝒦_k, ∂_aΛ⋄a_k⟩, and the forces' share.

        step: a method of one stage; h: its length, one number. On unforced runs
        (P51)_k − (P51)_{k−1} = ⟨𝒦_k, ∂_aΛ⋄a_k⟩ (P52); it is I itself where 𝒦 = a.
        """
        ahead, behind = step.sources(system, record, h)
        back = system.group.inverse(step.relative(system, record, h))
        source = ahead + system.group.Ad_dual(back, behind)
        return self.quantity(system, record) + self.momentum_map(system, record) @ source

    def require_equivariant(self, system: System, state: State) -> None:
        """Raise ArgumentError unless 𝒦(gc, ga) = Ad_g 𝒦(c, a) at random group elements."""
        space = acted_on(system.places, self.space)
        size = space.ambient(system.group)
        checks.shape(self.c0, "c0", (size,))
        group, V = system.group, system.advected
        if (chosen := self.K) is not None:
            require_float64(lambda c, a: chosen(c, V.view(group, a)), "𝒦", (self.c0, state.a))

        def error(eta: Array, c0: Array) -> Array:
            g = group.exp(eta)

            def K(c: Array, a: Array) -> Array:
                return c if self.K is None else self.K(c, V.view(group, a))

            moved = K(space.act(group, g, c0), V.act(group, g, state.a))
            return jnp.max(jnp.abs(moved - group.Ad(g, K(c0, state.a))))

        eta = np.random.default_rng(7).normal(size=group.dim)
        with in_words("𝒦"):
            found = float(evaluate(error, eta, self.c0))
        if found > 1e-9 * max(1.0, float(np.max(np.abs(self.c0)))):
            raise ArgumentError(f"𝒦 must satisfy 𝒦(gc, ga) = Ad_g 𝒦(c, a), but is off by {found:.1e}.")


def isotropy_algebra(system: System, state: State) -> np.ndarray:
    """A basis (k, dim) of {c₀ ∈ 𝔤: c₀·a₀ = 0 for every advected parameter}: the directions of conserved momenta.

    Unit rows in reduced echelon form, so that coordinate directions come out as such. Each parameter counts relative
    to its own size.
    """
    return isotropy_algebras(system, jax.tree.map(lambda leaf: np.asarray(leaf)[None], state))[0]


def isotropy_algebras(system: System, states: State) -> list[np.ndarray]:
    """`isotropy_algebra` of every state of a record with one leading axis: a basis (k, dim) for each."""
    group, V = system.group, system.advected
    directions = _directions(group)
    if V.ambient(group) == 0:
        return [directions] * len(states.t)

    def action(s: State):
        a0 = V.act(group, s.g, s.a)
        return a0, jax.vmap(lambda c0: V.infinitesimal(group, c0, a0), out_axes=1)(jnp.asarray(directions))

    a0, moved = evaluate(jax.vmap(action), states)
    moved = np.array(moved)
    for part in V.components(group, "a").values():
        size = np.linalg.norm(a0[:, part], axis=1)[:, None, None]
        moved[:, part] /= np.where(size > 0, size, 1.0)
    _, singular, rows = np.linalg.svd(moved, full_matrices=True)
    largest = singular.max(axis=1, initial=0.0)
    ranks = np.sum(singular > 1e-10 * largest[:, None], axis=1)
    return [echelon(own[rank:]) @ directions for own, rank in zip(rows, ranks, strict=True)]


def _directions(group: LieGroup) -> np.ndarray:
    """The candidates c₀ (k, dim): all of 𝔤, on many links those that move all of them alike."""
    if not large(group):
        return np.eye(group.dim)
    assert isinstance(group, Power)
    return np.tile(np.eye(group.factor.dim), group.count)


def echelon(rows: np.ndarray) -> np.ndarray:
    """The reduced echelon basis of the span of the rows (k, d), each row normalised, (k, d)."""
    rows = rows.copy()
    for i in range(len(rows)):
        column = int(np.argmax(np.abs(rows[i:]).max(axis=0) > 1e-8))
        pivot = i + int(np.argmax(np.abs(rows[i:, column])))
        rows[[i, pivot]] = rows[[pivot, i]]
        rows[i] /= rows[i, column]
        for j in range(len(rows)):
            if j != i:
                rows[j] -= rows[j, column] * rows[i]
    rows[np.abs(rows) < 1e-13] = 0.0
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)
