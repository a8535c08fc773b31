"""From what a person knows at the start — configuration and velocities in the space frame — to a state."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.groups import DirectProduct, LieGroup
from coadjoint.groups.group import Array, Element
from coadjoint.kernels.trace.digest import TRACED_OUTSIDE
from coadjoint.kernels.trace.evaluate import evaluate, tabulate, traced
from coadjoint.mechanics.check import given, require_regular_hamiltonian
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.each import Each, count_members, member_of, stacked
from coadjoint.mechanics.internal import starting_values
from coadjoint.mechanics.legendre import SOLVED, Place, improved, quadratic, velocities
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.reading import in_words, require_scalar
from coadjoint.mechanics.state import State
from coadjoint.spaces.named import Named, require_names
from coadjoint.spaces.numbers import float64
from coadjoint.spaces.space import checked_vector

if TYPE_CHECKING:
    from coadjoint.mechanics.system import System

ON_GROUP = 1e-9
"""How far outside its group an element may be by round-off."""

FROM_REST = 25
"""Newton's iterations for the velocities of momenta that are given."""

TANGENT = 1e-9
"""How far a velocity may leave its tangent space by round-off, relative to its size where that is over 1."""


class _Given(NamedTuple):
    """The arguments of `System.state`, checked: element and flat float64 arrays."""

    g: Element
    q: Array
    qdot: Array
    xi: Array
    a0: Array
    t: Array


def starting_state(system: System, g, q, xi, qdot, a0, t, inputs, internal, by_momenta: bool = False) -> State:
    """The state of `System.state`; with `co.each` among the arguments, of all members with a leading axis.

    by_momenta: `xi` and `qdot` are μ and π.
    """
    group, Q, V = system.places
    if isinstance(inputs, dict):
        require_names(inputs)
        inputs = Parameters(**inputs)
    elif inputs is not None and not isinstance(inputs, Named):
        inputs = float64(inputs, "Argument `inputs`")
    arguments = (g, q, qdot, xi, a0, t)
    internal = starting_values(internal)
    if internal is None and system.takes("internal"):
        raise ArgumentError(
            "A function of this system takes `internal`: give the internal state of the start, as in "
            "system.state(…, internal={name: value})."
        )
    count = count_members(arguments, internal)
    if count is None:
        parameters, axes = member_of(system.parameters, 0), None
    else:
        count_members(arguments, internal, system.parameters)
        parameters, axes = stacked(system.parameters)
    remembered, internal_axes = stacked(internal)
    here = replace_parameters(system, member_of(system.parameters, 0))
    if count is None:
        values = _check(system, checked_element(group, g), *arguments[1:], by_momenta)
    else:
        values = _check_members(system, arguments, count, by_momenta)
    if system.continuous:
        zeros = [np.zeros(space.ambient(group)) for space in (Q, Q, V)]
        _require_lagrangian(here, (np.zeros(group.dim), *zeros), inputs, member_of(internal, 0))

    def body(given: _Given, internal, parameters) -> State:
        system_ = replace_parameters(system, parameters)
        back = group.inverse(given.g)
        n, a = Q.act(group, back, given.q), V.act(group, back, given.a0)
        if by_momenta:
            mu, pi = given.xi, Q.project(group, n, given.qdot)
            xi, nu = jnp.zeros_like(mu), jnp.zeros_like(pi)
        else:
            xi, nu = given.xi, Q.push(group, back, given.q, given.qdot)
            mu, pi = legendre(system_, xi, n, nu, a, given.t, inputs, internal)
        made = State(
            given.t,
            given.g,
            n,
            a,
            mu,
            pi,
            xi,
            nu,
            inputs,
            internal,
            internal_time=None if internal is None or system.internal is None else given.t,
            places=system.places,
            from_velocities=not by_momenta,
        )
        if not by_momenta or not system.continuous:
            return made
        xi, nu = of_momenta(system_, made)
        return made.replace(xi=xi, nu=nu)

    made = body if count is None else jax.vmap(body, in_axes=(0, internal_axes, axes))
    with in_words(given(system)[0]):
        try:
            state = evaluate(made, values, remembered, parameters)
        except jax.errors.TracerArrayConversionError as error:
            raise LagrangianError(TRACED_OUTSIDE) from error
    mu = np.zeros(1) if system.hamiltonian is None or traced(state) else np.sum(state.mu, axis=-1)
    if not np.all(np.isfinite(mu)):
        first = state if count is None else jax.tree.map(lambda leaf: leaf[np.argmin(np.isfinite(mu))], state)
        require_regular_hamiltonian(here, first)
    if system.hamiltonian is not None and not by_momenta and count is None and not traced(state):
        _require_one_momentum(here, state)
    if by_momenta and not traced(state) and not np.all(np.isfinite(state.xi)):
        raise ArgumentError(
            f"Momenta must have velocities, but at μ = {np.round(state.mu, 6).tolist()} none were found: look for a "
            "division by zero in the energy there."
        )
    return state


