"""Invariant submanifolds of a representation: homogeneous spaces, coadjoint orbits, frames of vectors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, GroupError, shown
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element
from coadjoint.groups.overrides import in_words
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.spaces.representations import Defining
from coadjoint.spaces.space import Embedded, Space, random_motion

ON_SPACE = 1e-9
"""How far a constraint may be from zero by round-off."""
_NEWTON = 5
"""Newton's steps of a retraction: they start |u|² off and square that, 2e-19 after five from |u| = ½."""
_SETTLED = 1e-12
"""What the square of the last of them may be of |x|² + |u|²; the error that it leaves is its square."""


@dataclass(frozen=True)
class Submanifold(Embedded):
    """Q = {x ∈ W: c(x) = 0} that the group leaves invariant, inside a flat space W on which it acts linearly.

        frames = Submanifold(lambda x: jnp.stack([x.e @ x.e - 1, x.f @ x.f - 1, x.e @ x.f]),
                             Several({"e": Defining(), "f": Defining()}))
        orbit = Submanifold(lambda m: m @ m - 4, Coadjoint())

    constraint: a function of a point, as the user's functions see it, that returns an array of independent numbers
    c(x); every c(gx) must vanish with c(x). inside: W, by default co.Defining(), or `Several` of named spaces. The
    frame of T_xQ is an orthonormal basis of ker Dc(x); ρ(x, u) = x + u − Dc(x)ᵀλ with c(ρ) = 0. Raises ArgumentError
    for other arguments, GroupError where c does not stay zero under the group.
    """

    constraint: Callable[[PyTree], PyTree]
    inside: Space = field(default_factory=Defining)

    def __post_init__(self):
        if not callable(self.constraint) or not isinstance(self.inside, Space) or not _linear(self.inside):
            raise ArgumentError(
                "Submanifold needs a function c with c(x) = 0 on the space, and a flat space that it lies in, but got "
                f"{shown(self.constraint)} and {shown(self.inside)}."
            )

    def equations(self, group: LieGroup, x: Array) -> Array:
        """c(x), shape (number of constraints,)."""
        with in_words("The constraint of a Submanifold"):
            return jnp.ravel(jnp.asarray(self.constraint(self.inside.view(group, x))))

    def normals(self, group: LieGroup, x: Array) -> Array:
        """Dc(x), (number of constraints, ambient): one gradient a row."""
        return jax.jacfwd(lambda y: self.equations(group, y))(x)

    def ambient(self, group: LieGroup) -> int:
        return self.inside.ambient(group)

    def dim(self, group: LieGroup) -> int:
        return self.ambient(group) - _count(self, group)

    def require_fit(self, group: LieGroup) -> None:
        """Raise GroupError unless W carries a linear action and c(gx) = 0 at a random point x of Q and random g."""
        self.inside.require_fit(group)
        found = _random_point(self, group)
        if found is not None:
            _require_invariant(self, group, found)

    def sample(self, group: LieGroup, random: np.random.Generator) -> np.ndarray:
        """A point of Q near a random one of W, (ambient,), where Gauss–Newton finds one."""
        x = self.inside.sample(group, random)
        found = _near(self, group, x)
        return x if found is None else found

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        return self.inside.act(group, g, x)

    def push(self, group: LieGroup, g: Element, x: Array, v: Array) -> Array:
        return self.inside.push(group, g, x, v)

    def pull(self, group: LieGroup, g: Element, x: Array, b: Array) -> Array:
        return self.inside.pull(group, g, x, b)

    def infinitesimal(self, group: LieGroup, xi: Array, x: Array) -> Array:
        return self.inside.infinitesimal(group, xi, x)

    def lifted(self, group: LieGroup, xi: Array, x: Array, v: Array) -> Array:
        return self.inside.lifted(group, xi, x, v)

    def diamond(self, group: LieGroup, b: Array, x: Array) -> Array:
        return self.inside.diamond(group, b, x)

    def lifted_diamond(self, group: LieGroup, b: Array, x: Array, v: Array) -> Array:
        return self.inside.lifted_diamond(group, b, x, v)

    def frame(self, group: LieGroup, x: Array) -> Array:
        """An orthonormal basis of T_xQ, (ambient, dim): reflections that take e₁, e₂, … to the normals in turn."""
        rows, size = self.normals(group, x), self.ambient(group)
        basis = jnp.eye(size)
        for k in range(_count(self, group)):
            rest = (rows[k] @ basis)[k:]
            normal = rest.at[0].add(jnp.where(rest[0] < 0, -1.0, 1.0) * jnp.sqrt(rest @ rest))
            part = basis[:, k:]
            basis = basis.at[:, k:].set(part - jnp.outer(part @ normal, 2 * normal / (normal @ normal)))
        return basis[:, _count(self, group) :]

    def difference(self, group: LieGroup, x: Array, u: Array) -> Array:
        """ρ(x, u) − x = u − Dc(x)ᵀλ, Newton's method for c(x + u − Dc(x)ᵀλ) = c(x); NaN where that has no solution."""
        rows = self.normals(group, x)
        moved, last = u, jnp.zeros_like(u)
        for _ in range(_NEWTON):
            there = x + moved
            error = self.equations(group, there) - self.equations(group, x)
            last = rows.T @ jnp.linalg.solve(self.normals(group, there) @ rows.T, error)
            moved = moved - last
        return jnp.where(last @ last <= _SETTLED * (x @ x + u @ u), moved, jnp.nan)

    def project(self, group: LieGroup, x: Array, b: Array) -> Array:
        rows = self.normals(group, x)
        return b - rows.T @ jnp.linalg.solve(rows @ rows.T, rows @ b)

    def defect(self, group: LieGroup, x: Array) -> Array:
        return jnp.max(jnp.abs(self.equations(group, x)))

    def view(self, group: LieGroup, x: Array) -> PyTree:
        return self.inside.view(group, x)

    def components(self, group: LieGroup, name: str) -> dict[str, slice]:
        return self.inside.components(group, name)

    def point(self, group: LieGroup, value: object, name: str) -> Array:
        array = self.inside.point(group, value, name)
        if isinstance(array, np.ndarray):
            off = evaluate(lambda x: self.defect(group, x), array)
            if not off <= ON_SPACE * max(1.0, float(np.max(np.abs(array))) ** 2):
                raise ArgumentError(f"Argument `{name}` must lie in its space, but the constraint there is {off:.3g}.")
            _require_invariant(self, group, array)
        return array

    def velocity(self, group: LieGroup, value: object, name: str) -> Array:
        return self.inside.velocity(group, value, name)


