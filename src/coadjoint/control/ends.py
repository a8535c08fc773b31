"""Where a motion ends, as equations of full rank at the last node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
import numpy as np

from coadjoint.control.statement import End, Statement
from coadjoint.errors import ArgumentError
from coadjoint.groups.group import Array
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System

Residual = Callable[[System, State], Array]


def ends(problem: Statement) -> list[tuple[str, Residual]]:
    """What is zero at the last node, (rows,) of a system and its state, by what it is.

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


def end_state(problem: Statement) -> State:
    """The state at the end, where what is free is as at the start; raises ArgumentError for wrong shapes."""
    end = problem.end if isinstance(problem.end, End) else End()
    given = start_values(problem) | {name: getattr(end, name) for name in end.given}
    return problem.system.state(**given, inputs=problem.start.inputs)


def start_values(problem: Statement) -> dict[str, Any]:
    """Where the motion starts, as arguments of `system.state`, without velocities."""
    return place_of(problem.system, problem.start)


def place_of(system: System, start: State) -> dict[str, Any]:
    """Where a state is, as arguments of `system.state`, without velocities."""
    group, Q, V = system.places
    found: dict[str, Any] = {"g": start.g, "t": start.t}
    if Q.dim(group):
        found["q"] = start.q
    if V.dim(group):
        found["a0"] = evaluate(lambda s: V.act(group, s.g, s.a), start)
    if start.internal is not None:
        found["internal"] = start.internal
    return found


def _element(target: State) -> Residual:
    """2 (F − e)(F + e)⁻¹ for F = g⁻¹g_N, by its coordinates in 𝔤, (dim G,): zero for F = e alone.

    It is the identity on 𝔤 to first order, so that the equations have full rank, and it grows beyond all bounds towards
    half a turn, where the skew part of F would be zero again.
    """

    def residual(system: System, state: State) -> Array:
        group, one = system.group, jnp.eye(system.group.matrix_size)
        F = group.matrix(group.compose(group.inverse(target.g), state.g))
        return group.vee(2 * jnp.linalg.solve((F + one).T, (F - one).T).T)

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
