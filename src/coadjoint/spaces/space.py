"""The contract of a space on which a group acts: advected parameters live in one, additional dynamics in another.

Points, velocities and momenta are flat arrays of the ambient coordinates, (ambient,). The diamond is minus the
transpose of ξ ↦ ξ·x (P14, P45), so differentiation provides it for every group and space. `Embedded` is the base of
curved spaces: it gives an orthonormal frame of each tangent space.
"""

from __future__ import annotations

from contextlib import suppress
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.checks import float64, numeric
from coadjoint.errors import ArgumentError, GroupError, must_give, shown
from coadjoint.groups.group import Element, LieGroup, transpose
from coadjoint.kernels.run.disk_cache import recalled
from coadjoint.kernels.trace.evaluate import evaluate, traced


class Space:
    """A manifold with a left action of G, inside a linear space of ambient coordinates.

    To be given: `ambient`, `act`, which must be affine in x; `Action` takes other smooth actions. A curved space lies
    inside such a one, inherits from `Embedded` and gives `dim`, `frame`, `difference`, `project`, `defect` and
    `require_fit`; a closed form may replace anything derived. Spaces are static, hashable objects.
    """

    flat: bool = True
    """Whether the space is its own ambient space."""

    affine: bool = True
    """Whether straight lines of the ambient space are mapped to straight lines, as most quadrature rules require."""

    at_start: bool = False
    """Whether a start may leave out the point, which is then what `point` makes of None."""

    def ambient(self, group: LieGroup) -> int:
        """The length of the arrays that hold points."""
        must_give(self, "ambient")

    def require_fit(self, group: LieGroup) -> None:
        """Raise GroupError unless `act` is an affine left action: at random g, h, x, v it must satisfy

        act(gh, x) = act(g, act(h, x)) and act(g, x + v) − act(g, x) = push(g, x, v).

        The discrete equations in node form hold for such actions only.
        """
        require_action(self, group)
        _require_affine(self, group)

    def dim(self, group: LieGroup) -> int:
        """The dimension of the manifold."""
        return self.ambient(group)

    def act(self, group: LieGroup, g: Element, x: Array) -> Array:
        """g·x, (ambient,), of a point x (ambient,)."""
        must_give(self, "act")

    def push(self, group: LieGroup, g: Element, x: Array, v: Array) -> Array:
        """The tangent lift of the action: v at x ↦ g·v at g·x, all (ambient,)."""
        return jax.jvp(lambda y: self.act(group, g, y), (x,), (v,))[1]

    def pull(self, group: LieGroup, g: Element, x: Array, b: Array) -> Array:
        """The dual of `push` at x: b at g·x ↦ g*b at x, both (ambient,), with ⟨g*b, w⟩ = ⟨b, g·w⟩."""
        return transpose(lambda v: self.push(group, g, x, v), self.ambient(group), b)

    def infinitesimal(self, group: LieGroup, xi: Array, x: Array) -> Array:
        """ξ·x, (ambient,), the infinitesimal action of ξ (dim G,) at x (P19)."""
        return jax.jvp(lambda g: self.act(group, g, x), (group.identity(),), (group.tangent(xi),))[1]

    def lifted(self, group: LieGroup, xi: Array, x: Array, v: Array) -> Array:
        """L_ξ v, (ambient,): the derivative of x ↦ ξ·x along v at x, for ξ (dim G,) (P18)."""
        return jax.jvp(lambda y: self.infinitesimal(group, xi, y), (x,), (v,))[1]

    def diamond(self, group: LieGroup, b: Array, x: Array) -> Array:
        """b⋄x ∈ 𝔤*, (dim G,), of b and x (ambient,): ⟨b⋄x, ξ⟩ = −⟨b, ξ·x⟩ (P14, P45)."""
        return -transpose(lambda xi: self.infinitesimal(group, xi, x), group.dim, b)

    def lifted_diamond(self, group: LieGroup, b: Array, x: Array, v: Array) -> Array:
        """b⋄v ∈ 𝔤*, (dim G,), for a velocity v at x, all (ambient,): ⟨b⋄v, ξ⟩ = −⟨b, L_ξ v⟩ (P24)."""
        return -transpose(lambda xi: self.lifted(group, xi, x, v), group.dim, b)

    def tangent(self, group: LieGroup, x: Array, y: Array) -> Array:
        """E_x y, (ambient,): the tangent vector at x with frame coordinates y (dim,)."""
        return y

    def coordinates(self, group: LieGroup, x: Array, b: Array) -> Array:
        """E_xᵀ b, (dim,): a covector, or a tangent vector, b (ambient,) at x in the orthonormal frame."""
        return b

    def difference(self, group: LieGroup, x: Array, u: Array) -> Array:
        """ρ(x, u) − x, (ambient,), of a tangent vector u at x, for a retraction ρ, without cancellation."""
        return u

    def project(self, group: LieGroup, x: Array, b: Array) -> Array:
        """The covector b (ambient,) projected onto T*ₓQ."""
        return b

    def momentum(self, group: LieGroup, x: Array, transported: Array, legendre: Array) -> Array:
        """The momentum at x, (ambient,): on a flat space the transported one, on a curved one that of Legendre."""
        return transported

    def defect(self, group: LieGroup, x: Array) -> Array | float:
        """How far x is from the space, one number; zero on a flat space."""
        return 0.0

    def sample(self, group: LieGroup, random: np.random.Generator) -> np.ndarray:
        """A random point of a flat space, (ambient,), at which statements for all points are tested."""
        return random.normal(size=self.ambient(group))

    def view(self, group: LieGroup, x: Array) -> PyTree:
        """A point x (ambient,) as the user's functions see it: an array, or a namespace of arrays."""
        return x

    def point(self, group: LieGroup, value: object, name: str) -> Array:
        """The user's point as a flat float64 array (ambient,); raises ArgumentError with `name` for a wrong shape."""
        return checked_vector(value, self.ambient(group), name)

    def given(self, group: LieGroup, x: Array) -> PyTree:
        """The value of which `point` makes x, (…, ambient) with any leading axes."""
        return x

    def velocity(self, group: LieGroup, value: object, name: str) -> Array:
        """The user's velocity likewise, (ambient,); whether it is tangent is not checked here."""
        return checked_vector(value, self.ambient(group), name)

    def components(self, group: LieGroup, name: str) -> dict[str, slice]:
        """How arrays of points are named in a dataset."""
        return {name: slice(0, self.ambient(group))}


