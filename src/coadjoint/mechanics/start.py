"""From what a person knows at the start — configuration and velocities in the space frame — to a state."""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from typing import Any, NamedTuple

import jax
import numpy as np

from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.groups import DirectProduct, LieGroup
from coadjoint.kernels.digest import TRACED_OUTSIDE
from coadjoint.kernels.evaluate import evaluate, traced
from coadjoint.mechanics.check import given, require_regular_hamiltonian, require_scalar
from coadjoint.mechanics.each import Each, count_members, member_of, stacked
from coadjoint.mechanics.internal import starting_values
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System, replace_parameters
from coadjoint.spaces.numbers import float64
from coadjoint.spaces.space import checked_vector

ON_GROUP = 1e-9
"""How far outside its group an element may be by round-off."""

TANGENT = 1e-9
"""How far a velocity may leave its tangent space by round-off, relative to its size where that is over 1."""


class _Given(NamedTuple):
    """The arguments of `System.state`, checked: element and flat float64 arrays."""

    g: Any
    q: Any
    qdot: Any
    xi: Any
    a0: Any
    t: Any


def starting_state(system: System, g, q, xi, qdot, a0, t, inputs, internal) -> State:
    """The state of `System.state`; with `co.each` among the arguments, of all members with a leading axis."""
    group, Q, V = system.places
    inputs = Parameters(**inputs) if isinstance(inputs, dict) else inputs
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
        values = _check(system, checked_element(group, g), *arguments[1:])
    else:
        values = _check_members(system, arguments, count)
    if system.continuous:
        zeros = [np.zeros(space.ambient(group)) for space in (Q, Q, V)]
        _require_lagrangian(here, (np.zeros(group.dim), *zeros), inputs, member_of(internal, 0))

    def body(given: _Given, internal, parameters) -> State:
        system_ = replace_parameters(system, parameters)
        back = group.inverse(given.g)
        n, nu = Q.act(group, back, given.q), Q.push(group, back, given.q, given.qdot)
        a = V.act(group, back, given.a0)
        mu, pi = legendre(system_, given.xi, n, nu, a, given.t, inputs, internal)
        return State(
            given.t,
            given.g,
            n,
            a,
            mu,
            pi,
            given.xi,
            nu,
            inputs,
            internal,
            internal_time=None if internal is None or system.internal is None else given.t,
            places=system.places,
            from_velocities=True,
        )

    made = body if count is None else jax.vmap(body, in_axes=(0, internal_axes, axes))
    try:
        state = evaluate(made, values, remembered, parameters)
    except jax.errors.TracerArrayConversionError as error:
        raise LagrangianError(TRACED_OUTSIDE) from error
    mu = np.zeros(1) if system.hamiltonian is None or traced(state) else np.sum(state.mu, axis=-1)
    if not np.all(np.isfinite(mu)):
        first = state if count is None else jax.tree.map(lambda leaf: leaf[np.argmin(np.isfinite(mu))], state)
        require_regular_hamiltonian(here, first)
    return state


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


def _check(system: System, element: Any, q, qdot, xi, a0, t) -> _Given:
    q, qdot = _pair(system, q, qdot)
    xi = np.zeros(system.group.dim) if xi is None else checked_vector(xi, system.group.dim, "xi")
    return _Given(element, q, qdot, xi, _advected(system, a0), float64(t, "Argument `t`"))


def _check_members(system: System, arguments: tuple[Any, ...], count: int) -> _Given:
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
    rows = [_check(system, first, *member_of(others, index)) for index in range(count)]
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


def legendre(system: System, xi, n, nu, a, t=0.0, inputs=None, internal=None) -> tuple[Any, Any]:
    """μ = ∂_ξℓ, π = ∂_νℓ on T*Q; zero where the system has only a discrete Lagrangian."""
    if not system.continuous:
        return jax.numpy.zeros_like(xi), jax.numpy.zeros_like(nu)
    mu, pi = jax.grad(system.reduced_lagrangian, argnums=(0, 2))(xi, n, nu, a, t, inputs, internal)
    return mu, system.additional.project(system.group, n, pi)


def checked_element(group: LieGroup, g: Any) -> Any:
    """g as an element of the group with float64 leaves; raises ArgumentError for wrong shapes and for g outside G."""
    identity = evaluate(group.identity)
    if g is None:
        return identity
    leaves, structure = jax.tree.flatten(identity)
    if isinstance(g, list) and len(leaves) == 1:
        g = float64(g, "Argument `g`")
    given: list[Any] = []
    shapes = None
    with suppress(TypeError, ValueError):
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


def _require_inside(group: LieGroup, element: Any) -> None:
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


def _require_tangent(system: System, point: Any, velocity: Any) -> None:
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


def _advected(system: System, a0: Any) -> Any:
    group, V = system.group, system.advected
    if V.ambient(group) == 0:
        if a0 is not None:
            raise ArgumentError("This system has no advected parameters: leave out `a0`.")
        return np.zeros(0)
    if a0 is None:
        raise ArgumentError(f"This system has advected parameters: give `a0`, {V.ambient(group)} numbers in all.")
    return V.point(group, a0, "a0")