def _linear(space: Space) -> bool:
    """Whether a space can be the one around a submanifold."""
    return space.flat and space.affine


@lru_cache(maxsize=256)
def _count(space: Submanifold, group: LieGroup) -> int:
    """The number of constraints."""
    shape = jax.eval_shape(lambda x: space.equations(group, x), np.zeros(space.ambient(group)))
    return int(shape.shape[0])


@lru_cache(maxsize=256)
def _random_point(space: Submanifold, group: LieGroup) -> np.ndarray | None:
    """A point of Q near a random one."""
    return _near(space, group, random_motion(space, group)[1])


def _near(space: Submanifold, group: LieGroup, x: np.ndarray) -> np.ndarray | None:
    """A point of Q near x, (ambient,), by Gauss–Newton; None where that leads nowhere."""
    for _ in range(50):
        c, rows = evaluate(lambda x: (space.equations(group, x), space.normals(group, x)), x)
        if np.max(np.abs(c), initial=0.0) <= 1e-13:
            return x
        if not np.all(np.isfinite(rows)):
            break
        x = x - np.linalg.pinv(rows) @ c
    return None


def _require_invariant(space: Submanifold, group: LieGroup, x: np.ndarray) -> None:
    """Raise GroupError unless c(gx) = c(x) at a random g and the gradients of c are independent at x."""
    g, _, _ = random_motion(space, group)

    def measure(g: Element, x: Array):
        moved = space.equations(group, space.act(group, g, x)) - space.equations(group, x)
        return jnp.max(jnp.abs(moved), initial=0.0), space.normals(group, x)

    off, rows = evaluate(measure, g, x)
    if not off <= 1e-8 * max(1.0, float(np.max(np.abs(rows)))):
        raise GroupError(
            f"{group!r} must leave a Submanifold invariant, c(gx) = 0 where c(x) = 0, but c changes by {off:.1e}."
        )
    if np.linalg.matrix_rank(rows, tol=1e-10) < len(rows):
        raise GroupError(
            f"The constraints of a Submanifold must be independent, but of {len(rows)} only "
            f"{np.linalg.matrix_rank(rows, tol=1e-10)} are at {x}: leave out the others."
        )
