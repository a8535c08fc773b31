"""The axioms of a user-defined space: its own forms equal the derived ones, and a curved one has the frame it
declares."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import GroupError
from coadjoint.groups.axioms import in_units, points, require_group
from coadjoint.groups.group import Element, LieGroup, transpose
from coadjoint.groups.opposite import Opposite
from coadjoint.groups.overrides import (
    Identity,
    in_words,
    overrides,
    own,
    parts,
    require_agreement,
    require_given,
    require_hashable,
    stamp,
)
from coadjoint.groups.semidirect_product import SemidirectProduct
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.spaces.by_inverse import ByInverse
from coadjoint.spaces.representations import Representation
from coadjoint.spaces.several import Several
from coadjoint.spaces.space import Space, random_motion, require_action

_SEARCH = 300
"""Newton steps to a point of a curved space."""
_ON_SPACE = 1e-12


def require_own_forms(group: LieGroup, *spaces: Space) -> None:
    """Raise GroupError where a class that does not ship gives a wrong form of a member; classes that ship are exempt.

    Every member that such a group or space overrides is compared with its derivation, once per class and configuration.
    """
    for piece in (*parts(group, LieGroup), group):
        require_hashable(piece)
        if isinstance(piece, SemidirectProduct):
            _require(piece.representation, piece.group)
        if _own(piece):
            require_group(piece, stamp(piece, LieGroup, Space))
    for space in spaces:
        _require(space, group)


def _require(space: Space, group: LieGroup) -> None:
    """`space` on `group`; one that ships and holds others only hands on to them."""
    if isinstance(space, ByInverse) and isinstance(group, Opposite):
        space, group = space.space, group.group
    if type(space) is Several:
        for part in space.factors:
            _require(part, group)
        return
    for piece in (*parts(space, Space), space):
        require_hashable(piece)
        hands_on = next(parts(piece, Space), None) is not None and not own(piece, Space)
        if not hands_on and (_own(piece) or _own(group)):
            require_space(piece, group, stamp(piece, LieGroup, Space), stamp(group, LieGroup, Space))


def _own(thing: object) -> bool:
    """Whether an object, or one of its parts, overrides a member."""
    kinds = LieGroup, Space
    inner = (part for kind in kinds for part in parts(thing, kind))
    base = LieGroup if isinstance(thing, LieGroup) else Space
    return bool(own(thing, base)) or any(map(_own, inner))


@lru_cache(maxsize=256)
def require_space(space: Space, group: LieGroup, *stamps: object) -> None:
    """Raise GroupError unless the space carries an action and its own forms equal the derived ones, relative 1e-9.

    `stamps` distinguish objects that compare equal.
    """
    require_given(space, Space, ("ambient", "act"))
    with in_words(f"`act` of {space!r} on {group!r}"):
        require_action(space, group)
        if isinstance(space, Representation):
            _require_linear(space, group)
    where = f" on {group!r}"
    at = _points(space, group)
    require_agreement(space, where, lambda *point: _actions(space, group, *point), at)
    if space.flat:
        require_agreement(space, where, lambda *point: _flat(space, group, *point), at)
    else:
        require_given(space, Space, ("dim", "tangent", "coordinates", "difference", "project", "momentum", "defect"))
        require_agreement(space, where, lambda *point: _curved(space, group, *point), at)


def _require_linear(space: Representation, group: LieGroup) -> None:
    """Raise GroupError unless act(g, x + y) = act(g, x) + act(g, y), as the forms of a representation need."""
    g, x, y = random_motion(space, group)

    def measure(g: Element, x: Array, y: Array) -> tuple[Array, Array]:
        both = space.act(group, g, x) + space.act(group, g, y)
        return jnp.max(jnp.abs(space.act(group, g, x + y) - both), initial=0.0), jnp.max(jnp.abs(both), initial=0.0)

    bent, size = map(float, evaluate(measure, g, x, y))
    if not bent <= 1e-9 * max(size, 1e-300):
        raise GroupError(
            f"The action of {group!r} on {space!r} must be linear, because its class is a Representation, but "
            f"act(g, x + y) − act(g, x) − act(g, y) is {bent:.1e}: inherit from co.spaces.Space for an affine "
            "action, and use co.spaces.Action(act, dim=…) for any other smooth one."
        )


def _points(space: Space, group: LieGroup) -> list[tuple[PyTree, ...]]:
    """(ξ, η, x, v, b, defect's unit) at random, with x on the space."""
    random = np.random.default_rng(1893)
    found = []
    for xi, eta, *_ in points(group):
        x, v, b = random.normal(size=(3, space.ambient(group)))
        on_space, unit = (x, 1.0) if space.flat else _nearest(space, group, x)
        found.append((xi, eta, on_space, v, b, np.float64(unit)))
    return found


def _nearest(space: Space, group: LieGroup, x: np.ndarray) -> tuple[np.ndarray, float]:
    """A point of the space from x by Newton's method for defect(x) = 0, and |∇defect||x| near it.

    Raises GroupError where that leads nowhere.
    """

    def both(x: Array) -> tuple[Array, Array]:
        return jax.value_and_grad(lambda x: jnp.asarray(space.defect(group, x), dtype=float))(x)

    best, nearest, unit = np.inf, x, 0.0
    with in_words(f"`defect` of {space!r}"):
        newton = tabulate(both, x)
        for _ in range(_SEARCH):
            off, slope = newton(x)
            if off < best:
                best, nearest = off, x
            square = float(slope @ slope)
            if off == 0 or not 0 < square < np.inf:
                break
            x = x - off * slope / square
        nearby = nearest + 0.1 * np.linalg.norm(nearest) / np.sqrt(max(len(x), 1))
        unit = np.linalg.norm(newton(nearby)[1]) * np.linalg.norm(nearby)
    if not best <= _ON_SPACE * unit:
        raise GroupError(
            f"No point of {space!r} was found from random ones by Newton's method for defect(x) = 0, so that its forms "
            "cannot be compared with the derived ones: correct `defect`, or give verify=False to co.System."
        )
    return nearest, float(unit)


def _frame(space: Space, group: LieGroup, x: Array) -> Array:
    """E_x (ambient, dim)."""
    dim, what = space.dim(group), f"`tangent` of {space!r} with `dim` = {space.dim(group)}"
    with in_words(what):
        E = jax.vmap(lambda y: space.tangent(group, x, y), out_axes=1)(jnp.eye(dim))
    checks.shape(E, what, (x.shape[0], dim), error=GroupError)
    return E


def _actions(
    space: Space, group: LieGroup, xi: Array, eta: Array, x: Array, v: Array, b: Array, unit: Array
) -> list[Identity]:
    """The forms that differentiation of the action gives."""
    g, (_, covector) = group.exp(eta), in_units(group)
    if not space.flat:
        E = _frame(space, group, x)
        v = E @ (E.T @ v)

    def derived(name: str, *arguments: object) -> Array:
        return getattr(Space, name)(space, group, *arguments)

    def both(name: str, says: str, *arguments: Any, measured: Any = lambda value: value) -> Identity:
        own = getattr(space, name)
        return Identity(
            name, says, lambda: measured(own(group, *arguments)), lambda: measured(derived(name, *arguments))
        )

    every = [
        both("push", "g·v = D act(g, x)·v", g, x, v),
        both("pull", "⟨g*b, v⟩ = ⟨b, g·v⟩", g, x, b),
        both("infinitesimal", "ξ·x = d/dε act(exp εξ, x)", xi, x),
        both("lifted", "L_ξ v = D(ξ·x)·v", xi, x, v),
        both("diamond", "⟨b⋄x, ξ⟩ = −⟨b, ξ·x⟩", b, x, measured=covector),
        both("lifted_diamond", "⟨b⋄v, ξ⟩ = −⟨b, L_ξ v⟩", b, x, v, measured=covector),
    ]
    return [identity for identity in every if overrides(space, Space, identity.member)]


def _flat(
    space: Space, group: LieGroup, xi: Array, eta: Array, x: Array, v: Array, b: Array, unit: Array
) -> list[Identity]:
    """A flat space is its own tangent space: its overrides change nothing."""
    size = np.float64(space.ambient(group))
    every = [
        Identity("dim", "dim = ambient on a flat space", lambda: np.float64(space.dim(group)), lambda: size),
        Identity("tangent", "E_x y = y on a flat space", lambda: space.tangent(group, x, v), lambda: v),
        Identity("coordinates", "E_xᵀb = b on a flat space", lambda: space.coordinates(group, x, b), lambda: b),
        Identity("difference", "ρ(x, u) − x = u on a flat space", lambda: space.difference(group, x, v), lambda: v),
        Identity("project", "that T*Q is everything on a flat space", lambda: space.project(group, x, b), lambda: b),
        Identity("momentum", "π = the transported one", lambda: space.momentum(group, x, v, b), lambda: v),
        Identity("defect", "0 on a flat space", lambda: 1 + jnp.asarray(space.defect(group, x)), lambda: np.ones(())),
    ]
    return [identity for identity in every if overrides(space, Space, identity.member)]


def _curved(
    space: Space, group: LieGroup, xi: Array, eta: Array, x: Array, v: Array, b: Array, unit: Array
) -> list[Identity]:
    """E_x is an orthonormal frame of T_xQ, ρ a retraction onto Q, π ∈ T*Q, and the group maps Q to itself."""
    dim, g = space.dim(group), group.exp(eta)
    E = _frame(space, group, x)
    y = E.T @ v
    u, zero, one = 0.2 * E @ y / (1 + jnp.sqrt(y @ y)), jnp.zeros_like(x), jnp.ones(())

    def off(x: Array) -> Array:
        return 1 + jnp.asarray(space.defect(group, x)) / unit

    def turned() -> Array:
        w = space.infinitesimal(group, xi, x)
        return w - E @ (E.T @ w)

    return [
        Identity(
            "tangent` and `dim",
            "EᵀE = 1 for the frame E_x = tangent(x, ·) of dim columns",
            lambda: E.T @ E,
            lambda: np.eye(dim),
        ),
        Identity(
            "act",
            "that g·x lies in the space with x, defect(g·x) = 0",
            lambda: off(space.act(group, g, x)),
            lambda: one,
        ),
        Identity("tangent", "E_xE_xᵀ(ξ·x) = ξ·x", lambda: 1 + turned(), lambda: 1 + zero),
        Identity(
            "coordinates",
            "E_xᵀb, the transpose of `tangent`",
            lambda: space.coordinates(group, x, b),
            lambda: transpose(lambda y: space.tangent(group, x, y), dim, b),
        ),
        Identity("difference", "ρ(x, 0) = x", lambda: 1 + space.difference(group, x, zero), lambda: 1 + zero),
        Identity(
            "difference",
            "Dρ(x, 0)·u = u",
            lambda: jax.jvp(lambda u: space.difference(group, x, u), (zero,), (u,))[1],
            lambda: u,
        ),
        Identity("difference", "defect(ρ(x, u)) = 0", lambda: off(x + space.difference(group, x, u)), lambda: one),
        Identity("project", "project(x, b) = E_xE_xᵀb", lambda: space.project(group, x, b), lambda: E @ (E.T @ b)),
        Identity(
            "momentum",
            "π = project(x, ∂ℓ/∂ν)",
            lambda: space.momentum(group, x, E @ (E.T @ b), b),
            lambda: E @ (E.T @ b),
        ),
    ]
