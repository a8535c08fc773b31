"""Starts that the optimum chooses: x_0 = start moved by η, as equations of full rank at the first node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.control.ends import start_values
from coadjoint.control.statement import Statement
from coadjoint.errors import ArgumentError
from coadjoint.groups.group import Array
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System

Residual = Callable[[System, State, Array], Array]


def sizes(problem: Statement) -> dict[str, int]:
    """How many numbers η has for each part of the start that is free; raises ArgumentError for what has no place."""
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


def deviations(problem: Statement) -> np.ndarray:
    """σ of every number of η, infinite where nothing is known."""
    found = []
    for name, size in sizes(problem).items():
        try:
            found.append(np.broadcast_to(np.asarray(problem.free_start[name], float), size))
        except ValueError:
            raise ArgumentError(
                f"Argument `free_start` must give `{name}` one standard deviation, or {size} numbers."
            ) from None
    return np.concatenate(found) if found else np.zeros(0)


def parts(problem: Statement, eta: Any) -> dict[str, Any]:
    """η by the names of the parts of the start, zero for those that are fixed."""
    group, Q, _ = problem.system.places
    found: dict[str, Any] = {name: jnp.zeros(group.dim if name in ("g", "xi", "mu") else Q.ambient(group))
                             for name in ("g", "q", "xi", "qdot", "mu", "pi")}  # fmt: skip
    begin = 0
    for name, size in sizes(problem).items():
        found[name], begin = eta[begin : begin + size], begin + size
    return found


def residual(problem: Statement) -> Residual:
    """What is zero at the first node: x_0 less the start moved by η, g exp(η) of g and a sum of the others.

    Of g there are as many equations as it has entries, so that it lies on the group; a = g⁻¹ a₀ moves with it, and q
    stays where it is.
    """
    start = problem.start
    q = np.asarray(start.q) if problem.system.additional.dim(problem.system.group) else np.zeros(0)
    qdot = np.asarray(start.qdot) if len(q) else q
    a0 = start_values(problem).get("a0")

    def rows(system: System, state: State, eta: Array) -> Array:
        group, Q, V = system.places
        by = parts(problem, eta)
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


def moved(problem: Statement, system: System, eta: np.ndarray) -> State:
    """The start moved by η, of a system with its own parameters."""
    if not problem.free_start:
        return problem.start
    start, group, Q = problem.start, system.group, system.additional
    by = {name: np.asarray(value) for name, value in parts(problem, eta).items()}
    given = start_values(problem)
    given["g"] = evaluate(lambda g: group.compose(g, group.exp(by["g"])), start.g)
    if Q.dim(group):
        given["q"] = given["q"] + by["q"]
    velocities = ("xi", "qdot") if start.from_velocities else ("mu", "pi")
    for name in velocities[: 1 + bool(Q.dim(group))]:
        given[name] = np.asarray(getattr(start, name)) + by[name]
    return system.state(**given, inputs=start.inputs)
