"""What moves the momenta, or an actuator, as a function of time alone: where it varies within a step."""

from __future__ import annotations

from typing import Any

import numpy as np

from coadjoint.simulation.accuracy.doubling import Doubling
from coadjoint.simulation.accuracy.signals import PARTS, bent

SHORT = 1e-3
"""The part of a step over which a momentum changes by what moves it at one time."""

ROWS, ROWS_BY_XLA = 6, 2
"""From how many records it is looked at."""

ROUND_OFF = 1e-9
"""A change of a momentum over a step, relative to it, that counts as none."""


def unresolved_time(doubling: Doubling, rows: np.ndarray, h: np.ndarray, members: Any = None) -> float | None:
    """The dt that would resolve what depends on t, with everything else held; None where it is resolved already."""
    native = doubling.plan.backend == "native"
    some = np.unique(np.linspace(0, len(rows) - 1, ROWS if native else ROWS_BY_XLA).astype(int))
    rows, step, members = rows[some], np.abs(h[some]), None if members is None else np.asarray(members)[some]
    for _ in range(24):
        if not _varies(doubling, rows, step * np.sign(h[some]), members):
            break
        step = step / 2
    return None if step[0] == abs(h[some][0]) else float(step[0])


def _varies(doubling: Doubling, rows: np.ndarray, h: np.ndarray, members: Any) -> bool:
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


def _commands_vary(doubling: Doubling, rows: np.ndarray, given: np.ndarray, short: np.ndarray, whose: Any) -> bool:
    """Whether what an internal state follows, such as a command of an actuator, varies within a step."""
    at_node, at_end = (list(numbers) for numbers in (doubling.course.begin, doubling.course.end))
    if not at_node:
        return False
    begun = given.copy()
    begun[:, doubling.places.internal_due] = 1.0
    found = doubling.probe(begun, short, 1, whose)
    change = found.record[:, at_end] - given[:, at_node]
    rates = change.reshape(len(PARTS), len(rows), -1).swapaxes(0, 1) / SHORT
    return not found.code.any() and bent(rates, 0.0, ROUND_OFF * np.max(np.abs(rows[:, at_node])))