def random_motion(space: Space, group: LieGroup) -> tuple[Element, np.ndarray, np.ndarray]:
    """A group element, a point and a velocity (ambient,), away from anything special."""
    random = np.random.default_rng(1687)
    x, v = random.normal(size=(2, space.ambient(group)))
    return evaluate(group.exp, random.normal(scale=0.5, size=group.dim)), x, v


@lru_cache(maxsize=256)
def require_action(space: Space, group: LieGroup) -> None:
    """Raise GroupError unless act(gh, x) = act(g, act(h, x)) and act(e, x) = x at random g, h, x."""
    wrong, size = recalled(("action", space, group), lambda: {"misfit": _misfit(space, group)})["misfit"]
    if not wrong <= 1e-9 * max(size, 1e-300):
        raise GroupError(
            f"{space!r} must carry a left action of {group!r}, act(gh, x) = act(g, act(h, x)), but these differ by "
            f"{wrong:.1e}: a right action becomes a left one with g⁻¹."
        )


def _misfit(space: Space, group: LieGroup) -> list[float]:
    """The error of the axioms of an action at random g, h, x, and the size of what they compare."""
    g, x, _ = random_motion(space, group)
    eta = np.random.default_rng(1872).normal(scale=0.5, size=group.dim)

    def measure(g: Element, eta: Array, x: Array):
        h = group.exp(eta)
        turn = space.act(group, g, space.act(group, h, x))
        wrong = space.act(group, group.compose(g, h), x) - turn
        still = space.act(group, group.identity(), x) - x
        sizes = [jnp.max(jnp.abs(part), initial=0.0) for part in (wrong, still, turn, x)]
        return jnp.maximum(sizes[0], sizes[1]), jnp.maximum(sizes[2], sizes[3])

    return [float(part) for part in evaluate(measure, g, eta, x)]


@lru_cache(maxsize=256)
def _require_affine(space: Space, group: LieGroup) -> None:
    bent, size = recalled(("affine", space, group), lambda: {"bend": _bend(space, group)})["bend"]
    if not bent <= 1e-9 * max(size, 1e-300):
        raise GroupError(
            f"The action of {group!r} on {space!r} must be affine in the point, but bends by {bent:.1e}: "
            "use co.spaces.Action(act, dim=…), or write the space inside a representation, as co.Sphere does."
        )


def _bend(space: Space, group: LieGroup) -> list[float]:
    """How far a motion of x + v is from that of x and of the tangent vector v, and its size."""
    g, x, v = random_motion(space, group)

    def measure(g: Element, x: Array, v: Array):
        moved = space.act(group, g, x + v) - space.act(group, g, x)
        return jnp.max(jnp.abs(moved - space.push(group, g, x, v)), initial=0.0), jnp.max(jnp.abs(moved), initial=0.0)

    return [float(part) for part in evaluate(measure, g, x, v)]


def checked_vector(value: Any, size: int, name: str) -> Array:
    """A finite float64 vector (size,); raises ArgumentError. Of a tracer, type and shape are checked."""
    if traced(value):
        value = float64(value, f"Argument `{name}`")
    shape = None
    with suppress(Exception):  # of an object that cannot be converted
        shape = np.shape(value)
    if shape is None or (shape != (size,) and not numeric(value)):
        raise ArgumentError(f"Argument `{name}` must hold {size} numbers, but is {shown(value)}.")
    remedy = checks.one_of_each(shape, (size,), name)
    if remedy:
        raise ArgumentError(f"Argument `{name}` must have shape ({size},), but has shape {shape}{remedy}.")
    return checks.array(value, f"Argument `{name}`", (size,))


def require_flat(space: Space, what: str, remedy: str) -> None:
    """Raise ArgumentError unless a space of additional dynamics is flat; what: needs it, remedy: what to take."""
    if not space.flat:
        raise ArgumentError(f"{what} needs a flat space of additional dynamics, but got {space!r}: {remedy}.")


def require_affine(space: Space, what: str, remedy: str) -> None:
    """Raise ArgumentError unless the action on a space of additional dynamics is affine; arguments as above."""
    if not space.affine:
        raise ArgumentError(f"{what} needs an affine action on q, but got {space!r}: {remedy}.")


class Embedded(Space):
    """A curved space in its ambient coordinates: velocities and momenta at x are in the span of its frame E(x)."""

    flat = False

    def frame(self, group: LieGroup, x: Array) -> Array:
        """E, an orthonormal basis of T_xQ, (ambient, dim)."""
        must_give(self, "frame")

    def tangent(self, group: LieGroup, x: Array, y: Array) -> Array:
        return self.frame(group, x) @ y

    def coordinates(self, group: LieGroup, x: Array, b: Array) -> Array:
        return self.frame(group, x).T @ b

    def momentum(self, group: LieGroup, x: Array, transported: Array, legendre: Array) -> Array:
        return self.project(group, x, legendre)
