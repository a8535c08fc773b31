"""Inputs and other functions of time that vary within a step, where the nodes of a rule do not show them."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.trace.evaluate import Mapped, tabulate
from coadjoint.mechanics.signals import Held, Linear
from coadjoint.simulation.accuracy.ruler import Doubling
from coadjoint.simulation.result import Result

PARTS = np.array([0.0, 0.173, 0.382, 0.594, 0.809, 1.0])
"""The places in a step at which a signal is examined, in no simple ratios."""


BENT = 0.2
"""The tolerated distance of a signal from a line, and from its value at the node, relative to its range."""


LARGE = 0.1
"""The same, relative to the largest value: a small ripple on a constant signal does not count."""


def unresolved_inputs(run: Result, records: PyTree, h: np.ndarray) -> list[tuple[str, float]]:
    """The inputs that deviate from a straight line over more than half of the steps, each with a dt that resolves it.

    A function of the motion is treated as a function of time, with everything else in the motion held constant.
    """
    system = run.plan.program.skeleton
    if system.inputs is None or system.inputs.constant:
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


def _bent(run: object, records: PyTree, h: np.ndarray) -> list[str]:
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


def _values(run: Any, records: PyTree, times: np.ndarray) -> PyTree:
    """The inputs at the times (rows, parts) of steps from the records."""
    given = records.replace(mu=None, pi=None, ledger=None, memory=None), times
    shapes = tuple(np.shape(leaf) for leaf in jax.tree.leaves(given))
    return _table(run.plan.program.skeleton, jax.tree.structure(given), shapes)(*given)


@lru_cache(maxsize=32)
def _table(system: Any, structure: PyTree, shapes: PyTree) -> PyTree:
    """`_values` traced once for a system."""
    given = jax.tree.unflatten(structure, [np.zeros(shape) for shape in shapes])

    def at(state, times):
        def one(t):
            held = system.inputs.held(system.motion_at(state.replace(t=t)), state.inputs)
            held = None if held is None else jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype=float), held)
            return system.inputs.at(t, held)

        return jax.vmap(one)(times)

    return tabulate(Mapped(at), *given)


HIGH = 0.5
"""The least excess of a pulse over the values at both ends of its step, relative to the range of the table."""


ON_GRID = 1e-6
"""A time that is nearer to a node than this, in steps, is on it."""


def unseen_pulses(run: Result) -> list[tuple[str, float]]:
    """The tables with values within a step that are far from those at its ends, each with a dt that would show them."""
    inputs, found = run.plan.program.skeleton.inputs, []
    if inputs is None or run.method.variable:
        return found
    for name, source in zip(inputs.names or ("",), inputs.sources, strict=True):
        if isinstance(source, (Held, Linear)) and len(source.times) > 1 and (dt := _unseen(run, source)) is not None:
            found.append((f" `{name}`" if name else "", dt))
    return found


def _unseen(run: Any, table: Held | Linear) -> float | None:
    times, values = np.asarray(table.times), np.reshape(table.values, (len(table.times), -1))
    h, begin = run.plan.h, float(np.ravel(run.start.t)[0])
    position = (times - begin) / h
    node = np.floor(position)
    inside = (np.abs(position - np.round(position)) > ON_GRID) & (position > 0) & (position < run.plan.steps)
    node, given, index = node[inside], values[inside], np.flatnonzero(inside)
    if not len(node):
        return None
    ends = [_table_at(table, times, values, begin + (node + k) * h) for k in (0, 1)]
    beyond = np.maximum(given - np.maximum(*ends), np.minimum(*ends) - given)
    high = np.any(beyond > HIGH * np.ptp(values, axis=0), axis=1)
    if not high.any():
        return None
    gaps = np.diff(times)
    edges = np.concatenate([index[high] - 1, index[high]])
    return float(0.5 * gaps[np.clip(edges, 0, len(gaps) - 1)].min())


def _table_at(table: Held | Linear, times: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    if isinstance(table, Held):
        early = ON_GRID * np.min(np.diff(times))
        return values[np.clip(np.searchsorted(times - early, at, side="right") - 1, 0, None)]
    return np.stack([np.interp(at, times, column) for column in values.T], axis=1)


SHORT = 1e-3
"""The part of a step over which a momentum changes by the forces at one time."""


ROWS, ROWS_BY_XLA = 6, 2
"""The number of records from which it is examined."""


ROUND_OFF = 1e-9
"""A change of a momentum over a step, relative to it, that counts as none."""


def unresolved_time(doubling: Doubling, rows: np.ndarray, h: np.ndarray, members: PyTree = None) -> float | None:
    """A dt that resolves the dependence on t, with everything else held; None if the steps already resolve it."""
    system, native = doubling.plan.program.skeleton, doubling.plan.backend == "native"
    if not (system.forces or system.internal or system.constraints or system.inputs or system.depends_on_time):
        return None
    some = np.unique(np.linspace(0, len(rows) - 1, ROWS if native else ROWS_BY_XLA).astype(int))
    rows, step, members = rows[some], np.abs(h[some]), None if members is None else np.asarray(members)[some]
    for _ in range(24):
        if not _varies(doubling, rows, step * np.sign(h[some]), members):
            break
        step = step / 2
    return None if step[0] == abs(h[some][0]) else float(step[0])


def _varies(doubling: Doubling, rows: np.ndarray, h: np.ndarray, members: PyTree) -> bool:
    count, places = len(PARTS), doubling.places
    given = np.tile(rows, (count, 1))
    later = (PARTS[:, None] * h).ravel()
    given[:, places.t] += later[:, None] if np.ndim(places.t) else later
    whose = None if members is None else np.tile(members, count)
    after, good = doubling.over(given, np.tile(SHORT * h, count), (1.0,), whose)
    if not good.all():
        return False
    for momentum in (places.mu, places.pi):
        index = np.ravel(momentum).astype(int)
        if not len(index):
            continue
        pushed = (after - given)[:, index].reshape(count, len(rows), -1).swapaxes(0, 1) / SHORT
        if bent(pushed, 0.0, ROUND_OFF * np.max(np.abs(rows[:, index]))):
            return True
    return _commands_vary(doubling, rows, given, np.tile(SHORT * h, count), whose)


def _commands_vary(doubling: Doubling, rows: np.ndarray, given: np.ndarray, short: np.ndarray, whose: PyTree) -> bool:
    """Whether the targets of an internal state, such as a command of an actuator, vary within a step."""
    at_node, at_end = (list(numbers) for numbers in (doubling.course.begin, doubling.course.end))
    if not at_node:
        return False
    begun = given.copy()
    begun[:, doubling.places.internal_due] = 1.0
    found = doubling.probe.step(begun, short, 1, whose)
    change = found.record[:, at_end] - given[:, at_node]
    rates = change.reshape(len(PARTS), len(rows), -1).swapaxes(0, 1) / SHORT
    return not found.code.any() and bent(rates, 0.0, ROUND_OFF * np.max(np.abs(rows[:, at_node])))
