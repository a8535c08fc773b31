"""Boundary conditions of an optimal motion, as equations of full rank: its end, and its start, which may be free."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.control.problem_data import ProblemData
from coadjoint.control.problem_parts import End
from coadjoint.errors import ArgumentError
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.start import StartGiven, starts_given
from coadjoint.mechanics.start_arguments import checked, checked_element
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System

Residual = Callable[[System, State, PyTree], Array]


def end_conditions(problem: ProblemData) -> dict[str, Residual]:
    """The residuals at the last node, (rows,) of a system, its state and the goal's value, by the name of the value.

    Raises ArgumentError for values that do not fit the system.
    """
    end = problem.end
    if not isinstance(end, End) or end.function is not None:
        return {}
    if not end.given:
        raise ArgumentError("co.control.End is empty: give at least one of g, q, xi, qdot, mu, pi, or leave it out.")
    of_q = [name for name in ("q", "qdot", "pi") if getattr(end, name) is not None]
    if of_q and not problem.system.additional.dim(problem.system.group):
        raise ArgumentError(
            f"co.control.End has `{of_q[0]}`, but this system has no `additional`, so that there is no q."
        )
    return {name: _RESIDUALS[name] for name in end.given}


def end_values(problem: ProblemData, end: End) -> dict[str, PyTree]:
    """The given values of the end, checked as those of a state; raises ArgumentError for wrong ones."""
    system, start, group = problem.system, problem.start, problem.system.group
    _, Q, V = system.places
    given: dict[str, PyTree] = {"g": start.g, **({"q": Q.given(group, start.q)} if Q.dim(group) else {})}
    with starts_given():
        made = cast(StartGiven, system.state(**given | {name: getattr(end, name) for name in end.given}))
    g, q, xi, qdot, _, t, *_ = made.arguments
    a0 = V.given(group, start.a) if V.dim(group) else None
    found = checked(system, checked_element(group, g), q, qdot, xi, a0, t, made.by_momenta)
    values = {"g": found.g, "q": found.q, "xi": found.xi, "mu": found.xi, "qdot": found.qdot, "pi": found.qdot}
    if end.pi is not None and not Q.flat:

        def on_fibre(g: Element, q: Array, pi: Array) -> Array:
            return Q.project(group, Q.act(group, group.inverse(g), q), pi)

        values["pi"] = evaluate(on_fibre, found.g, found.q, found.qdot)
    return {name: values[name] for name in end.given}


def place_of(system: System, start: State) -> dict[str, PyTree]:
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


def _element(system: System, state: State, back: Element) -> Array:
    """2 (F − e)(F + e)⁻¹ for F = g⁻¹g_N, by its coordinates in 𝔤, (dim G,): zero for F = e alone. back: g⁻¹.

    It is the identity on 𝔤 to first order, so that the equations have full rank, and it grows beyond all bounds towards
    half a turn, where the skew part of F would be zero again.
    """

    group, one = system.group, jnp.eye(system.group.matrix_size)
    F = group.matrix(group.compose(back, state.g))
    return group.vee(2 * jnp.linalg.solve((F + one).mT, (F - one).mT).mT)


def _point(system: System, state: State, goal: Array) -> Array:
    """q_N − q in the frame of the space at q, (dim Q,)."""
    group, Q, _ = system.places
    here = Q.act(group, state.g, state.n)
    return here - goal if Q.flat else Q.coordinates(group, goal, here - goal)


def _velocity(system: System, state: State, goal: Array) -> Array:
    """q̇_N − q̇ in the frame of the space at q_N, (dim Q,)."""
    group, Q, _ = system.places
    here = Q.push(group, state.g, state.n, state.nu) - goal
    return here if Q.flat else Q.coordinates(group, Q.act(group, state.g, state.n), here)


def _field(name: str) -> Residual:
    def residual(system: System, state: State, goal: Array) -> Array:
        here = getattr(state, name) - goal
        if name in ("xi", "mu") or system.additional.flat:
            return here
        return system.additional.coordinates(system.group, state.n, here)

    return residual


_RESIDUALS: dict[str, Residual] = {
    "g": _element,
    "q": _point,
    "xi": _field("xi"),
    "qdot": _velocity,
    "mu": _field("mu"),
    "pi": _field("pi"),
}


StartResidual = Callable[[System, State, Array, dict[str, PyTree]], Array]


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


def start_values(problem: ProblemData, start: State) -> dict[str, PyTree]:
    """The values of a start that the residual of the first node reads, by name; none where bounds hold the start."""
    moving = ("xi", "nu") if start.from_velocities else ("mu", "pi")
    if not problem.free_start:
        held = bool(problem.parameters) and start.from_velocities
        return {name: np.asarray(getattr(start, name)) for name in moving} if held else {}
    group, Q, V = problem.system.places
    names = (moving[0],) if not Q.dim(group) else ("q", "xi", "qdot") if start.from_velocities else ("q", "mu", "pi")
    found: dict[str, PyTree] = {"g": start.g} | {name: np.asarray(getattr(start, name)) for name in names}
    return found | ({"a0": spatial(start)} if V.dim(group) else {})


def start_residual(problem: ProblemData) -> StartResidual:
    """The residual at the first node: x_0 less the start moved by η, g exp(η) for g and a sum for the others.

    g has as many equations as entries, so that it lies on the group; a = g⁻¹ a₀ moves with it, and q stays.
    """

    def rows(system: System, state: State, eta: Array, start: dict[str, PyTree]) -> Array:
        group, Q, V = system.places
        by = start_parts(problem, eta)
        there = group.compose(start["g"], group.exp(by["g"]))
        found = jax.tree.leaves(jax.tree.map(jnp.subtract, state.g, there))
        if "q" in start:
            found.append(Q.act(group, state.g, state.n) - start["q"] - by["q"])
        if "a0" in start:
            found.append(V.act(group, state.g, state.a) - start["a0"])
        found += [getattr(state, name) - start[name] - by[name] for name in ("xi", "mu") if name in start]
        if "qdot" in start:
            found.append(Q.push(group, state.g, state.n, state.nu) - start["qdot"] - by["qdot"])
        if "pi" in start:
            found.append(state.pi - start["pi"] - by["pi"])
        return jnp.concatenate([jnp.ravel(part) for part in found])

    return rows


def moved_start(problem: ProblemData, system: System, eta: np.ndarray) -> State:
    """The start moved by η, of a system with its own parameters."""
    if not problem.free_start:
        return problem.start
    start, group, Q = problem.start, system.group, system.additional
    by = {name: np.asarray(value) for name, value in start_parts(problem, eta).items()}
    given = place_of(problem.system, start)
    given["g"] = evaluate(lambda g: group.compose(g, group.exp(by["g"])), start.g)
    if Q.dim(group):
        given["q"] = Q.given(group, start.q + by["q"])
    velocities = ("xi", "qdot") if start.from_velocities else ("mu", "pi")
    for name in velocities[: 1 + bool(Q.dim(group))]:
        moved = np.asarray(getattr(start, name)) + by[name]
        given[name] = Q.given(group, moved) if name in ("qdot", "pi") else moved
    return system.state(**given, inputs=start.inputs)
