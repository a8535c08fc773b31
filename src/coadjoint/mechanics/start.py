"""The state at the start, from configuration and velocities in the space frame."""

from __future__ import annotations

from collections.abc import Generator, Iterable
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, Coordinates, PyTree, Scalar
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.groups.group import Element
from coadjoint.kernels.run.disk_cache import evaluated, recalled
from coadjoint.kernels.trace.digest import TRACED_OUTSIDE
from coadjoint.kernels.trace.evaluate import evaluate, tabulate, traced
from coadjoint.kernels.trace.identity import Shapes
from coadjoint.mechanics.check import given
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.coupling import jacobian_solve
from coadjoint.mechanics.internal import starting_values
from coadjoint.mechanics.legendre import SOLVED, Place, improved, quadratic, velocities
from coadjoint.mechanics.members import Each, count_members, member_of, stacked
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.phase_space import linear
from coadjoint.mechanics.reduced_functions import ReducedFunctions
from coadjoint.mechanics.regularity import require_regular_hamiltonian
from coadjoint.mechanics.start_arguments import Checked, checked, checked_element, checked_members
from coadjoint.mechanics.state import State
from coadjoint.mechanics.trace_checks import in_words, require_scalar
from coadjoint.spaces.named import Named, require_names
from coadjoint.texts import Table

FROM_REST = 25
"""Newton's iterations for the velocities for given momenta."""


_given: ContextVar[bool] = ContextVar("starts are kept as they are given", default=False)


@dataclass(frozen=True, eq=False)
class StartGiven:
    """The arguments of `System.state`, for a state that is made later, with those of other members."""

    system: ReducedFunctions
    arguments: tuple[PyTree, ...]
    by_momenta: bool = False

    def state(self) -> State:
        """The state of these arguments."""
        return starting_state(self.system, *self.arguments, by_momenta=self.by_momenta)


@contextmanager
def starts_given(wanted: bool = True) -> Generator[None]:
    """Inside this context `System.state` returns its arguments, or, with False, states again."""
    token = _given.set(wanted)
    try:
        yield
    finally:
        _given.reset(token)


def starting_state(
    system: ReducedFunctions,
    g: Element,
    q: Coordinates | None,
    xi: Coordinates | None,
    qdot: Coordinates | None,
    a0: Coordinates | None,
    t: Scalar,
    inputs: PyTree,
    internal: PyTree,
    by_momenta: bool = False,
) -> State:
    """The state of `System.state`; with `co.each` among the arguments, of all members with a leading axis.

    by_momenta: `xi` and `qdot` are μ and π.
    """
    if _given.get():
        return StartGiven(system, (g, q, xi, qdot, a0, t, inputs, internal), by_momenta)  # type: ignore[return-value]
    inputs, internal = _held(system, inputs, internal)
    arguments = (g, q, qdot, xi, a0, t)
    count = count_members(arguments, internal)
    here = replace_parameters(system, member_of(system.parameters, 0))
    if count is None:
        values = checked(system, checked_element(system.group, g), *arguments[1:], by_momenta)
    else:
        count_members(arguments, internal, system.parameters)
        values = checked_members(system, arguments, count, by_momenta)
    if system.continuous:
        _, Q, V = system.places
        zeros = [np.zeros(space.ambient(system.group)) for space in (Q, Q, V)]
        _require_lagrangian(here, (np.zeros(system.group.dim), *zeros), inputs, member_of(internal, 0))
    state = _state_of(system, values, inputs, internal, count is not None, by_momenta)
    _require_momenta(here, state, count is not None, by_momenta)
    return state


def _held(system: ReducedFunctions, inputs: PyTree, internal: PyTree) -> tuple[PyTree, PyTree]:
    """The inputs and the internal state of a start, checked."""
    if any(isinstance(leaf, Each) for leaf in jax.tree.leaves(inputs)):
        raise ArgumentError(
            "Argument `inputs` has one value for all members, but was given co.each: make the values that differ "
            "parameters of the system, as in co.Parameters(name=co.each(…))."
        )
    if isinstance(inputs, dict):
        require_names(inputs)
        inputs = Parameters(**inputs)
    elif inputs is not None and not isinstance(inputs, Named):
        inputs = float64(inputs, "Argument `inputs`")
    internal = starting_values(internal)
    if internal is None and system.takes("internal"):
        raise ArgumentError(
            "A function of this system takes `internal`: give the internal state of the start, as in "
            "system.state(…, internal={name: value})."
        )
    return inputs, internal


