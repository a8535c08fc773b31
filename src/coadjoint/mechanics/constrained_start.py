"""Starts of systems with constraints: whether they satisfy them, and which rows are redundant."""

from __future__ import annotations

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate, traced
from coadjoint.kernels.trace.jaxprs import depends
from coadjoint.mechanics import inverse_legendre
from coadjoint.mechanics.constraints import Bound, Site, place_slopes
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.independent_rows import DEPENDENT, independent_rows, rank_of
from coadjoint.mechanics.momentum_sizes import largest
from coadjoint.mechanics.reactions import Rows, count, node_rates, parts, rate, rows_of, site
from coadjoint.mechanics.reduced_functions import ReducedFunctions
from coadjoint.mechanics.state import State
from coadjoint.mechanics.trace_checks import require_float64
from coadjoint.texts import Table

ON = 1e-9
"""The distance from a constraint, relative to the terms that cancel in it, up to which a start is on it."""

Known = tuple[bool, Rows]
"""Whether a start inside jit, grad or vmap stays on the constraints, and its independent rows then."""


def checked_start(system: ReducedFunctions, state: State) -> Rows:
    """The places of rows of which all others follow at a start, None where none does.

    Raises ArgumentError unless the state satisfies all constraints, and where a row does not depend on the velocities;
    LagrangianError where a constraint is not pure.
    """
    found, independent = survey(system, state)
    require_on(system, found)
    return independent


def survey(system: ReducedFunctions, state: State, known: bool = False) -> tuple[Table, Rows]:
    """`surveyed` of a state, and the places of rows of which all others follow. known: the functions were checked."""
    for one in () if known else system.constraints:
        read = one.value if one.holonomic else one.rows
        require_float64(lambda s, read=read: read(system, site(s)), f"The constraint `{one.name}`", (state,))
    found = evaluate(lambda s, p: surveyed(replace_parameters(system, p), s), state, system.parameters)
    return found, None if rows_of(system) is not None else _independent(system, found["rows"], found["mobility"])


def checked_members(system: ReducedFunctions, parameters: PyTree, axes: PyTree, states: State) -> Rows:
    """The places of rows of which all others follow, `checked_start` of the first member, which must do for all.

    parameters: a tree with an axis of members where `axes`, a tree like it, is 0. states: (members, …) each. Raises
    ArgumentError unless all satisfy all constraints, and where these rows are not all that are independent of a member.
    """
    of_members = jax.vmap(lambda p, s: surveyed(replace_parameters(system, p), s), in_axes=(axes, 0))
    found = evaluate(of_members, parameters, states)
    require_on(system, found)
    if rows_of(system) is not None:
        return None
    independent = _independent(system, found["rows"][0], found["mobility"][0])
    kept = np.arange(count(system)) if independent is None else np.array(independent)
    for k, matrix in enumerate(found["mobility"]):
        if not len(kept) == rank_of(matrix[kept][:, kept]) == rank_of(matrix):
            raise ArgumentError(
                "The members of an ensemble must start with the same independent rows of constraints, but those of "
                f"member 0 are not all, or not independent, at the start of member {k}: start both away from singular "
                "places, or run them one by one."
            )
    return independent


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


def known_start(system: ReducedFunctions, state: State) -> Known:
    """Whether a start of numbers stays on the constraints whatever the parameters that are traced, and its independent
    rows then.

    It does where constraints read none of these, and velocities are given. Raises ArgumentError where it is not on
    them.
    """
    if not system.constraints:
        return True, None
    leaves, structure = jax.tree.flatten(system.parameters)
    if traced(state) or not state.from_velocities:
        return False, None
    used = depends(lambda p: _read(replace_parameters(system, p), site(state)), system.parameters)
    if any(traced(leaf) and reads for leaf, reads in zip(leaves, used, strict=True)):
        return False, None
    plain = structure.unflatten([np.ones(np.shape(leaf)) if traced(leaf) else leaf for leaf in leaves])
    found = evaluate(lambda s, p: _on_places(replace_parameters(system, p), s), state, plain)
    require_on(system, found)
    if "rows" not in found:
        return True, None
    kept = independent_rows(found["rows"] @ found["rows"].T)
    return True, None if len(kept) == count(system) else kept


