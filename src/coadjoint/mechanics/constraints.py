"""Constraints of a system: functions φ(n, a) of its place, or rows A(n, a) on its velocities."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError, LagrangianError, shown
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.forces import INPUTS, INTERNAL, TIME, UNNAMED
from coadjoint.mechanics.members import member_of
from coadjoint.mechanics.reduced_functions import TRIVIAL, ReducedFunctions
from coadjoint.mechanics.signatures import keyword_only, require_signature
from coadjoint.mechanics.trace_checks import in_words
from coadjoint.portable import Portable


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
    def budgeted(self) -> bool:
        """Whether its reaction has a line in the energy budget: it may do work or change a spatial momentum."""
        return self.moving or not self.holonomic

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
        assert isinstance(self.constraint, Holonomic)
        return _numbers(_called(system, self.constraint.function, at), self._what, (self.size,))

    def rate(self, system: ReducedFunctions, at: Site, xi: Array, nu: Array, moving: Moving | None = None) -> Array:
        """φ̇, or A·(ξ, ν) − b, (m,); xi: (dim G,). nu: (ambient,). moving: `moving_at` these, where it is known."""
        if not self.holonomic:
            rows, right = self.rows(system, at)
            return rows @ jnp.concatenate([xi, nu]) - right
        moving = moving or moving_at(system, at, xi, nu)
        if not self.moving:
            return jax.jvp(lambda n, a: self.value(system, at._replace(n=n, a=a)), (at.n, at.a), moving[:2])[1]
        return jax.jvp(lambda n, a, t: self.value(system, at._replace(n=n, a=a, t=t)), at[:3], moving)[1]

    def rows(self, system: ReducedFunctions, at: Site) -> tuple[Array, Array]:
        """A (m, dim G + ambient) and b (m,) of a nonholonomic constraint."""
        assert isinstance(self.constraint, Nonholonomic)
        width = system.group.dim + system.additional.ambient(system.group)
        rows = _numbers(_called(system, self.constraint.rows, at), self._what, (self.size, width))
        if self.constraint.right is None:
            return rows, jnp.zeros(self.size)
        right = _called(system, self.constraint.right, at)
        return rows, _numbers(right, f"The right side of the constraint `{self.name}`", (self.size,))

    def reaction(self, system: ReducedFunctions, at: Site, strength: Array) -> tuple[Array, Array]:
        """The torque (dim G,) and the force (ambient,) of multipliers λ (m,)."""
        (group, Q, _), dim = system.places, system.group.dim
        if self.holonomic:
            return reaction_along(system, at, *self.along(system, at, strength))
        both = self.rows(system, at)[0].T @ strength
        return both[:dim], Q.project(group, at.n, both[dim:])

    def along(self, system: ReducedFunctions, at: Site, strength: Array) -> tuple[Array, Array]:
        """∂_nφᵀλ (ambient,) and ∂_aφᵀλ (dim V*,) of multipliers λ (m,) of a holonomic constraint."""
        return jax.vjp(lambda n, a: self.value(system, at._replace(n=n, a=a)), at.n, at.a)[1](strength)

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


Moving = tuple[Array, Array, Scalar]


def moving_at(system: ReducedFunctions, at: Site, xi: Array, nu: Array) -> Moving:
    """ṅ = ν − ξ·n, ȧ = −ξ·a and ṫ = 1 at velocities xi (dim G,) and nu (ambient,)."""
    group, Q, V = system.places
    return nu - Q.infinitesimal(group, xi, at.n), -V.infinitesimal(group, xi, at.a), jnp.ones_like(at.t)


def reaction_along(system: ReducedFunctions, at: Site, along_n: Array, along_a: Array) -> tuple[Array, Array]:
    """The torque ∂_aφᵀλ⋄a + ∂_nφᵀλ⋄n (dim G,) and the force ∂_nφᵀλ (ambient,), from these derivatives."""
    group, Q, V = system.places
    torque = V.diamond(group, along_a, at.a) + Q.diamond(group, along_n, at.n)
    return torque, Q.project(group, at.n, along_n)


def constraints_from(given: Any) -> tuple[tuple[str, Constraint], ...]:
    """The names and constraints of a dictionary; raises ArgumentError for anything else."""
    if given is None:
        return ()
    if not isinstance(given, Mapping) or not given:
        raise ArgumentError(
            "Argument `constraints` must be a dictionary of names and constraints, such as "
            f'{{"pin": co.Holonomic(function)}}, but is {shown(given)}.'
        )
    for name, constraint in given.items():
        if not isinstance(name, str) or not name.isidentifier() or name in (TIME, INPUTS, INTERNAL, UNNAMED, "step"):
            raise ArgumentError(
                "The name of a constraint must be a word such as 'pin', other than `time`, `inputs`, `internal`, "
                f"`forces` and `step`, but is {shown(name)}."
            )
        if not isinstance(constraint, (Holonomic, Nonholonomic)):
            raise ArgumentError(
                f"The constraint `{name}` must be co.Holonomic(function) or co.Nonholonomic(rows), but is "
                f"{shown(constraint)}."
            )
    return tuple(given.items())


def require_free(system: ReducedFunctions, what: str) -> None:
    """Raise ArgumentError for a system with constraints, where `what` would leave out its reactions."""
    if system.constraints:
        raise ArgumentError(
            f"{what} would leave out the reactions of the constraints of `{system.name}`: describe the system in "
            "minimal coordinates, such as the angles of its joints, which need no constraints."
        )


def bound(system: ReducedFunctions, given: tuple[tuple[str, Constraint], ...]) -> tuple[Bound, ...]:
    """The constraints of a system, checked, with their numbers of rows; raises LagrangianError and ArgumentError."""
    if not given:
        return ()
    forces = set(system.forces.names) if system.forces is not None else set()
    found = tuple(_bound(system, name, constraint) for name, constraint in given)
    if doubled := forces.intersection(one.name for one in found):
        raise ArgumentError(
            f"A force and a constraint must have different names, but both are called `{doubled.pop()}`."
        )
    free, size = system.unknowns, sum(one.size for one in found)
    if not free:
        raise ArgumentError("A system whose group and additional space have no dimensions cannot have constraints.")
    if not system.continuous:
        raise LagrangianError(
            "Constraints need velocities at nodes: give the system a `lagrangian` or a `hamiltonian`."
        )
    if len(found) == 1 and size > free:
        raise ArgumentError(
            f"The constraint `{found[0].name}` has {size} rows, more than the {free} velocities of the system: leave "
            "out the dependent ones."
        )
    return found


def _bound(system: ReducedFunctions, name: str, constraint: Constraint) -> Bound:
    what, expected = f"The constraint `{name}`", _arguments(system)
    unsized = Bound(name, constraint, 0)
    functions, takes_inputs = unsized.functions, unsized.takes_inputs
    for function in functions:
        require_signature(function, what, expected)
        if keyword_only(inspect.signature(function).parameters, INTERNAL):
            raise LagrangianError(f"{what} cannot take `internal`: the place that it demands would jump at nodes.")
    in_time = takes_inputs or any(keyword_only(inspect.signature(f).parameters, "t") for f in functions)
    moving = in_time if isinstance(constraint, Holonomic) else constraint.right is not None
    size = constraint.size
    if size is None:
        if takes_inputs:
            raise ArgumentError(f"{what} takes `inputs`, which come with a run: give its number of rows as `size`.")
        size = _size(system, what, constraint)
    made = Bound(name, constraint, size, moving)
    if not takes_inputs:
        at = _zeros(system)
        check = made.value if made.holonomic else made.rows
        with in_words(what), jax.enable_x64(True):
            jax.eval_shape(lambda at: check(_shaped(system), at), at)
    return made


def _arguments(system: ReducedFunctions) -> list[str]:
    names = ["n"] if system.additional != TRIVIAL else []
    names += ["a"] if system.advected != TRIVIAL else []
    return names + (["p"] if system.parameters is not None else [])


def _zeros(system: ReducedFunctions) -> Site:
    group, Q, V = system.places
    return Site(np.zeros(Q.ambient(group)), np.zeros(V.ambient(group)), np.zeros(()))


def _shaped(system: ReducedFunctions) -> Any:
    """The system with the parameters of one member."""
    return replace_parameters(system, member_of(system.parameters, 0))


def _size(system: ReducedFunctions, what: str, constraint: Constraint) -> int:
    """The number of rows that a constraint returns."""
    function = constraint.function if isinstance(constraint, Holonomic) else constraint.rows
    with in_words(what), jax.enable_x64(True):
        shape = jax.eval_shape(lambda at: _stacked(_called(_shaped(system), function, at), what), _zeros(system)).shape
    if isinstance(constraint, Holonomic):
        if len(shape) > 1:
            raise LagrangianError(f"{what} must return a number or a row of numbers, but returns the shape {shape}.")
        size = shape[0] if shape else 1
    else:
        size = shape[0] if len(shape) == 2 else 1
    if not size:
        raise LagrangianError(f"{what} returns no numbers: leave it out.")
    return size


def _called(system: ReducedFunctions, function: Callable[..., PyTree], at: Site) -> PyTree:
    arguments = []
    if system.additional != TRIVIAL:
        arguments.append(system.additional.view(system.group, at.n))
    if system.advected != TRIVIAL:
        arguments.append(system.advected.view(system.group, at.a))
    if system.parameters is not None:
        arguments.append(system.parameters)
    return function(*arguments, **system.keywords(function, at.t, at.inputs, None))


def _stacked(value: Any, what: str) -> Array:
    """An array from an array, a number or lists of these."""
    if value is None:
        raise LagrangianError(f"{what} must return real numbers, but returns nothing.")
    if isinstance(value, (list, tuple)):
        value = jnp.stack([_stacked(part, what) for part in value]) if value else jnp.zeros(0)
    array = jnp.asarray(value)
    if not jnp.issubdtype(array.dtype, jnp.number) or jnp.issubdtype(array.dtype, jnp.complexfloating):
        raise LagrangianError(f"{what} must return real numbers, but returns {array.dtype}.")
    return array


def _numbers(value: Any, what: str, shape: tuple[int, ...]) -> Array:
    """What a constraint returned as an array of this shape."""
    array = _stacked(value, what)
    if array.ndim == len(shape) - 1 and shape[0] == 1:
        array = array[None]
    if array.shape != shape:
        words = "the rows A (m, dim G + ambient)" if len(shape) == 2 else "its numbers (m,)"
        raise LagrangianError(f"{what} must return {words} in the shape {shape}, but returns the shape {array.shape}.")
    return array if jnp.issubdtype(array.dtype, jnp.floating) else array.astype(float)
