"""Constraints of a system: functions φ(n, a) of its place, or rows A(n, a) on its velocities."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import LagrangianError
from coadjoint.mechanics.forces import INPUTS
from coadjoint.mechanics.reduced_functions import TRIVIAL, ReducedFunctions
from coadjoint.mechanics.signatures import keyword_only
from coadjoint.mechanics.traced_once import traced_once
from coadjoint.portable import Portable
from coadjoint.spaces.named import Named


class Site(NamedTuple):
    """Where constraints are evaluated: n (ambient,), a (dim V*,), t in s, and the inputs held there."""

    n: Array
    a: Array
    t: Scalar
    inputs: PyTree = None


@dataclass(frozen=True)
class Holonomic(Portable):
    """φ(n, a) = 0, m numbers, held at every node by a reaction that ℓ + ⟨λ, φ⟩ adds.

        pinned = co.System(…, constraints={"pin": co.Holonomic(lambda n, a, p: n + p.pin)})

    The reaction is the torque (∂_aφᵀλ)⋄a + (∂_nφᵀλ)⋄n and the force ∂_nφᵀλ, and the velocities satisfy
    φ̇ = ∂_tφ + ∂_nφ·(ν − ξ·n) − ∂_aφ·(ξ·a) = 0. Its power is −⟨λ, ∂_tφ⟩.

    function: a function of n, a, p, those that ℓ of the system takes, in this order, to m numbers, smooth; it may take
    keyword-only `t`, and `inputs` that are signals. size: m, by default found from the function; needed where it takes
    `inputs`. Raises ArgumentError and LagrangianError for others.
    """

    function: Callable[..., PyTree]
    size: int | None = None

    def __post_init__(self):
        _require(self, ("function",))


@dataclass(frozen=True)
class Nonholonomic(Portable):
    """A(n, a)·(ξ, ν) = b, m rows on the velocities, held by the reaction Aᵀλ.

        sleigh = co.System(co.SE2(), kinetic, constraints={"blade": co.Nonholonomic(lambda p: [[0, 0, 1]])})

    The reaction does the work ⟨λ, b⟩ per unit time, none where b = 0. Steps are reversible, but not symplectic: the
    energy of a generic system may drift.

    rows: a function of n, a, p, those that ℓ of the system takes, in this order, to A (m, dim G + ambient); it may take
    keyword-only `t`, and `inputs` that are signals. right: a function of the same arguments to b (m,), by default zero.
    size: m, by default found from the rows; needed where they take `inputs`. Raises ArgumentError and LagrangianError
    for others.
    """

    rows: Callable[..., PyTree]
    right: Callable[..., PyTree] | None = None
    size: int | None = None

    def __post_init__(self):
        _require(self, ("rows", "right") if self.right is not None else ("rows",))


Constraint = Holonomic | Nonholonomic


def _require(constraint: Constraint, functions: tuple[str, ...]) -> None:
    for name in functions:
        checks.function(getattr(constraint, name), name)
    if constraint.size is not None:
        checks.whole(constraint.size, "size")


@dataclass(frozen=True)
class Bound(Portable):
    """A constraint under its name in a system. size: its number of rows. moving: whether its reaction does work."""

    name: str
    constraint: Constraint
    size: int
    moving: bool = field(default=False)

    @property
    def holonomic(self) -> bool:
        """Whether it is one of the place."""
        return isinstance(self.constraint, Holonomic)

    @property
    def functions(self) -> list[Callable[..., PyTree]]:
        """The user's functions."""
        if isinstance(self.constraint, Holonomic):
            return [self.constraint.function]
        return [one for one in (self.constraint.rows, self.constraint.right) if one is not None]

    @property
    def takes_inputs(self) -> bool:
        """Whether one of the functions takes the keyword `inputs`."""
        return any(keyword_only(inspect.signature(f).parameters, INPUTS) for f in self.functions)

    def value(self, system: ReducedFunctions, at: Site) -> Array:
        """φ, (m,), of a holonomic constraint."""
        return places(system, [self], at)[0]

    def rate(self, system: ReducedFunctions, at: Site, xi: Array, nu: Array) -> Array:
        """φ̇, or A·(ξ, ν) − b, (m,); xi: (dim G,). nu: (ambient,)."""
        if self.holonomic:
            return place_rates(system, [self], at, xi, nu)[0]
        rows, right = self.rows(system, at)
        return rows @ jnp.concatenate([xi, nu]) - right

    def rows(self, system: ReducedFunctions, at: Site) -> tuple[Array, Array]:
        """A (m, dim G + ambient) and b (m,) of a nonholonomic constraint."""
        assert isinstance(self.constraint, Nonholonomic)
        width = system.group.dim + system.additional.ambient(system.group)
        rows = _numbers(called(system, self.constraint.rows, at), self._what, (self.size, width))
        if self.constraint.right is None:
            return rows, jnp.zeros(self.size)
        right = called(system, self.constraint.right, at)
        return rows, _numbers(right, f"The right side of the constraint `{self.name}`", (self.size,))

    def reaction(self, system: ReducedFunctions, at: Site, strength: Array) -> tuple[Array, Array]:
        """The torque (dim G,) and the force (ambient,) of multipliers λ (m,)."""
        if self.holonomic:
            return place_reactions(system, [self], at, [strength])
        (group, Q, _), dim = system.places, system.group.dim
        both = self.rows(system, at)[0].T @ strength
        return both[:dim], Q.project(group, at.n, both[dim:])

    def power(self, system: ReducedFunctions, at: Site, strength: Array) -> Array:
        """The power of the reaction, one number: −⟨λ, ∂_tφ⟩, or ⟨λ, b⟩."""
        if not self.moving:
            return jnp.zeros(())
        if not self.holonomic:
            return strength @ self.rows(system, at)[1]
        return -strength @ jax.jvp(lambda t: self.value(system, at._replace(t=t)), (at.t,), (jnp.ones_like(at.t),))[1]

    @property
    def _what(self) -> str:
        return f"The constraint `{self.name}`"


