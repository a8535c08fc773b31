"""Inputs that vary within a step: what a rule sees at its nodes, or holds over a step, is then not the signal."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.simulation.result import Result

PARTS = np.array([0.0, 0.173, 0.382, 0.594, 0.809, 1.0])
"""Where in a step a signal is looked at, in no simple ratios."""

BENT = 0.2
"""How far a signal may be from a line, and from its value at the node, over most steps; relative to its range."""

LARGE = 0.1
"""The same, relative to the largest value: a ripple beside which all else is constant is none."""


def unresolved_inputs(run: Result, records: Any, h: np.ndarray) -> list[tuple[str, float]]:
    """The inputs that are no straight line over more than half of the steps, each with a dt that would resolve it.

    A function of the motion is looked at as a function of time, everything else in the motion held.
    """
    system = run.plan.program.skeleton
    if system.inputs is None:
        return []
    found: dict[str, float] = {}
    step = np.asarray(h, float)
    for halving in range(24):
        bent = _bent(run, records, step)
        if not halving:
            found = dict.fromkeys(bent, 0.0)
        for name in found:
            if name not in bent and not found[name]:
                found[name] = float(abs(step[0]))
        if not found or all(found.values()):
            break
        step = step / 2
    return [(name, dt or float(abs(step[0]))) for name, dt in found.items()]


def _bent(run: Any, records: Any, h: np.ndarray) -> list[str]:
    times = records.t[:, None] + h[:, None] * PARTS
    values = _values(run, records, times)
    found = []
    for path, leaf in jax.tree_util.tree_leaves_with_path(values):
        rows = np.asarray(leaf, float).reshape(*times.shape, -1)
        if bent(rows, float(np.ptp(rows.reshape(-1, rows.shape[-1]), axis=0).max(initial=0.0))):
            name = jax.tree_util.keystr(path).lstrip(".")
            found.append(f" `{name}`" if name else "")
    return found


def bent(rows: np.ndarray, span: float, least: float = 0.0) -> bool:
    """Whether values (rows, parts, k) over most steps are neither a line nor constant; `least` counts as none."""
    size = np.max(np.abs(rows), initial=0.0)
    if size <= max(least, 0.0):
        return False
    if np.max(np.abs(rows - rows[:, :1]), initial=0.0) <= least:
        return False
    line = rows[:, :1] + (rows[:, -1:] - rows[:, :1]) * PARTS[:, None]
    off_line = np.max(np.abs(rows - line), axis=(1, 2))
    off_constant = np.max(np.abs(rows[:, :-1] - rows[:, :1]), axis=(1, 2))
    return bool(np.median(np.minimum(off_line, off_constant)) > max(BENT * span, LARGE * size, least))


def _values(run: Any, records: Any, times: np.ndarray) -> Any:
    """The inputs at the times (rows, parts) of steps from the records."""
    given = records.replace(mu=None, pi=None, ledger=None, memory=None), times
    shapes = tuple(np.shape(leaf) for leaf in jax.tree.leaves(given))
    return _table(run.plan.program.skeleton, jax.tree.structure(given), shapes)(*given)


@lru_cache(maxsize=32)
def _table(system: Any, structure: Any, shapes: Any) -> Any:
    """`_values` traced once for a system."""
    given = jax.tree.unflatten(structure, [np.zeros(shape) for shape in shapes])

    def at(state, times):
        def one(t):
            held = system.inputs.held(system.motion_at(state.replace(t=t)), state.inputs)
            held = None if held is None else jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype=float), held)
            return system.inputs.at(t, held)

        return jax.vmap(one)(times)

    return tabulate(jax.vmap(at), *given)
