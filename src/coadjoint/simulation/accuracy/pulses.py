"""Pulses of tabulated inputs that begin and end within a step: a rule may not see them at all."""

from __future__ import annotations

from typing import Any

import numpy as np

from coadjoint.mechanics.signals import Held, Linear
from coadjoint.simulation.result import Result

HIGH = 0.5
"""How far a pulse must be beyond the values at both ends of its step, relative to the range of the table."""

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
    ends = [_at(table, times, values, begin + (node + k) * h) for k in (0, 1)]
    beyond = np.maximum(given - np.maximum(*ends), np.minimum(*ends) - given)
    high = np.any(beyond > HIGH * np.ptp(values, axis=0), axis=1)
    if not high.any():
        return None
    gaps = np.diff(times)
    edges = np.concatenate([index[high] - 1, index[high]])
    return float(0.5 * gaps[np.clip(edges, 0, len(gaps) - 1)].min())


def _at(table: Held | Linear, times: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    if isinstance(table, Held):
        early = ON_GRID * np.min(np.diff(times))
        return values[np.clip(np.searchsorted(times - early, at, side="right") - 1, 0, None)]
    return np.stack([np.interp(at, times, column) for column in values.T], axis=1)
