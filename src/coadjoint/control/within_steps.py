"""Constraints of the path within steps: imposed there, and checked there on the run of the optimum."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.control.library import casadi
from coadjoint.control.numbers import number
from coadjoint.control.problem_data import ProblemData
from coadjoint.kernels import packing
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.internal_state import at_node
from coadjoint.mechanics.state import State
from coadjoint.simulation.accuracy.ruler import Doubling
from coadjoint.simulation.run import Run

POINTS, POINTS_BY_XLA = 9, 3
"""The number of points within each step at which the constraints are checked, in native code and by XLA."""

FINER = 16
"""The number of additional points on either side of the worst of them."""

ROUND_OFF = 1e-6
"""The largest violation, relative to the bound, that counts as none."""


class WorstWithin(NamedTuple):
    """The largest violation of a constraint within the steps, 0 for none, the violated bound, and the time t, s."""

    excess: float
    bound: float
    t: float

    @property
    def violated(self) -> bool:
        """Whether that is more than round-off."""
        return self.excess > ROUND_OFF * (1.0 + abs(self.bound))


def points(count: int) -> np.ndarray:
    """Parts of a step, evenly inside it."""
    return np.arange(1, count + 1) / (count + 1)


def with_points(equations: Any, path: Any, count: int, columns: PyTree, ends: list[int]) -> tuple[PyTree, PyTree]:
    """The equations of a step with those of `count` parts of it from the same node, and the path at their ends:

        r(x, u_θ, z_θ, p, θh) = 0,  path(Φ(x, u_θ, z_θ, p, θh)),  θ = 1/(count + 1), …

    with unknowns z_θ in addition to z, as CasADi's functions of (x, u, z, p, h). So the constrained path is the dense
    output of the run. columns, ends: of linear inputs, which continue to their value at θ.
    """
    ca = casadi()
    sizes = [equations.size1_in(k) for k in range(5)]
    sizes[2] *= count + 1
    x, u, z, p, h = symbols = [ca.SX.sym(name, size) for name, size in zip("xuzph", sizes, strict=True)]
    each = ca.vertsplit(z, equations.size1_in(2)) if sizes[2] else [z] * (count + 1)
    residual, after = equations(x, u, each[0], p, h)
    residuals, values = [residual], []
    for theta, own in zip(points(count), each[1:], strict=True):
        there = ca.SX(u)
        for one in columns:
            if one.begin != one.end:
                there[one.end] = (1 - theta) * u[one.begin] + theta * u[one.end]
        residual, between = equations(x, there, own, p, theta * h)
        residuals.append(residual)
        values.append(path(between, there[ends], p, h))
    names = list("xuzph")
    return (
        ca.Function("equations", symbols, [ca.vertcat(*residuals), after], names, ["residual", "next"]),
        ca.Function("within", symbols, [ca.vertcat(*values)], names, ["within"]),
    )


def worst_within(problem: ProblemData, run: Run) -> dict[str, WorstWithin]:
    """The violation of each constraint of the path between the nodes of a run of every step, by its dense output."""
    problem = replace(problem, duration=None, path_points=0, path={k: v for k, v in problem.path.items() if not v.soft})
    if not problem.path:
        return {}
    doubling, records = Doubling(run.plan, run.one[1]), run.records
    rows, h = packing.rows(records)[:-1], run.plan.h
    count = POINTS if run.plan.backend == "native" else POINTS_BY_XLA
    steps, parts = np.repeat(np.arange(len(rows)), count), np.tile(points(count), len(rows))
    found = _excess(problem, run, doubling, rows[steps], parts)
    worst = {}
    for name, (excess, _) in found.items():
        k = int(np.argmax(excess))
        near = parts[k] + np.linspace(-1, 1, 2 * FINER + 1) / (count + 1)
        near = near[(near > 0) & (near < 1)]
        finer, bounds = _excess(problem, run, doubling, np.repeat(rows[steps[k]][None], len(near), 0), near)[name]
        i = int(np.argmax(finer))
        t = float(records.t[steps[k]]) + h * near[i]
        worst[name] = WorstWithin(max(float(finer[i]), 0.0), float(bounds[i]), float(t))
    return worst


def _excess(
    problem: ProblemData, run: Run, doubling: Doubling, rows: np.ndarray, parts: np.ndarray
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Name → the violation of the constraint after parts (k,) of a step from rows (k, size), and the bounds; −∞ if a
    part has no solution."""
    after, good, system = rows.copy(), np.zeros(len(rows), bool), run.system
    for part in np.unique(parts):
        there = np.flatnonzero(parts == part)
        after[there], good[there] = doubling.over(rows[there], np.full(len(there), run.plan.h), (float(part),))

    def at(state: State) -> dict[str, PyTree]:
        here = at_node(system, state)
        motion = system.motion_at(here, here.inputs)
        arguments = (motion,) if system.parameters is None else (motion, system.parameters)
        return {
            name: jnp.ravel(jnp.asarray(one.function(*arguments), dtype=float)) for name, one in problem.path.items()
        }

    values, found = evaluate(jax.vmap(at), doubling.probe.layout.unpack(after)), {}
    for name, one in problem.path.items():
        lower, upper = (np.broadcast_to(np.ravel(number(x, name)), values[name].shape) for x in (one.lower, one.upper))
        sides = np.stack([lower - values[name], values[name] - upper])
        sides = np.where(good[:, None], np.nan_to_num(sides, nan=np.inf, neginf=-np.inf), -np.inf)
        flat = sides.transpose(1, 0, 2).reshape(len(rows), -1)
        place = np.argmax(flat, axis=1)
        limits = np.stack([lower, upper]).transpose(1, 0, 2).reshape(len(rows), -1)
        at_rows = np.arange(len(rows))
        found[name] = flat[at_rows, place], limits[at_rows, place]
    return found


def lines(worst: dict[str, WorstWithin], points_given: int) -> list[tuple[str, str]]:
    """The summary of constraints within the steps of a solution, as names and texts."""
    remedy = "" if points_given else "; `path_points=3` imposes it within steps, a smaller dt narrows the gap"
    remedy = remedy or "; more `path_points`, or a smaller dt, narrow the gap"
    found = []
    for name, one in worst.items():
        if one.violated:
            found.append(("warning", f"between the nodes `{name}` is violated by {one.excess:.3g} at t = {one.t:.4g} s"
                                     f"{remedy}"))  # fmt: skip
    if worst and not found:
        most = max(one.excess for one in worst.values())
        found.append(("between the nodes", f"constraints violated by at most {most:.1e}"))
    return found