def of_momenta(system: System, state: State) -> tuple[Any, Any]:
    """(ξ, ν) of (μ, π): ∂ℋ/∂(μ, π), or Newton's iteration for ∂ℓ/∂(ξ, ν) = (μ, π) from rest; NaN where it fails."""
    Q, group, dim = system.additional, system.group, system.group.dim
    given = jnp.concatenate([state.mu, Q.coordinates(group, state.n, state.pi)])

    def unpack(z: Array) -> tuple[Any, Any]:
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
        return z - jnp.linalg.solve(jax.jacfwd(momenta)(z), momenta(z) - given)

    z = jax.lax.fori_loop(0, FROM_REST, improve, jnp.zeros_like(given))
    solved = jnp.max(jnp.abs(momenta(z) - given), initial=0.0) <= SOLVED * jnp.max(jnp.abs(given), initial=0.0)
    return unpack(jnp.where(solved, z, jnp.nan))


def _require_one_momentum(system: System, state: State) -> None:
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


def _require_lagrangian(system: System, arguments: tuple[Any, ...], inputs: Any, internal: Any) -> None:
    """Raise unless ℓ, or ℋ, is a number at these arguments; say where it only lacks its inputs."""
    what, function = given(system)
    try:
        require_scalar(partial(function, t=0.0, inputs=inputs, internal=internal), what, arguments)
    except LagrangianError as error:
        if inputs is None and "'NoneType'" in str(error):
            raise ArgumentError(
                f"{what} of this system needs `inputs`: give those of the start, as in "
                "system.state(…, inputs={name: value})."
            ) from error
        raise


def _check(system: System, element: Element, q, qdot, xi, a0, t, by_momenta: bool = False) -> _Given:
    if by_momenta:
        size = system.additional.ambient(system.group)
        pi = np.zeros(size) if qdot is None else checked_vector(qdot, size, "pi")
        q, qdot = _pair(system, q, None)[0], pi
    else:
        q, qdot = _pair(system, q, qdot)
    xi = (
        np.zeros(system.group.dim) if xi is None else checked_vector(xi, system.group.dim, "mu" if by_momenta else "xi")
    )
    t = float64(t, "Argument `t`")
    if np.shape(t) != ():
        raise ArgumentError(f"Argument `t` must be one number (s), but has shape {np.shape(t)}.")
    return _Given(element, q, qdot, xi, _advected(system, a0), t)


def _check_members(system: System, arguments: tuple[Any, ...], count: int, by_momenta: bool = False) -> _Given:
    """All members, stacked; the group elements are checked together, because that is what takes time."""
    group = system.group
    if isinstance(arguments[-1], Each):
        raise ArgumentError("Argument `t` must be the same for all members: an ensemble has one time axis.")
    g, *others = arguments
    first = checked_element(group, member_of(g, 0))
    if isinstance(g, Each):
        elements = jax.tree.map(lambda leaf, values: np.asarray(values), first, g.values)
        outside = np.asarray(evaluate(jax.vmap(group.outside), elements))
        worst = int(np.argmax(outside))
        _require_inside(group, jax.tree.map(lambda leaf: leaf[worst], elements))
    else:
        elements = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (count, *leaf.shape)), first)
    rows = [_check(system, first, *member_of(others, index), by_momenta=by_momenta) for index in range(count)]
    stack = [np.stack([getattr(row, name) for row in rows]) for name in _Given._fields[1:]]
    return _Given(elements, *stack)


def momentum_start(system: System, state: State) -> State:
    """(μ₀, π₀) by the continuous Legendre transform of (ξ, ν), for a state that was given by its velocities."""
    if not state.from_velocities:
        return state
    if not system.continuous:
        raise ArgumentError(
            'A system with only a discrete Lagrangian has no continuous Legendre transform: use start="velocity", '
            'as in co.Variational(co.Cayley(), start="velocity"), or give the state its momenta.'
        )

    def momenta(state, parameters):
        here = replace_parameters(system, parameters)
        return legendre(here, state.xi, state.n, state.nu, state.a, state.t, state.inputs, state.internal)

    mu, pi = evaluate(momenta, state, system.parameters)
    return state.replace(mu=mu, pi=pi, from_velocities=False)