def _state_of(
    system: ReducedFunctions, values: Checked, inputs: PyTree, internal: PyTree, many: bool, by_momenta: bool
) -> State:
    """n = g⁻¹q, ν = g⁻¹q̇, a = g⁻¹a₀ (P17), and (μ, π) of (ξ, ν) or the other way round; `many` have a leading axis."""
    group, Q, V = system.places

    def whole(given: Checked, internal: PyTree, moving: Iterable[Array]) -> State:
        ruled = internal is not None and system.internal is not None
        n, a, mu, pi, xi, nu = moving
        return State(
            given.t, given.g, n, a, mu, pi, xi, nu, inputs, internal, internal_mean=internal if ruled else None,
            internal_end=internal if ruled else None, internal_due=np.ones(np.shape(given.t)) if ruled else None,
            places=system.places, from_velocities=not by_momenta,
        )  # fmt: skip

    def moving(given: Checked, internal: PyTree, parameters: PyTree) -> tuple[Array, ...]:
        here = replace_parameters(system, parameters)
        back = group.inverse(given.g)
        n, a = Q.act(group, back, given.q), V.act(group, back, given.a0)
        if by_momenta:
            mu, pi = given.xi, Q.project(group, n, given.qdot)
            xi, nu = jnp.zeros_like(mu), jnp.zeros_like(pi)
            if system.continuous:
                xi, nu = of_momenta(here, whole(given, internal, (n, a, mu, pi, xi, nu)))
        else:
            xi, nu = given.xi, Q.push(group, back, given.q, given.qdot)
            mu, pi = legendre(here, xi, n, nu, a, given.t, inputs, internal)
        return n, a, mu, pi, xi, nu

    def made(given: Checked, internal: PyTree, parameters: PyTree) -> State:
        return whole(given, internal, moving(given, internal, parameters))

    remembered, internal_axes = stacked(internal)
    with in_words(given(system)[0]):
        try:
            if many:
                parameters, axes = stacked(system.parameters)
                return evaluate(jax.vmap(made, in_axes=(0, internal_axes, axes)), values, remembered, parameters)
            all_given = values, remembered, member_of(system.parameters, 0)
            state = whole(values, remembered, evaluated("start", moving, *all_given))
            return state if traced(all_given, inputs) else jax.tree.map(np.array, state)
        except jax.errors.TracerArrayConversionError as error:
            raise LagrangianError(TRACED_OUTSIDE) from error


def _require_momenta(system: ReducedFunctions, state: State, many: bool, by_momenta: bool) -> None:
    """Raise where velocities belong to no momentum of ℋ or to several, or momenta to no velocity."""
    if traced(state):
        return
    mu = np.zeros(1) if system.hamiltonian is None else np.sum(state.mu, axis=-1)
    if not np.all(np.isfinite(mu)):
        first = jax.tree.map(lambda leaf: leaf[np.argmin(np.isfinite(mu))], state) if many else state
        require_regular_hamiltonian(system, first)
    if system.hamiltonian is not None and not by_momenta and not many:
        _require_one_momentum(system, state)
    if by_momenta and not all(np.all(np.isfinite(rate)) for rate in (state.xi, state.nu)):
        first = jax.tree.map(lambda leaf: leaf[0], state) if many else state
        if linear(system, first):
            raise ArgumentError(
                "The momenta of a Lagrangian that is linear in the velocities are those of its place, ϑ(n, a): leave "
                "out `mu` and `pi`."
            )
        found = np.round(np.concatenate([state.mu, state.pi], axis=-1), 6).tolist()
        raise ArgumentError(
            f"Momenta must have velocities, but at (μ, π) = {found} none were found: look for a division by zero in "
            "the energy there."
        )


def of_momenta(system: ReducedFunctions, state: State) -> tuple[PyTree, PyTree]:
    """(ξ, ν) of (μ, π): ∂ℋ/∂(μ, π), or Newton's iteration for ∂ℓ/∂(ξ, ν) = (μ, π) from rest; NaN where it fails."""
    Q, group, dim = system.additional, system.group, system.group.dim
    given = jnp.concatenate([state.mu, Q.coordinates(group, state.n, state.pi)])

    def unpack(z: Array) -> tuple[PyTree, PyTree]:
        return z[:dim], Q.tangent(group, state.n, z[dim:])

    def momenta(z: Array) -> Array:
        xi, nu = unpack(z)
        mu, pi = legendre(system, xi, state.n, nu, state.a, state.t, state.inputs, state.internal)
        return jnp.concatenate([mu, Q.coordinates(group, state.n, pi)])

    if system.hamiltonian is not None:
        at = jnp.concatenate([state.mu, state.pi])
        place = Place(system, at, state.n, state.a, state.t, state.inputs, state.internal)
        found = velocities(at, place)
        return found[:dim], found[dim:]

    def improve(_: int, z: Array) -> Array:
        return z - jacobian_solve(system.places, momenta, z, momenta(z) - given)

    z = jax.lax.fori_loop(0, FROM_REST, improve, jnp.zeros_like(given))
    solved = jnp.max(jnp.abs(momenta(z) - given), initial=0.0) <= SOLVED * jnp.max(jnp.abs(given), initial=0.0)
    return unpack(jnp.where(solved, z, jnp.nan))


