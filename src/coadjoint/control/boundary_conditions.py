"""Boundary conditions of an optimal motion, as equations of full rank: its end, and its start, which may be free."""

from __future__ import annotations

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.control.problem_data import End, ProblemData
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System

Residual = Callable[[System, State], Array]


def end_conditions(problem: ProblemData) -> list[tuple[str, Residual]]:
    """The residuals at the last node, (rows,) of a system and its state, by name.

    Raises ArgumentError for values that do not fit the system.
    """
    end = problem.end
    if not isinstance(end, End):
        return []
    if not end.given:
        raise ArgumentError("co.control.End is empty: give at least one of g, q, xi, qdot, mu, pi, or leave it out.")
    of_q = [name for name in ("q", "qdot", "pi") if getattr(end, name) is not None]
    if of_q and not problem.system.additional.dim(problem.system.group):
        raise ArgumentError(
            f"co.control.End has `{of_q[0]}`, but this system has no `additional`, so that there is no q."
        )
    target = end_state(problem)
    return [(f"`{name}` at the end", _RESIDUALS[name](target)) for name in end.given]


def end_state(problem: ProblemData) -> State:
    """The state at the end, with free parts as at the start; raises ArgumentError for wrong shapes."""
    end = problem.end if isinstance(problem.end, End) else End()
    given = start_values(problem) | {name: getattr(end, name) for name in end.given}
    return problem.system.state(**given, inputs=problem.start.inputs)


def start_values(problem: ProblemData) -> dict[str, PyTree]:
    """The configuration at the start, as arguments of `system.state`, without velocities."""
    return place_of(problem.system, problem.start)


def place_of(system: System, start: State) -> dict[str, object]:
    """The configuration of a state, as arguments of `system.state`, without velocities."""
    group, Q, V = system.places
    found: dict[str, PyTree] = {"g": start.g, "t": start.t}
    if Q.dim(group):
        found["q"] = Q.given(group, start.q)
    if V.dim(group):
        found["a0"] = V.given(group, spatial(start))
    if start.internal is not None:
        found["internal"] = start.internal
    return found


def spatial(state: State) -> np.ndarray:
    """g·a, (dim V*,): the advected parameters in space."""
    return evaluate(lambda s: s.places.advected.act(s.places.group, s.g, s.a), state)


def _element(target: State) -> Residual:
    """2 (F − e)(F + e)⁻¹ for F = g⁻¹g_N, by its coordinates in 𝔤, (dim G,): zero for F = e alone.

    It is the identity on 𝔤 to first order, so that the equations have full rank, and it grows beyond all bounds towards
    half a turn, where the skew part of F would be zero again.
    """

    def residual(system: System, state: State) -> Array:
        group, one = system.group, jnp.eye(system.group.matrix_size)
        F = group.matrix(group.compose(group.inverse(target.g), state.g))
        return group.vee(2 * jnp.linalg.solve((F + one).mT, (F - one).mT).mT)

    return residual


def _point(target: State) -> Residual:
    """q_N − q in the frame of the space at q, (dim Q,)."""
    goal = np.asarray(target.q)

    def residual(system: System, state: State) -> Array:
        group, Q, _ = system.places
        here = Q.act(group, state.g, state.n)
        return here - goal if Q.flat else Q.coordinates(group, goal, here - goal)

    return residual


def _velocity(target: State) -> Residual:
    """q̇_N − q̇ in the frame of the space at q_N, (dim Q,)."""
    goal = np.asarray(target.qdot)

    def residual(system: System, state: State) -> Array:
        group, Q, _ = system.places
        here = Q.push(group, state.g, state.n, state.nu) - goal
        return here if Q.flat else Q.coordinates(group, Q.act(group, state.g, state.n), here)

    return residual


def _field(name: str) -> Callable[[State], Residual]:
    def of(target: State) -> Residual:
        goal = np.asarray(getattr(target, name))

        def residual(system: System, state: State) -> Array:
            here = getattr(state, name) - goal
            return here if name in ("xi", "mu") or system.additional.flat else _tangent(system, state, here)

        return residual

    return of


def _tangent(system: System, state: State, covector: Array) -> Array:
    return system.additional.coordinates(system.group, state.n, covector)


_RESIDUALS: dict[str, Callable[[State], Residual]] = {
    "g": _element,
    "q": _point,
    "xi": _field("xi"),
    "qdot": _velocity,
    "mu": _field("mu"),
    "pi": _field("pi"),
}


StartResidual = Callable[[System, State, Array], Array]