def with_own_momenta(system: System, start: State) -> State:
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

    def begun(parameters, state: State) -> State:
        return momentum_start(replace_parameters(system, parameters), state)

    return evaluate(jax.vmap(begun, in_axes=(axes, 0)), parameters, start)


def legendre(system: System, xi, n, nu, a, t=0.0, inputs=None, internal=None) -> tuple[Any, Any]:
    """μ = ∂_ξℓ, π = ∂_νℓ on T*Q; zero where the system has only a discrete Lagrangian."""
    if not system.continuous:
        return jax.numpy.zeros_like(xi), jax.numpy.zeros_like(nu)
    mu, pi = jax.grad(system.reduced_lagrangian, argnums=(0, 2))(xi, n, nu, a, t, inputs, internal)
    return mu, system.additional.project(system.group, n, pi)


def checked_element(group: LieGroup, g: Element) -> Element:
    """g as an element of the group with float64 leaves; raises ArgumentError for wrong shapes and for g outside G."""
    identity = evaluate(group.identity)
    if g is None:
        return identity
    leaves, structure = jax.tree.flatten(identity)
    if isinstance(g, list) and len(leaves) == 1:
        g = float64(g, "Argument `g`")
    given: list[Any] = []
    shapes = None
    with suppress(Exception):
        given = structure.flatten_up_to(g)
        shapes = [np.shape(leaf) for leaf in given]
    expected = [leaf.shape for leaf in leaves]
    if shapes != expected:
        raise ArgumentError(
            f"Argument `g` must be an element of {group!r}, arrays of shape {', '.join(map(str, expected))}, "
            f"but has {'another structure' if shapes is None else 'shape ' + ', '.join(map(str, shapes))}."
        )
    element = jax.tree.unflatten(structure, [float64(leaf, "Argument `g`") for leaf in given])
    if not traced(element):
        _require_inside(group, element)
    return element


def _require_inside(group: LieGroup, element: Element) -> None:
    if float(evaluate(group.outside, element)) <= ON_GROUP:
        return
    whole, of = group, ""
    while isinstance(group, DirectProduct):
        parts = zip(group.factors, element, strict=True)
        group, element = next(pair for pair in parts if float(evaluate(pair[0].outside, pair[1])) > ON_GROUP)
        of = f" in its factor {group!r}"
    off = float(evaluate(group.defect if group.constrained else group.outside, element))
    why = "the determinant is −1" if off <= ON_GROUP else f"the defining equations fail by {off:.2g}"
    raise ArgumentError(f"Argument `g` must lie in {whole!r}, but{of} {why}; for a rotation, make it by co.attitude.")


def _pair(system: System, q: Any, qdot: Any) -> tuple[Any, Any]:
    group, Q = system.group, system.additional
    size = Q.ambient(group)
    if size == 0:
        if q is not None or qdot is not None:
            raise ArgumentError("This system has no additional dynamics: leave out `q` and `qdot`.")
        return np.zeros(0), np.zeros(0)
    if q is None:
        raise ArgumentError(
            f"This system has additional dynamics: give `q`, shape ({size},), and `qdot` unless at rest."
        )
    point = Q.point(group, q, "q")
    if qdot is None:
        return point, np.zeros(size)
    velocity = Q.velocity(group, qdot, "qdot")
    _require_tangent(system, point, velocity)
    return point, velocity


def _require_tangent(system: System, point: Array, velocity: Array) -> None:
    """Raise ArgumentError where q̇ leaves T_qQ: E_q E_qᵀ q̇ = q̇ for the orthonormal frame E_q."""
    group, Q = system.group, system.additional
    if Q.flat or traced(point, velocity):
        return
    within = evaluate(lambda x, v: Q.tangent(group, x, Q.coordinates(group, x, v)), point, velocity)
    leaves = float(np.max(np.abs(velocity - within)))
    if leaves > TANGENT * max(1.0, float(np.max(np.abs(velocity)))):
        raise ArgumentError(
            f"Argument `qdot` must be tangent to the space at `q`, but leaves it by {leaves:.3g}: take away its part "
            "along the normal."
        )


def _advected(system: System, a0: Any) -> Array:
    group, V = system.group, system.advected
    if V.ambient(group) == 0:
        if a0 is not None:
            raise ArgumentError("This system has no advected parameters: leave out `a0`.")
        return np.zeros(0)
    if a0 is None:
        raise ArgumentError(f"This system has advected parameters: give `a0`, {V.ambient(group)} numbers in all.")
    return V.point(group, a0, "a0")
