"""The projection of states onto the constraints of a system, as numbers and as a function that JAX differentiates."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.errors import ArgumentError
from coadjoint.kernels.float64 import require_scope
from coadjoint.kernels.trace.evaluate import tabulate, traced
from coadjoint.mechanics import inverse_legendre
from coadjoint.mechanics.constrained_start import ON, require_on, survey, surveyed
from coadjoint.mechanics.constraints import places
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.independent_rows import kept_rows
from coadjoint.mechanics.members import count_members, member_of
from coadjoint.mechanics.reactions import Independent, closing, kicked, node_rate, node_rates, rows_of, site, solved
from coadjoint.mechanics.reactions import count as rows_in
from coadjoint.mechanics.reduced_functions import ReducedFunctions
from coadjoint.mechanics.start import legendre
from coadjoint.mechanics.state import State
from coadjoint.mechanics.traced_once import tracing_once
from coadjoint.texts import Table

EPS = float(np.finfo(float).eps)

TRIPS = 40
"""Newton's iterations of a projection."""

DAMPING = 1e-7
"""The damping of the least impulse, relative to the trace of A M⁻¹Aᵀ, of which three rounds leave its third power."""


def projected(system: ReducedFunctions, state: State) -> State:
    """A state on the constraints, from one near it by least motions in the kinetic metric; see `System.project`."""

    members = count_members(system.parameters)
    if traced(state, system.parameters):
        if np.ndim(state.t) or members is not None:
            raise ArgumentError("co.each is for plain numbers: map System.project over members with jax.vmap.")
        require_scope("System.project")
        return _in_trace(system, state)
    if np.ndim(state.t) or members is not None:
        states = _members(state) if np.ndim(state.t) else [state] * (members or 1)
        if members is not None and members != len(states):
            raise ArgumentError(f"The system has {members} members, but the state has {len(states)}.")
        each = [projected(_member(system, k), one) for k, one in enumerate(states)]
        return jax.tree.map(lambda *leaves: np.stack(leaves), *each)

    with tracing_once():
        found, end = _nearest(system, state)
    try:
        require_on(system, end)
    except ArgumentError as error:
        said = str(error).partition(": take")[0]
        raise ArgumentError(
            f"No state on the constraints was found near this one: t{said[1:]}. Start nearer to one; constraints that "
            "contradict each other have none."
        ) from None
    return found


def _nearest(system: ReducedFunctions, state: State) -> tuple[State, Table]:
    """The state to which Newton's iterations lead, and its `surveyed`."""

    def of(function: Callable[[ReducedFunctions, State], State]) -> Callable[[State], State]:
        given = tabulate(lambda s, p: function(replace_parameters(system, p), s), state, system.parameters)
        return lambda s: given(s, system.parameters)

    survey(system, state)
    state, nearer = of(_at_node)(state), of(_nearer)
    for _ in range(TRIPS if any(one.holonomic for one in system.constraints) else 0):
        before, state = state, nearer(state)
        moved = max(np.max(np.abs(x - y), initial=0.0) for x, y in ((state.n, before.n), (state.a, before.a)))
        if moved <= 4 * EPS * max(np.max(np.abs(x), initial=0.0) for x in (state.n, state.a)):
            break
    found = of(_with_velocities)(state)
    return found, survey(system, found, known=True)[0]


def _in_trace(system: ReducedFunctions, state: State) -> State:
    """The same inside jit, grad or vmap, where all of Newton's iterations are made and none can fail.

    At a state on the constraints its derivative is the orthogonal projection onto their tangent space.
    """
    state = jax.tree.map(lambda leaf: jnp.asarray(leaf, float), _at_node(system, state))
    if any(one.holonomic for one in system.constraints):
        state = jax.lax.fori_loop(0, TRIPS, lambda _, near: _nearer(system, near), state)
    return _with_velocities(system, state)


def tangent_start(system: ReducedFunctions, state: State) -> tuple[State, Array | None, Array]:
    """A start inside jit, grad or vmap with derivatives along the constraints, its independent rows, and whether it is
    on the constraints.

    Its numbers stay; their derivatives are those of the projected start, so that a run has those of "project, then
    run". The rows are `kept_rows`, None of many links. As φ and A·(ξ, ν) − b vanish here, A M⁻¹Aᵀ has no part in the
    first derivatives; two iterations give the second ones too.
    """
    fixed, at = jax.lax.stop_gradient((system, state))
    found = surveyed(fixed, at)
    kept = None if rows_of(system) is not None or rows_in(system) == 1 else kept_rows(found["mobility"])
    distances = [*found["places"], found["rate"]]
    on = jnp.all(jnp.concatenate([gap <= ON * size for gap, size in distances]))

    def closing(gaps: Array, held: np.ndarray) -> Array:
        how = rows_of(system)
        if how is None:
            return -solved(_masked(found["mobility"], held), gaps, kept)
        nothing = jnp.zeros_like(gaps)
        return -how.jacobian_solve(lambda impulse: node_rate(fixed, kicked(fixed, at, impulse)), nothing, gaps)

    near, held = _at_node(system, state), _of_places(system)
    for _ in range(2 if np.any(held) else 0):
        motion = _motion(fixed, at, closing(_gaps(system, near), held))
        near = moved(system, near, *motion)
    near = _with_momenta(system, near)
    for _ in range(2):
        change = kicked(fixed, at, closing(node_rate(system, near), np.ones_like(held)))
        near = near.replace(mu=near.mu + change.mu - at.mu, pi=near.pi + change.pi - at.pi)
    names = ("g", "n", "a", "mu", "pi")

    def moving(here: Array, there: Array) -> Array:
        return jax.lax.stop_gradient(here) + (there - jax.lax.stop_gradient(there))

    both = ({name: getattr(one, name) for name in names} for one in (state, near))
    return state.replace(**jax.tree.map(moving, *both)), kept, on