def _read(system: ReducedFunctions, at: Site) -> list[PyTree]:
    """φ, or A and b, of all constraints."""
    return [one.value(system, at) if one.holonomic else one.rows(system, at) for one in system.constraints]


def _on_places(system: ReducedFunctions, state: State) -> dict[str, PyTree]:
    """`surveyed` by the velocities of the state, without A M⁻¹Aᵀ."""
    if rows_of(system) is not None:
        return _surveyed_links(system, state, state.xi, state.nu)
    gaps, A, rest = _linear(system, site(state))
    v = jnp.concatenate([state.xi, state.nu])
    return {"places": gaps, "rate": (jnp.abs(A @ v + rest), _sizes(A, rest, v)), "rows": A}


def surveyed(system: ReducedFunctions, state: State) -> dict[str, PyTree]:
    """|φ| of each constraint and |A·(ξ, ν) − b|, with the size of the terms in them, and A M⁻¹Aᵀ."""
    node = node_rates(system, state) if rows_of(system) is None else None
    if node is None:
        found = inverse_legendre.velocities(system, state)
        return {**_surveyed_links(system, state, found.xi, found.nu), "mobility": jnp.zeros((0, 0))}
    gaps, A, rest = _linear(system, site(state))
    size = _sizes(A, rest, jnp.concatenate([node.velocities.xi, node.velocities.nu]))
    return {"places": gaps, "rate": (jnp.abs(node.rate), size), "rows": A, "mobility": node.mobility}


def _linear(system: ReducedFunctions, at: Site) -> tuple[list[tuple[Array, Array]], Array, Array]:
    """|φ| of each constraint with the size of its terms; A (m, dim G + ambient); φ̇ or A·(ξ, ν) − b at rest (m,)."""
    group, Q, V = system.places
    turned = [
        jax.vmap(lambda xi, space=space, x=x: space.infinitesimal(group, xi, x), out_axes=1)(jnp.eye(group.dim))
        for space, x in ((Q, at.n), (V, at.a))
    ]
    held = iter(place_slopes(system, at))

    def of(one: Bound) -> tuple[tuple[Array, Array], Array, Array]:
        if not one.holonomic:
            rows, right = one.rows(system, at)
            return (jnp.zeros(one.size), jnp.ones(one.size)), rows, -right
        value, by_n, by_a, by_t = next(held)
        size = jnp.abs(by_n) @ (jnp.abs(at.n) + 1e-3) + jnp.abs(by_a) @ (jnp.abs(at.a) + 1e-3)
        rows = jnp.concatenate([-by_n @ turned[0] - by_a @ turned[1], by_n], axis=1)
        return (jnp.abs(value), size), rows, by_t

    gaps, rows, rest = zip(*map(of, system.constraints), strict=True)
    return list(gaps), jnp.concatenate(rows), jnp.concatenate(rest)


def _sizes(A: Array, rest: Array, v: Array) -> Array:
    """The size of the terms of A·(ξ, ν) − b at velocities v (dim G + ambient,)."""
    return jnp.abs(A) @ (jnp.abs(v) + 1e-3) + jnp.abs(rest)


def _surveyed_links(system: ReducedFunctions, state: State, xi: Array, nu: Array) -> dict[str, PyTree]:
    """The same of many links, relative to the largest n, a, ξ and ν."""
    at = site(state)
    size = 1e-3 + largest(state.n, state.a)
    gaps = [
        (jnp.abs(one.value(system, at)) if one.holonomic else jnp.zeros(one.size), jnp.full(one.size, size))
        for one in system.constraints
    ]
    rates = jnp.abs(rate(system, at, xi, nu))
    return {"places": gaps, "rate": (rates, jnp.full_like(rates, size * (1e-3 + largest(xi, nu))))}


def _independent(system: ReducedFunctions, rows: np.ndarray, matrix: np.ndarray) -> Rows:
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
    kept = independent_rows(matrix)
    return None if len(kept) == len(matrix) else kept