def free_start_sizes(problem: ProblemData) -> dict[str, int]:
    """The count of numbers of η for each free part of the start; raises ArgumentError for parts that cannot be free."""
    group, Q, _ = problem.system.places
    dims = {
        "g": group.dim,
        "q": Q.dim(group),
        "xi": group.dim,
        "qdot": Q.dim(group),
        "mu": group.dim,
        "pi": Q.dim(group),
    }
    if not Q.flat and any(name in problem.free_start for name in ("q", "qdot", "pi")):
        raise ArgumentError(
            "Argument `free_start` names q, qdot or pi, but this system's q lies on a manifold: only g, xi and mu can "
            "be free."
        )
    for name in problem.free_start:
        if not dims[name]:
            raise ArgumentError(f"Argument `free_start` names `{name}`, of which this system has no numbers.")
        if (name in ("mu", "pi")) == problem.start.from_velocities and name not in ("g", "q"):
            given = "velocities: name xi or qdot" if problem.start.from_velocities else "momenta: name mu or pi"
            raise ArgumentError(f"Argument `free_start` names `{name}`, but the start was given by its {given}.")
    return {name: dims[name] for name in problem.free_start}


def start_deviations(problem: ProblemData) -> np.ndarray:
    """σ of every number of η, infinite if unknown."""
    found = []
    for name, size in free_start_sizes(problem).items():
        try:
            found.append(np.broadcast_to(np.asarray(problem.free_start[name], float), size))
        except ValueError:
            raise ArgumentError(
                f"Argument `free_start` must give `{name}` one standard deviation, or {size} numbers."
            ) from None
    return np.concatenate(found) if found else np.zeros(0)


def start_parts(problem: ProblemData, eta: Array) -> dict[str, PyTree]:
    """η by the names of the parts of the start, zero for those that are fixed."""
    group, Q, _ = problem.system.places
    found: dict[str, PyTree] = {name: jnp.zeros(group.dim if name in ("g", "xi", "mu") else Q.ambient(group))
                             for name in ("g", "q", "xi", "qdot", "mu", "pi")}  # fmt: skip
    begin = 0
    for name, size in free_start_sizes(problem).items():
        found[name], begin = eta[begin : begin + size], begin + size
    return found


def start_residual(problem: ProblemData) -> StartResidual:
    """The residual at the first node: x_0 less the start moved by η, g exp(η) for g and a sum for the others.

    g has as many equations as entries, so that it lies on the group; a = g⁻¹ a₀ moves with it, and q stays.
    """
    start = problem.start
    q = np.asarray(start.q) if problem.system.additional.dim(problem.system.group) else np.zeros(0)
    qdot = np.asarray(start.qdot) if len(q) else q
    a0 = spatial(start) if problem.system.advected.dim(problem.system.group) else None

    def rows(system: System, state: State, eta: Array) -> Array:
        group, Q, V = system.places
        by = start_parts(problem, eta)
        there = group.compose(start.g, group.exp(by["g"]))
        found = jax.tree.leaves(jax.tree.map(jnp.subtract, state.g, there))
        if len(q):
            found.append(Q.act(group, state.g, state.n) - q - by["q"])
        if a0 is not None:
            found.append(V.act(group, state.g, state.a) - a0)
        if start.from_velocities:
            found.append(state.xi - start.xi - by["xi"])
            found += [Q.push(group, state.g, state.n, state.nu) - qdot - by["qdot"]] if len(q) else []
        else:
            found.append(state.mu - start.mu - by["mu"])
            found += [state.pi - start.pi - by["pi"]] if len(q) else []
        return jnp.concatenate([jnp.ravel(part) for part in found])

    return rows


def moved_start(problem: ProblemData, system: System, eta: np.ndarray) -> State:
    """The start moved by η, of a system with its own parameters."""
    if not problem.free_start:
        return problem.start
    start, group, Q = problem.start, system.group, system.additional
    by = {name: np.asarray(value) for name, value in start_parts(problem, eta).items()}
    given = start_values(problem)
    given["g"] = evaluate(lambda g: group.compose(g, group.exp(by["g"])), start.g)
    if Q.dim(group):
        given["q"] = Q.given(group, start.q + by["q"])
    velocities = ("xi", "qdot") if start.from_velocities else ("mu", "pi")
    for name in velocities[: 1 + bool(Q.dim(group))]:
        moved = np.asarray(getattr(start, name)) + by[name]
        given[name] = Q.given(group, moved) if name in ("qdot", "pi") else moved
    return system.state(**given, inputs=start.inputs)
