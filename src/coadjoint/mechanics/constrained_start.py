"""States on the constraints of a system: whether one is, the nearest one, and which rows are redundant."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate, tabulate, traced
from coadjoint.kernels.trace.jaxprs import depends
from coadjoint.mechanics import inverse_legendre
from coadjoint.mechanics.constraints import Bound, place_slopes, places
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.members import count_members, member_of
from coadjoint.mechanics.momentum_sizes import largest
from coadjoint.mechanics.reactions import Independent, closing, kicked, node_rates, parts, rate, rows_of, site
from coadjoint.mechanics.reduced_functions import ReducedFunctions
from coadjoint.mechanics.start import legendre
from coadjoint.mechanics.state import State
from coadjoint.mechanics.trace_checks import require_float64
from coadjoint.mechanics.traced_once import tracing_once
from coadjoint.texts import Table

EPS = float(np.finfo(float).eps)

ON = 1e-9
"""The distance from a constraint, relative to the terms that cancel in it, up to which a start is on it."""

DEPENDENT = 1e-11
"""The smallest eigenvalue of A M⁻¹Aᵀ in units of its diagonal, relative to the largest, of an independent row."""

APART = 0.1
"""What rows that were taken leave of the diagonal of A M⁻¹Aᵀ, relative to it, at a row that is taken in its order."""

TRIPS = 40
"""Newton's iterations of a projection."""


def checked_start(system: ReducedFunctions, state: State) -> Independent:
    """The places of rows of which all others follow at a start, None where none does.

    Raises ArgumentError unless the state satisfies all constraints, and where a row does not depend on the velocities;
    LagrangianError where a constraint is not pure.
    """
    found, independent = _survey(system, state)
    require_on(system, found)
    return independent


def _survey(system: ReducedFunctions, state: State, known: bool = False) -> tuple[Table, Independent]:
    """`surveyed` of a state, and the places of rows of which all others follow. known: the functions were checked."""
    for one in () if known else system.constraints:
        read = one.value if one.holonomic else one.rows
        require_float64(lambda s, read=read: read(system, site(s)), f"The constraint `{one.name}`", (state,))
    found = evaluate(lambda s, p: surveyed(replace_parameters(system, p), s), state, system.parameters)
    return found, None if rows_of(system) is not None else _independent(system, found["rows"], found["mobility"])


def require_members_on_constraints(system: ReducedFunctions, parameters: PyTree, axes: PyTree, states: State) -> None:
    """Raise ArgumentError unless the states of all members satisfy all constraints, and their rows are independent.

    parameters: a tree with an axis of members where `axes`, a tree like it, is 0. states: (members, …) each.
    """

    survey = jax.vmap(lambda p, s: surveyed(replace_parameters(system, p), s), in_axes=(axes, 0))
    found = evaluate(survey, parameters, states)
    require_on(system, found)
    if any(_rank(matrix) < len(matrix) for matrix in found["mobility"] if len(matrix)):
        raise ArgumentError(
            "The members of an ensemble need independent constraints, but some rows follow from others at the start: "
            "leave these out, or take joints that hold less, such as `spherical` and `cylindrical` for two of the four "
            "hinges of a planar loop."
        )


def require_on(system: ReducedFunctions, found: Mapping[str, PyTree], whose: str = "the start") -> None:
    """Raise ArgumentError where a distance from a constraint, of `surveyed`, is not round-off; arrays may have an axis
    of members."""
    for (one, part), (gap, size) in zip(parts(system), found["places"], strict=True):
        if np.any(~(gap <= ON * size)):
            raise ArgumentError(
                f"{whose[0].upper()}{whose[1:]} must satisfy the constraint `{one.name}`, but |φ| is "
                f"{np.max(gap):.3g}: take system.project(start), or other values."
            )
        gap, size = (x[..., part] for x in found["rate"])
        if np.any(~(gap <= ON * size)):
            what = "|φ̇|" if one.holonomic else "|A·(ξ, ν) − b|"
            raise ArgumentError(
                f"The velocities of {whose} must satisfy the constraint `{one.name}`, but {what} is "
                f"{np.max(gap):.3g}: take system.project(start), or other velocities."
            )


def parameters_read(system: ReducedFunctions, state: State) -> set[str]:
    """The names of the parameters that constraints read, with those of their entries: a state stays on the constraints
    when others change."""

    def values(parameters: PyTree) -> list[PyTree]:
        here, at = replace_parameters(system, parameters), site(state)
        bounds = [one for one in system.constraints if not one.takes_inputs]
        return [one.value(here, at) if one.holonomic else one.rows(here, at) for one in bounds]

    leaves = jax.tree_util.tree_leaves_with_path(system.parameters)
    used = depends(values, system.parameters)
    names = [jax.tree_util.keystr(path).lstrip(".") for (path, _), reads in zip(leaves, used, strict=True) if reads]
    return {name for full in names for name in (full, full.partition(".")[0])}


