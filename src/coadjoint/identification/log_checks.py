"""Checks of a log: columns whose values do not fit their names and units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from coadjoint.identification.kinematics import inconsistent
from coadjoint.units import jumps_by_degrees

STEEPEST, SELDOM = np.pi, 0.01
"""The pitch, rad, that no Euler angle ZYX exceeds, and the part of the samples that outliers alone do not reach."""

HIGHEST = 3.0
"""m above the surface, from which on the median of all depths is not an error of a sensor."""

FULL, EDGE, SELDOM_JUMP, SMOOTH = 0.9, 0.05, 0.2, 0.1
"""The part of a turn that angles must cover and jump by, how far they may be beyond its ends, how often they may jump,
and below which part of a turn all other changes from one sample to the next are, to betray radians."""

WILD, SPREAD, FEWEST = 50.0, 3.0, 10
"""The distance of an outlier from the mean of its neighbours, in differences that 90 % of the values stay below, and in
ranges of 98 % of the values about their median; and the fewest values of a column for this test."""

LONGEST = 3
"""How many neighbouring values may be wild together."""

OFTEN = 0.5
"""The largest part of the samples that marks for missing values take."""

FLOORS = {"m": 10.0, "rad": 4 * np.pi, "m/s": 10.0, "rad/s": 50.0}
"""The least distance, by unit; wrapped angles differ by a turn."""


def implausible(time: np.ndarray, columns: Mapping[str, np.ndarray], units: Mapping[str, str]) -> list[str]:
    """A sentence for each column (n,) whose numbers, NaN aside, are implausible.

    time: s, (n,). units: by column, as of a `Log`.
    """
    told = {}
    for name, values in columns.items():
        known = values[np.isfinite(values)]
        if units.get(name) == "rad" and jumps_by_degrees(known):
            told[name] = (
                f"`{name}` jumps by 360 from one sample to the next, as degrees do and radians never: name the column "
                f"`{name}_deg`, or give np.radians of it."
            )
        elif name == "pitch" and np.mean(np.abs(known) > STEEPEST) > SELDOM:
            told[name] = (
                "`pitch` goes beyond 3.14 rad, but an Euler angle ZYX is at most 1.57: name a column in degrees "
                "`pitch_deg`, or give np.radians of it."
            )
        elif name == "depth" and np.median(known) < -HIGHEST:
            told[name] = (
                "Most of `depth` is above the surface: it is positive down. Name heights `up_m`, read z of ENU by "
                "`axes`, and declare the `surface_pressure` of a sensor that does not measure absolute pressure."
            )
        elif units.get(name) == "rad" and _wrapped_by_radians(np.degrees(known)):
            told[name] = (
                f"`{name}` jumps by 6.28 degrees from one end of its range to the other, as radians do where they are "
                f"wrapped: name the column `{name}_rad`, or give np.degrees of it."
            )
    others = {name: values for name, values in columns.items() if name not in told}
    return [*told.values(), *inconsistent(time, others, units), *(one.sentence for one in wild(time, columns, units))]


def _wrapped_by_radians(degrees: np.ndarray) -> bool:
    """Whether angles, named degrees, stay within a turn of 2π and cross it from end to end, but else change little."""
    turn, step = 2 * np.pi, np.abs(np.diff(degrees))
    low = 0.0 if np.min(degrees, initial=0.0) >= -EDGE else -np.pi
    inside = bool(np.all((degrees >= low - EDGE) & (degrees <= low + turn + EDGE)))
    if not inside or np.ptp(degrees) < FULL * turn:
        return False
    jumps = step > FULL * turn
    # Near a pitch of 90° a heading turns fast, so that some crossings are seen from further inside.
    between = int(np.sum((step > 0.5 * turn) & ~jumps))
    smooth = np.quantile(step, 1 - SELDOM_JUMP) < SMOOTH * turn
    return bool(smooth and between <= 0.5 * np.sum(jumps) and 0 < np.mean(jumps) < SELDOM_JUMP)


def _marks(known: np.ndarray, floor: float) -> np.ndarray:
    """The places of the lowest or highest number if it repeats far from all others: a mark such as -999 for no
    value."""
    for number in (np.min(known), np.max(known)):
        at = known == number
        others = known[~at]
        if not 2 <= np.sum(at) <= OFTEN * len(known) or not np.any(np.diff(np.flatnonzero(~at)) > 1):
            continue
        if np.min(np.abs(others - number)) > max(SPREAD * np.ptp(others), floor):
            return np.flatnonzero(at)
    return np.array([], int)


def _bursts(known: np.ndarray, least: float) -> np.ndarray:
    """Where up to LONGEST neighbouring values lie on one side of both values around them, by more than `least`."""
    n, bad = len(known), np.zeros(len(known), bool)
    for width in range(1, LONGEST + 1):
        first = np.arange(n - width + 1)
        before = np.where(first > 0, known[first - 1], known[np.minimum(first + width, n - 1)])
        after = np.where(first + width < n, known[np.minimum(first + width, n - 1)], before)
        inside = known[first[:, None] + np.arange(width)] - np.stack([before, after])[..., None]
        apart = np.min(np.abs(inside), axis=(0, 2)) > least
        one_side = np.all(inside[0] * inside[1] > 0, axis=1)
        for start in first[apart & one_side]:
            bad[start : start + width] = True
    return np.flatnonzero(bad)


class Wild(NamedTuple):
    """Wild values of a column: their rows, a finding, and a remedy."""

    name: str
    rows: np.ndarray
    finding: str
    remedy: str

    @property
    def sentence(self) -> str:
        return f"{self.finding}: {self.remedy}."


def wild(time: np.ndarray, columns: Mapping[str, np.ndarray], units: Mapping[str, str]) -> list[Wild]:
    """Values far from their neighbours, or from all others. time: s, (n,). columns, units: of a `Log`."""
    found: list[Wild] = []
    for name, values in columns.items():
        rows = np.flatnonzero(np.isfinite(values))
        if len(rows) < FEWEST:
            continue
        known = values[rows]
        marks = _marks(known, FLOORS.get(units.get(name, ""), np.inf))
        if len(marks):
            k = int(rows[marks[0]])
            text = (
                f"`{name}` is {values[k]:.6g} in {len(marks)} rows, first in row {k + 1}, at {time[k]:.6g} s, and no "
                "other value is near it"
            )
            found.append(Wild(name, rows[marks], text, "if it marks missing values, leave these cells empty"))
            continue
        off = np.abs(known - (np.append(known[1], known[:-1]) + np.append(known[1:], known[-2])) / 2)
        near = np.sort(np.abs(known - np.median(known)))[: -max(min(LONGEST, len(known) // 10), len(known) // 50)]
        least = max(WILD * np.quantile(off, 0.9), SPREAD * 2 * near[-1], FLOORS.get(units.get(name, ""), 0.0))
        if not least > 0 or not len(bursts := _bursts(known, least)):
            continue
        k, more = int(bursts[np.argmax(off[bursts])]), len(bursts) - 1
        calm = np.setdiff1d(np.arange(len(known)), bursts)
        after = int(np.searchsorted(calm, k))
        around = known[calm[[max(after - 1, 0), min(after, len(calm) - 1)]]]
        text = (
            f"`{name}` is {known[k]:.6g} in row {rows[k] + 1}, at {time[rows[k]]:.6g} s, between {around[0]:.6g} and "
            f"{around[1]:.6g}{f', and {more} more like it' if more else ''}"
        )
        found.append(Wild(name, rows[bursts], text, f"leave {'these values' if more else 'that value'} out"))
    return found