def _members(state: State) -> list[State]:
    """The states of the members, one by one."""
    return [jax.tree.map(lambda leaf, k=k: leaf[k], state) for k in range(len(state.t))]


def _member(system: ReducedFunctions, k: int) -> ReducedFunctions:
    return replace_parameters(system, member_of(system.parameters, k))


def _at_node(system: ReducedFunctions, state: State) -> State:
    xi, nu, _ = inverse_legendre.velocities(system, state)
    return state.replace(xi=xi, nu=nu)


def _with_velocities(system: ReducedFunctions, state: State) -> State:
    """The state with the nearest velocities on the constraints."""
    state = _with_momenta(system, state)
    for _ in range(3):  # damping leaves some of the rates where rows are nearly dependent
        node = node_rates(system, state)
        state = kicked(system, state, _least(node.mobility, -node.rate))
    return _at_node(system, state)


def _with_momenta(system: ReducedFunctions, state: State) -> State:
    """The state with the momenta of its velocities."""
    mu, pi = legendre(system, state.xi, state.n, state.nu, state.a, state.t, state.inputs, state.internal)
    return state.replace(mu=mu, pi=pi)


def _nearer(system: ReducedFunctions, state: State) -> State:
    """One of Newton's iterations of a projection, with the velocities of the state."""
    state = _with_momenta(system, state)
    mobility = _masked(node_rates(system, state).mobility, _of_places(system), 0.0)
    return moved(system, state, *_motion(system, state, _least(mobility, -_gaps(system, state))))


def onto(system: ReducedFunctions, state: State, independent: Independent, iterations: int) -> State:
    """The state on the constraints near one with momenta that is close to them, as a pure function.

    Newton's iterations move (g, q) by the least motions in the kinetic metric, then the momenta get the impulse after
    which A·(ξ, ν) = b. At a state on the constraints its derivative projects onto their tangent space, after one
    iteration already. independent: the rows that are kept where some are redundant.
    """
    held = _of_places(system)
    for _ in range(iterations if np.any(held) else 0):
        mobility = _masked(node_rates(system, state).mobility, held)
        impulse = -solved(mobility, _gaps(system, state), independent)
        state = moved(system, state, *_motion(system, state, impulse))
    return kicked(system, state, closing(system, state, independent))


def _masked(matrix: Array, held: np.ndarray, other: float = 1.0) -> Array:
    """A M⁻¹Aᵀ (m, m) of the rows where `held` (m,) is 1, and `other` on the diagonal at the others."""
    return matrix if np.all(held) else matrix * np.outer(held, held) + other * np.diag(1 - held)


def _of_places(system: ReducedFunctions) -> np.ndarray:
    """1 at rows of holonomic constraints, 0 at others, (m,)."""
    return np.concatenate([np.full(one.size, float(one.holonomic)) for one in system.constraints])


def _gaps(system: ReducedFunctions, state: State) -> Array:
    """φ of holonomic constraints and 0 of others, (m,)."""
    found = iter(places(system, [one for one in system.constraints if one.holonomic], site(state)))
    return jnp.concatenate([next(found) if one.holonomic else jnp.zeros(one.size) for one in system.constraints])


def _motion(system: ReducedFunctions, state: State, impulse: Array) -> tuple[Array, Array]:
    """M⁻¹Aᵀλ of multipliers λ (m,): (dim G,) and (ambient,)."""

    def given(impulse: Array) -> tuple[Array, Array]:
        xi, nu, _ = inverse_legendre.velocities(system, kicked(system, state, impulse))
        return xi, nu

    return jax.jvp(given, (jnp.zeros_like(impulse),), (impulse,))[1]


def moved(system: ReducedFunctions, state: State, eta: Array, w: Array) -> State:
    """The state after a motion (η, w) of its place, (dim G,) and (ambient,), with its momenta."""
    group, Q, V = system.places
    F = group.exp(eta)
    back = group.inverse(F)
    n = Q.act(group, back, state.n + Q.difference(group, state.n, w))
    nu = Q.push(group, back, state.n, state.nu)
    return state.replace(
        g=state.g if state.g is None else group.compose(state.g, F),
        n=n,
        a=V.act(group, back, state.a),
        nu=nu if Q.flat else Q.project(group, n, nu),
    )


def _least(matrix: Array, right: Array) -> Array:
    """x with matrix x = right, both (m, …), of a positive matrix that may be singular: the least x, nearly.

    Round-off of `right` beyond the range of the matrix grows by the damping alone, also in derivatives.
    """
    damped = matrix + DAMPING * jnp.trace(matrix) * jnp.eye(len(matrix))
    x = jnp.linalg.solve(damped, right)
    for _ in range(2):
        x = x + jnp.linalg.solve(damped, right - matrix @ x)
    return x