def surveyed(system: ReducedFunctions, state: State) -> dict[str, PyTree]:
    """|φ| of each constraint and |A·(ξ, ν) − b|, with the size of the terms in them, and A M⁻¹Aᵀ."""
    if rows_of(system) is not None:
        return _surveyed_links(system, state)
    at, node, dim = site(state), node_rates(system, state), system.group.dim
    group, Q, V = system.places
    turned = [
        jax.vmap(lambda xi, space=space, x=x: space.infinitesimal(group, xi, x), out_axes=1)(jnp.eye(dim))
        for space, x in ((Q, at.n), (V, at.a))
    ]
    held = iter(place_slopes(system, at))

    def of(one: Bound) -> tuple[Array, Array, Array, Array]:
        """|φ|, the size of its terms, A, and φ̇ or A·(ξ, ν) − b at rest."""
        if not one.holonomic:
            rows, right = one.rows(system, at)
            return jnp.zeros(one.size), jnp.ones(one.size), rows, -right
        value, by_n, by_a, by_t = next(held)
        size = jnp.abs(by_n) @ (jnp.abs(at.n) + 1e-3) + jnp.abs(by_a) @ (jnp.abs(at.a) + 1e-3)
        rows = jnp.concatenate([-by_n @ turned[0] - by_a @ turned[1], by_n], axis=1)
        return jnp.abs(value), size, rows, by_t

    gaps, terms, rows, rest = zip(*map(of, system.constraints), strict=True)
    A, v = jnp.concatenate(rows), jnp.concatenate([node.velocities.xi, node.velocities.nu])
    size = jnp.abs(A) @ (jnp.abs(v) + 1e-3) + jnp.abs(jnp.concatenate(rest))
    gaps = list(zip(gaps, terms, strict=True))
    return {"places": gaps, "rate": (jnp.abs(node.rate), size), "rows": A, "mobility": node.mobility}


def _surveyed_links(system: ReducedFunctions, state: State) -> Table:
    """`surveyed` of many links, relative to the largest n, a, ξ and ν, without A and A M⁻¹Aᵀ."""
    at, node = site(state), inverse_legendre.velocities(system, state)
    size = 1e-3 + largest(state.n, state.a)
    gaps = [
        (jnp.abs(one.value(system, at)) if one.holonomic else jnp.zeros(one.size), jnp.full(one.size, size))
        for one in system.constraints
    ]
    rates = jnp.abs(rate(system, at, node.xi, node.nu))
    speed = size * (1e-3 + largest(node.xi, node.nu))
    return {"places": gaps, "rate": (rates, jnp.full_like(rates, speed)), "mobility": jnp.zeros((0, 0))}


def _independent(system: ReducedFunctions, rows: np.ndarray, matrix: np.ndarray) -> Independent:
    """The rows of `checked_start` of A and A M⁻¹Aᵀ (m, m); raises ArgumentError for rows without derivatives."""
    diagonal = np.abs(np.diag(matrix))
    for one, part in parts(system):
        if not np.all(np.isfinite(matrix[part])) and np.all(np.isfinite(rows)):
            raise ArgumentError(
                f"The reaction of the constraint `{one.name}` needs an invertible mass matrix ∂²ℓ/∂(ξ, ν)², but it is "
                "singular at the start: give every velocity a kinetic energy."
            )
        if not np.all(np.isfinite(matrix[part])):
            raise ArgumentError(
                f"The derivatives of the constraint `{one.name}` must be finite at the start, but are not: look for a "
                "division by zero or a root of a negative number there."
            )
        if np.any(~(diagonal[part] > DEPENDENT**2 * np.max(diagonal))):
            raise ArgumentError(
                f"Every row of the constraint `{one.name}` must restrict the velocities, but one has no derivative at "
                "the start: leave it out, or start elsewhere."
            )
    rank = _rank(matrix)
    return None if rank == len(matrix) else _first_rows(matrix, rank)


def _first_rows(matrix: np.ndarray, rank: int) -> tuple[int, ...]:
    """Rows of A M⁻¹Aᵀ as many as its rank, each the first that does not follow from those before it.

    So a loop loses rows of the joint that closes it, and those of the tree that is left stay independent as it moves.
    """
    scale = 1 / np.sqrt(np.abs(np.diag(matrix)))
    left = scale[:, None] * (0.5 * (matrix + matrix.T)) * scale
    found: list[int] = []
    for bound in (APART, 0.0):  # then the best of those that nearly follow, as many as the rank asks for
        while len(found) < rank:
            sizes = np.abs(np.diag(left))
            row = int(np.argmax(sizes > bound) if bound else np.argmax(sizes))
            if sizes[row] <= bound:
                break
            found.append(row)
            left = left - np.outer(left[:, row], left[row]) / left[row, row]
            left[row], left[:, row] = 0.0, 0.0
    return tuple(sorted(found))


