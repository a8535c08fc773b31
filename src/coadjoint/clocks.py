"""The clock of a log: in seconds, in order, and without jumps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint.errors import FileError

Jumps = Literal["refuse", "split"]
"""The treatment of jumps of a clock: an error, or a new stretch of the log."""

Unsorted = Literal["refuse", "sort"]
"""The treatment of rows that are out of order."""

HOUR, LONGER = 3600.0, 100.0
"""An interval longer than an hour, s, and than so many usual ones is a jump of the clock."""

EARLIEST, LATEST = 5e8, 1e11
"""s, the years 1985 and 5138: times beyond the second are not in seconds since 1970, and their position between the two
shows their unit."""


class Choices(NamedTuple):
    """The treatment of jumps of a clock and of rows that are out of order."""

    jumps: Jumps = "refuse"
    unsorted: Unsorted = "refuse"


REFUSED = Choices()


class Counted(NamedTuple):
    """`order`: the rows in order, (n,). `time`: their times, (n,) s. `breaks`: rows at which a new stretch begins.
    `notes`: the changes, a sentence each."""

    order: np.ndarray
    time: np.ndarray
    breaks: tuple[int, ...]
    notes: tuple[str, ...]


def clock(
    time: np.ndarray, place: Callable[[int], str], jumps: Jumps | None = "refuse", unsorted: Unsorted = "refuse"
) -> Counted:
    """Times that increase, with the stretches between jumps.

    time: (rows,) s, finite. place: the place of a row, at the beginning of a sentence. jumps: whether a new stretch
    begins where the clock is set back, and where it leaves out an hour or more and 100 usual intervals; None lets it
    leave out any time. unsorted: whether rows are sorted. Raises FileError for other faults, and for times in other
    units.
    """
    require_choices(jumps, unsorted)
    if doubt := other_unit(time):
        raise FileError(f"{place(0)}: {doubt}")
    order, notes = np.arange(len(time)), []
    if unsorted == "sort" and np.any(np.diff(time) < 0):
        order = np.argsort(time, kind="stable")
        notes.append(f"{int(np.sum(np.diff(time) < 0))} rows are earlier than the row before: all are sorted by time.")
    sorted_time = time[order].copy()
    _require_once(sorted_time, order, place)
    back = np.flatnonzero(np.diff(sorted_time) < 0) + 1
    if len(back) and jumps != "split":
        raise FileError(_set_back(sorted_time, int(back[0]), place, jumps is not None))
    for k in back.tolist():
        shift = sorted_time[k - 1] - sorted_time[k] + usual(sorted_time)
        notes.append(
            f"The clock goes back from {sorted_time[k - 1]:.10g} s to {sorted_time[k]:.10g} s: the rows after it are a "
            f"separate stretch, with times {shift:.6g} s later than logged."
        )
        sorted_time[k:] += shift
    ahead = jumps_ahead(sorted_time) if jumps else np.zeros(0, int)
    if len(ahead) and jumps == "refuse":
        raise FileError(_ahead(sorted_time, int(ahead[0]), place(int(order[ahead[0]]))))
    notes += [
        f"The clock jumps from {sorted_time[k - 1]:.10g} s to {sorted_time[k]:.10g} s: the rows after it are a "
        "separate stretch."
        for k in ahead.tolist()
    ]
    return Counted(order, sorted_time, tuple(sorted({*back.tolist(), *ahead.tolist()})), tuple(notes))


def require_choices(jumps: str | None, unsorted: str) -> None:
    """Raise ArgumentError for unknown choices."""
    checks.expect(jumps in ("refuse", "split", None), jumps, "jumps", '"refuse" or "split"')
    checks.expect(unsorted in ("refuse", "sort"), unsorted, "unsorted", '"refuse" or "sort"')


def usual(time: np.ndarray) -> float:
    """The median of the intervals that are positive, s."""
    between = np.diff(time)
    return float(np.median(between[between > 0])) if np.any(between > 0) else 0.0


def jumps_ahead(time: np.ndarray) -> np.ndarray:
    """The rows before which the clock leaves out more than an hour and than 100 usual intervals."""
    return np.flatnonzero(np.diff(time) > max(HOUR, LONGER * usual(time))) + 1


def other_unit(time: np.ndarray) -> str:
    """A sentence on times that cannot be in seconds; "" if they can."""
    largest = float(np.max(np.abs(time), initial=0.0))
    if largest < LATEST:
        return ""
    said = f"the time {largest:.3g} s is in the year {1970 + largest / 31556952:.3g}"
    for unit, factor in (("ms", 1e3), ("us", 1e6), ("ns", 1e9)):
        if EARLIEST <= largest / factor < LATEST:
            return f"{said}: it looks like {unit} since 1970; name the column `time_{unit}`, or give seconds."
    return f"{said}: name the column by its unit, as `time_ms`, `time_us` or `time_ns`, or give seconds."


def _require_once(time: np.ndarray, order: np.ndarray, place: Callable[[int], str]) -> None:
    same = np.flatnonzero(np.diff(time) == 0) + 1
    if len(same):
        k = int(same[0])
        raise FileError(
            f"{place(int(order[k]))}: the time {time[k]:.10g} s comes twice, but must increase: give each time once."
        )


def _set_back(time: np.ndarray, k: int, place: Callable[[int], str], split: bool) -> str:
    remedy = 'where rows are out of order, unsorted="sort" sorts them'
    if split:
        remedy += (
            ' (--unsorted sort); where the clock was set back, jumps="split" begins a new stretch of the log there '
            "(--jumps split)"
        )
    return f"{place(k)}: time goes from {time[k - 1]:.10g} s to {time[k]:.10g} s, but must increase: {remedy}."


def _ahead(time: np.ndarray, k: int, place: str) -> str:
    return (
        f"{place}: time jumps by {time[k] - time[k - 1]:.6g} s, from {time[k - 1]:.10g} s to {time[k]:.10g} s, "
        "where rows "
        f'are {usual(time):.3g} s apart: jumps="split" or --jumps split begins a new stretch of the log there; '
        "where the "
        "clock is wrong, correct it."
    )