def places(system: ReducedFunctions, bounds: Sequence[Bound], at: Site) -> list[Array]:
    """φ of holonomic constraints, (m,) each."""
    given, found = _views(system, at), []
    for one in bounds:
        assert isinstance(one.constraint, Holonomic)
        value = called(system, one.constraint.function, at, given)
        found.append(_numbers(value, one._what, (one.size,)))
    return found


class PlaceSlopes(NamedTuple):
    """φ of holonomic constraints (m,) and ∂_nφ (m, ambient), ∂_aφ (m, dim V*), ∂_tφ (m,)."""

    value: Array
    by_n: Array
    by_a: Array
    by_t: Array


@traced_once
def place_slopes(system: ReducedFunctions, at: Site) -> list[PlaceSlopes]:
    """Those of each holonomic constraint of a system, from one derivative of all; ∂_tφ is zero of those that rest."""
    bounds = [one for one in system.constraints if one.holonomic]
    along = (0, 1, 2) if any(one.moving for one in bounds) else (0, 1)

    def values(n: Array, a: Array, t: Scalar) -> tuple[list[Array], list[Array]]:
        found = places(system, bounds, at._replace(n=n, a=a, t=t))
        return found, found

    slopes, found = jax.jacfwd(values, along, has_aux=True)(at.n, at.a, at.t)
    resting = len(along) == 2
    return [
        PlaceSlopes(value, by[0], by[1], jnp.zeros_like(value) if resting else by[2])
        for value, by in zip(found, slopes, strict=True)
    ]


def place_rates(system: ReducedFunctions, bounds: Sequence[Bound], at: Site, xi: Array, nu: Array) -> list[Array]:
    """φ̇ of holonomic constraints, (m,) each, from one derivative of all: along ṅ = ν − ξ·n, ȧ = −ξ·a, ṫ = 1."""
    group, Q, V = system.places
    moving = nu - Q.infinitesimal(group, xi, at.n), -V.infinitesimal(group, xi, at.a), jnp.ones_like(at.t)
    last = 3 if any(one.moving for one in bounds) else 2
    names = ("n", "a", "t")[:last]

    def values(*place: Array) -> list[Array]:
        return places(system, bounds, at._replace(**dict(zip(names, place, strict=True))))

    return jax.jvp(values, at[:last], moving[:last])[1]


def place_reactions(
    system: ReducedFunctions, bounds: Sequence[Bound], at: Site, strengths: list[Array]
) -> tuple[Array, Array]:
    """The torque Σ(∂_aφᵀλ)⋄a + (∂_nφᵀλ)⋄n and the force Σ∂_nφᵀλ of holonomic constraints with multipliers λ (m,)."""
    group, Q, V = system.places
    values = jax.vjp(lambda n, a: places(system, bounds, at._replace(n=n, a=a)), at.n, at.a)[1]
    along_n, along_a = values(strengths)
    torque = V.diamond(group, along_a, at.a) + Q.diamond(group, along_n, at.n)
    return torque, Q.project(group, at.n, along_n)


def _views(system: ReducedFunctions, at: Site) -> list[PyTree]:
    """n, a and p as the functions of constraints take them."""
    given = []
    if system.additional != TRIVIAL:
        given.append(system.additional.view(system.group, at.n))
    if system.advected != TRIVIAL:
        given.append(system.advected.view(system.group, at.a))
    return given if system.parameters is None else [*given, system.parameters]


def called(
    system: ReducedFunctions, function: Callable[..., PyTree], at: Site, given: list[PyTree] | None = None
) -> PyTree:
    given = _views(system, at) if given is None else given
    keywords = system.keywords(function, at.t, at.inputs, None)
    if keywords.get(INPUTS, at) is None:
        raise LagrangianError(
            "A constraint reads `inputs`, but there are none: give `inputs` to system.state, or take "
            "system.driven(inputs).project(state) where they are signals."
        )
    return function(*given, **keywords)


def stacked(value: Any, what: str) -> Array:
    """An array from an array, a number or lists of these."""
    if value is None:
        raise LagrangianError(f"{what} must return real numbers, but returns nothing.")
    if isinstance(value, (Mapping, Named)):
        raise LagrangianError(f"{what} must return real numbers in one array, but returns a dictionary.")
    if isinstance(value, (list, tuple)):
        value = jnp.stack([stacked(part, what) for part in value]) if value else jnp.zeros(0)
    array = jnp.asarray(value)
    if not jnp.issubdtype(array.dtype, jnp.number) or jnp.issubdtype(array.dtype, jnp.complexfloating):
        raise LagrangianError(f"{what} must return real numbers, but returns {array.dtype}.")
    return array


def _numbers(value: Any, what: str, shape: tuple[int, ...]) -> Array:
    """What a constraint returned as an array of this shape."""
    array = stacked(value, what)
    if array.ndim == len(shape) - 1 and shape[0] == 1:
        array = array[None]
    if array.shape != shape:
        words = "the rows A (m, dim G + ambient)" if len(shape) == 2 else "its numbers (m,)"
        raise LagrangianError(f"{what} must return {words} in the shape {shape}, but returns the shape {array.shape}.")
    return array if jnp.issubdtype(array.dtype, jnp.floating) else array.astype(float)