def _require_one_momentum(system: ReducedFunctions, state: State) -> None:
    """Raise ArgumentError where Newton's iteration from elsewhere finds other momenta with the same velocities."""
    place = Place(system, np.concatenate([state.xi, state.nu]), state.n, state.a, state.t, state.inputs, state.internal)
    if not len(place.z) or quadratic(place):
        return
    found = np.concatenate([state.mu, state.pi])
    size, random = 1.0 + float(np.max(np.abs(found))), np.random.default_rng(1788)
    improve = tabulate(lambda p: improved(place, p), found)
    starts = [-found, *(found + size * reach * random.normal(size=len(found)) for reach in (0.3, 1, 1, 3, 3, 10))]
    for p in starts:
        for _ in range(40):
            p, last = improve(p), p
            if not np.all(np.isfinite(p)) or np.max(np.abs(p - last)) <= SOLVED * size:
                break
        else:
            continue
        if np.all(np.isfinite(p)) and np.max(np.abs(p - found)) > 1e-6 * size:
            raise ArgumentError(
                f"The velocities must belong to one momentum, but belong to (μ, π) = {np.round(found, 6).tolist()} and "
                f"to {np.round(p, 6).tolist()}, and perhaps others: give the momentum itself, system.state(mu=…)."
            )


def _require_lagrangian(
    system: ReducedFunctions, arguments: tuple[object, ...], inputs: PyTree, internal: PyTree
) -> None:
    """Raise unless ℓ, or ℋ, is a number at these arguments; say where it only lacks its inputs."""
    what, function = given(system)

    def read() -> Table:
        require_scalar(partial(function, t=0.0, inputs=inputs, internal=internal), what, arguments)
        return {"numbers": []}

    try:
        recalled(("number", function, Shapes((arguments, inputs, internal))), read)
    except LagrangianError as error:
        if inputs is None and "'NoneType'" in str(error):
            raise ArgumentError(
                f"{what} of this system needs `inputs`: give those of the start, as in "
                "system.state(…, inputs={name: value})."
            ) from error
        raise


def momentum_start(system: ReducedFunctions, state: State) -> State:
    """(μ₀, π₀) by the continuous Legendre transform of (ξ, ν), for a state that was given by its velocities."""
    if not state.from_velocities:
        return state
    if not system.continuous:
        raise ArgumentError(
            'A system with only a discrete Lagrangian has no continuous Legendre transform: use start="velocity", '
            'as in co.Variational(co.Cayley(), start="velocity"), or give the state its momenta.'
        )

    def momenta(state: State, parameters: PyTree) -> tuple[Array, Array]:
        here = replace_parameters(system, parameters)
        return legendre(here, state.xi, state.n, state.nu, state.a, state.t, state.inputs, state.internal)

    mu, pi = evaluated("momenta", momenta, state, system.parameters)
    return state.replace(mu=mu, pi=pi, from_velocities=False)


def with_own_momenta(system: ReducedFunctions, start: State) -> State:
    """The start with the momenta that it shows, where inputs reach ℓ: those of (ξ, ν) with its own inputs.

    Of members, with the parameters of each. system: without the inputs of a run.
    """
    if not start.from_velocities or start.inputs is None or not system.takes("inputs"):
        return start
    count, many = count_members(system.parameters), np.ndim(start.t) > 0
    if count is None and not many:
        return momentum_start(system, start)
    parameters, axes = stacked(system.parameters)
    if count is not None and not many:
        start = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (count, *np.shape(leaf))), start)

    def begun(parameters: PyTree, state: State) -> State:
        return momentum_start(replace_parameters(system, parameters), state)

    return evaluate(jax.vmap(begun, in_axes=(axes, 0)), parameters, start)


def legendre(
    system: ReducedFunctions,
    xi: Array,
    n: Array,
    nu: Array,
    a: Array,
    t: Scalar = 0.0,
    inputs: PyTree = None,
    internal: PyTree = None,
    near: tuple[Array, Array] | None = None,
) -> tuple[PyTree, PyTree]:
    """μ = ∂_ξℓ, π = ∂_νℓ on T*Q; zero where the system has only a discrete Lagrangian.

    xi: (dim G,). n, nu: (ambient,). a: (dim V*,).
    near: (μ, π) from which the Legendre transform of ℋ is solved, as in `System.reduced_lagrangian`.
    """
    if not system.continuous:
        return jax.numpy.zeros_like(xi), jax.numpy.zeros_like(nu)
    return system.momenta(xi, n, nu, a, t, inputs, internal, near)