def _rank(matrix: np.ndarray) -> int:
    """The rank of A M⁻¹Aᵀ, whatever the units of its rows."""
    sizes = _sizes(matrix)
    return int(np.sum(sizes > DEPENDENT * np.max(sizes)))


def _sizes(matrix: np.ndarray) -> np.ndarray:
    """The sizes of the eigenvalues of A M⁻¹Aᵀ in units of its diagonal."""
    scale = 1 / np.sqrt(np.maximum(np.abs(np.diag(matrix)), np.finfo(float).tiny))
    return np.abs(np.linalg.eigvalsh(scale[:, None] * (0.5 * (matrix + matrix.T)) * scale))


def projected(system: ReducedFunctions, state: State) -> State:
    """The nearest state on the constraints in the kinetic metric, from a state near it; see `System.project`."""

    members = count_members(system.parameters)
    if np.ndim(state.t) or members is not None:
        states = _members(state) if np.ndim(state.t) else [state] * (members or 1)
        if members is not None and members != len(states):
            raise ArgumentError(f"The system has {members} members, but the state has {len(states)}.")
        each = [projected(_member(system, k), one) for k, one in enumerate(states)]
        return jax.tree.map(lambda *leaves: np.stack(leaves), *each)
    if traced(state, system.parameters):
        raise ArgumentError("System.project takes plain numbers: project the state outside jit, grad and vmap.")

    with tracing_once():
        found, survey = _nearest(system, state)
    try:
        require_on(system, survey)
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

    _survey(system, state)
    state, nearer = of(_at_node)(state), of(_nearer)
    for _ in range(TRIPS if any(one.holonomic for one in system.constraints) else 0):
        before, state = state, nearer(state)
        moved = max(np.max(np.abs(x - y), initial=0.0) for x, y in ((state.n, before.n), (state.a, before.a)))
        if moved <= 4 * EPS * max(np.max(np.abs(x), initial=0.0) for x in (state.n, state.a)):
            break
    found = of(_with_velocities)(state)
    return found, _survey(system, found, known=True)[0]


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
    mu, pi = legendre(system, state.xi, state.n, state.nu, state.a, state.t, state.inputs, state.internal)
    state = state.replace(mu=mu, pi=pi)
    for _ in range(3):  # damping leaves 1e-10 of the rates, and more where rows are nearly dependent
        node = node_rates(system, state)
        state = kicked(system, state, _least(node.mobility, -node.rate))
    return _at_node(system, state)


def _nearer(system: ReducedFunctions, state: State) -> State:
    """One of Newton's iterations of a projection, with the velocities of the state."""
    mu, pi = legendre(system, state.xi, state.n, state.nu, state.a, state.t, state.inputs, state.internal)
    eta, w = _least_motion(system, state.replace(mu=mu, pi=pi))
    return moved(system, state.replace(mu=mu, pi=pi), eta, w)


def onto(system: ReducedFunctions, state: State, independent: Independent, iterations: int) -> State:
    """The state on the constraints near one with momenta that is close to them, as a pure function.

    Newton's iterations move (g, q) by the least motions in the kinetic metric, then the momenta get the impulse after
    which A·(ξ, ν) = b. At a state on the constraints its derivative projects onto their tangent space, after one
    iteration already. independent: the rows that are kept where some are redundant.
    """
    for _ in range(iterations if any(one.holonomic for one in system.constraints) else 0):
        state = moved(system, state, *_least_motion(system, state))
    return kicked(system, state, closing(system, state, independent))


def _least_motion(system: ReducedFunctions, state: State) -> tuple[Array, Array]:
    """The least motion (η, w) in the kinetic metric with φ + Dφ·(η, w) = 0."""
    at = site(state)

    def given(impulse: Array) -> tuple[Array, Array]:
        xi, nu, _ = inverse_legendre.velocities(system, kicked(system, state, impulse))
        return xi, nu

    held = [jnp.full(one.size, float(one.holonomic)) for one in system.constraints]
    found = iter(places(system, [one for one in system.constraints if one.holonomic], at))
    values = [next(found) if one.holonomic else jnp.zeros(one.size) for one in system.constraints]
    kept = jnp.diag(jnp.concatenate(held))
    impulse = _least(kept @ node_rates(system, state).mobility @ kept, -jnp.concatenate(values))
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
    """x with matrix x = right, both (m, …), of a positive matrix that may be singular: the least x, nearly."""
    return jnp.linalg.solve(matrix + 1e-10 * jnp.trace(matrix) * jnp.eye(len(matrix)), right)
