"""Samples of several sensors as one log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from coadjoint.clocks import HOUR, Jumps
from coadjoint.clocks import clock as counted
from coadjoint.errors import FileError, prefixed
from coadjoint.identification import Log
from coadjoint.identification.channels import VEHICLE

PAUSE, LEAST_PAUSE = 10.0, 1e9
"""How many usual intervals, and how many ns, a command is silent before a note reports it."""


@dataclass(frozen=True)
class Samples:
    """The measurements of one sensor: times, ns, increasing, and columns by name, (samples,), with their rank.

    positions: where in the body the sensor sits, m, by those columns for which it is not O.
    lag: by how much its messages were logged after their stamps, the median, s; None where times are those of logging.
    pieces: how often the clock went back before each sample, (samples,): times increase within a piece.
    """

    topic: str
    times: np.ndarray
    columns: Mapping[str, np.ndarray]
    rank: Mapping[str, int]
    lag: float | None = None
    positions: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    pieces: np.ndarray | None = None


@dataclass(frozen=True)
class Actuation:
    """The commands, or actual values, of an actuator: times, ns, and values, (samples,) or (samples, k); `lag`,
    `pieces` as of `Samples`."""

    topic: str
    name: str
    times: np.ndarray
    values: np.ndarray
    unit: str
    did: bool
    lag: float | None = None
    pieces: np.ndarray | None = None


def merged(
    file: str,
    sensors: Sequence[Samples],
    driven: Sequence[Actuation],
    notes: Sequence[str],
    step: float | None = None,
    telling: bool = True,
    jumps: Jumps = "refuse",
) -> Log:
    """One log at all times of all sensors and commands, NaN where a sensor was silent, from the first one on.

    Of the sensors that measure a column the one of the lowest rank is taken. Commands are held until the next one.
    telling: whether notes name the sensor taken if several measure a column. jumps: as of `coadjoint.clocks`.
    Raises FileError if two sensors of one rank measure a column, and if nothing is left.
    """
    sensors, driven, again, said = _pieced(file, sensors, driven)
    chosen = _chosen(file, sensors)
    inputs = _one_each(file, [one for one in driven if not one.did])
    actual = {name: one for name, one in _one_each(file, [one for one in driven if one.did]).items() if name in inputs}
    clock = _clock([*(_heard(one, chosen) for one in sensors), *(one.times for one in inputs.values())])
    told = [*notes, *said, *(clocks(file, [*sensors, *driven]) if telling else [])]
    begin = max((int(one.times[0]) for one in inputs.values()), default=None)
    if begin is not None and len(clock) and begin > clock[0]:
        told.append(
            f"The first {(begin - int(clock[0])) * 1e-9:.3g} s are left out, because commands begin after them."
        )
        clock = clock[clock >= begin]
    if len(clock) < 2:
        raise FileError(f"{file} holds fewer than two samples of the requested quantities.")
    columns = {name: _placed(clock, chosen[name].times, chosen[name].columns[name]) for name in chosen}
    columns = {name: values for name, values in columns.items() if np.any(np.isfinite(values))}
    read = counted((clock - clock[0]) / 1e9, lambda row: f"{file}, row {row + 1} of its log", jumps)
    units = {name: one.unit for name, one in inputs.items()}
    told += read.notes
    told += _choices(chosen, sensors) if telling else []
    told += [note for one in inputs.values() for note in _pauses(clock, one)]
    late = [one for one in actual.values() if one.times[0] > clock[0]]
    told += [f"{one.topic} begins after the first sample, and is left out." for one in late]
    with prefixed(str(file)):
        return Log(
            read.time,
            columns,
            {name: _held(clock, one) for name, one in inputs.items()},
            units,
            tuple(told),
            step,
            {name: _held(clock, one) for name, one in actual.items() if one.times[0] <= clock[0]},
            {name: chosen[name].positions[name] for name in columns if name in chosen[name].positions},
            breaks=tuple(
                sorted({*read.breaks, *set(range(1, len(clock))).intersection(np.searchsorted(clock, again))})
            ),
            current=_current(clock, sensors),
        )


CURRENT = "current_"
"""How columns begin that are of the water."""

Topic = TypeVar("Topic", Samples, Actuation)


def _pieced(
    file: str, sensors: Sequence[Samples], driven: Sequence[Actuation]
) -> tuple[list[Samples], list[Actuation], np.ndarray, list[str]]:
    """Topics whose times increase, the pieces of all moved one behind the other; when each piece but the first begins,
    ns, and notes. Raises FileError where the clock of one topic goes back more often than that of another."""
    topics = [one for one in (*sensors, *driven) if len(one.times)]
    counts = {one.topic: 1 + int(0 if one.pieces is None else one.pieces[-1]) for one in topics}
    most = max(counts.values(), default=1)
    if most == 1:
        return list(sensors), list(driven), np.zeros(0, np.int64), []
    least = min(counts, key=counts.__getitem__)
    if counts[least] < most:
        often = max(counts, key=counts.__getitem__)
        raise FileError(
            f"{file}: the clock of {often} goes back {most - 1} times, that of {least} {counts[least] - 1} times, "
            "and the order of their samples is not known: leave out one of them by `topics`, or correct their times."
        )
    usual = min(int(np.median(np.diff(one.times[_piece(one, 0)]))) for one in topics if _piece(one, 0).sum() > 1)
    shifts, notes = [0], []
    for k in range(1, most):
        end = max(int(one.times[_piece(one, k - 1)][-1]) for one in topics) + shifts[-1]
        begin = min(int(one.times[_piece(one, k)][0]) for one in topics)
        shifts.append(end + usual - begin)
        notes.append(
            f"The clock goes back by {(end - shifts[-2] - begin) * 1e-9:.6g} s: a separate stretch follows, "
            f"whose times count {shifts[-1] * 1e-9:.6g} s later than logged."
        )
    first = [min(int(one.times[_piece(one, k)][0]) for one in topics) + shifts[k] for k in range(1, most)]

    def moved(one: Topic) -> Topic:
        if one.pieces is None or not len(one.times):
            return one
        return replace(one, times=one.times + np.array(shifts)[one.pieces])

    return [moved(one) for one in sensors], [moved(one) for one in driven], np.array(first), notes


def _piece(one: Samples | Actuation, k: int) -> np.ndarray:
    """The samples of a piece."""
    return np.ones(len(one.times), bool) if one.pieces is None else one.pieces == k


def _clock(times: Sequence[np.ndarray]) -> np.ndarray:
    """All times, each once, in their order."""
    both = np.sort(np.concatenate([np.zeros(0, np.int64), *times]), kind="stable")  # runs that grow are merged
    new = np.ones(len(both), bool)
    new[1:] = both[1:] != both[:-1]
    return both[new]


def _heard(one: Samples, chosen: Mapping[str, Samples]) -> np.ndarray:
    """The times of a sensor with a value in any column that is taken from it."""
    there = np.zeros(len(one.times), bool)
    for name, values in one.columns.items():
        if chosen.get(name) is one:
            there |= np.isfinite(values)
    return one.times[there]


def _chosen(file: str, sensors: Sequence[Samples]) -> dict[str, Samples]:
    """The sensor of each column."""
    chosen: dict[str, Samples] = {}
    for name in VEHICLE:
        able = [one for one in sensors if name in one.columns and np.any(np.isfinite(one.columns[name]))]
        able.sort(key=lambda one: one.rank.get(name, 1))
        if len(able) > 1 and able[0].rank.get(name, 1) == able[1].rank.get(name, 1):
            raise FileError(
                f"{file}: both {able[0].topic} and {able[1].topic} measure `{name}`: say which to take, as in "
                f'topics=["{able[0].topic}"] or --topics {able[0].topic}, or declare the sensors.'
            )
        if able:
            chosen[name] = able[0]
    return chosen


def _one_each(file: str, driven: Sequence[Actuation]) -> dict[str, Actuation]:
    found: dict[str, Actuation] = {}
    for one in driven:
        if one.name in found:
            raise FileError(f"{file}: both {found[one.name].topic} and {one.topic} are `{one.name}`: take one of them.")
        if len(one.times):
            found[one.name] = one
    return found


def _placed(clock: np.ndarray, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    found = np.full(len(clock), np.nan)
    there = (times >= clock[0]) & np.isfinite(values)
    found[np.searchsorted(clock, times[there])] = values[there]
    return found


def _held(clock: np.ndarray, one: Actuation) -> np.ndarray:
    return one.values[np.searchsorted(one.times, clock, side="right") - 1]


def _current(clock: np.ndarray, sensors: Sequence[Samples]) -> dict[str, np.ndarray]:
    """The velocity of the water at the times of the log, linear between those at which it is known."""
    found = [(name, one.times, v) for one in sensors for name, v in one.columns.items() if name.startswith(CURRENT)]
    return {name.removeprefix(CURRENT): np.interp(clock, times, values) for name, times, values in found if len(times)}


def _pauses(clock: np.ndarray, one: Actuation) -> list[str]:
    """Sentences on a command that ends before the log, and on its longest pause, during which it is held."""
    times = one.times[one.times <= clock[-1]]
    if len(times) < 2:
        return []
    between = np.diff(times)
    limit = max(PAUSE * float(np.median(between)), LEAST_PAUSE)
    longest, at = float(between.max()), int(np.argmax(between))
    found = []
    if longest > limit:
        found.append(
            f"{one.topic} is silent for {longest * 1e-9:.3g} s from {(times[at] - clock[0]) * 1e-9:.5g} s on: its last "
            "value is held."
        )
    if (left := float(clock[-1] - times[-1])) > limit:
        found.append(f"{one.topic} ends {left * 1e-9:.3g} s before the log: its last value is held.")
    return found


def clocks(file: str, topics: Sequence[Samples | Actuation]) -> list[str]:
    """A sentence where some topics count by stamps, others by the times of logging, and both clocks differ.

    Delays in a sensor make a stamp older, never younger than its time of logging, so that the smallest difference of
    all topics is that of the clocks. Raises FileError where topics are more than an hour apart.
    """
    by_log = [one for one in topics if one.lag is None and len(one.times)]
    lags = {one.topic: one.lag for one in topics if one.lag is not None}
    if not lags:
        return []
    apart = {**lags, **{one.topic: 0.0 for one in by_log}}
    low, high = min(apart, key=apart.__getitem__), max(apart, key=apart.__getitem__)
    if apart[high] - apart[low] > HOUR:
        raise FileError(
            f"{file}: the clocks of {low} and {high} are {(apart[high] - apart[low]) / HOUR:.3g} h apart: take when "
            'messages were logged, by stamp = "log" in a [[sensor]] or [[command]].'
        )
    nearest = min(lags.values(), key=abs)
    usual = min(float(np.median(np.diff(one.times))) * 1e-9 for one in topics if len(one.times) > 1)
    if not by_log or abs(nearest) <= usual:
        return []
    said = "after" if nearest > 0 else "before"
    return [
        f"Messages were logged {abs(nearest):.3g} s {said} their stamps, and {by_log[0].topic} has none and counts by "
        'the time of logging: take that of all by stamp = "log", or shift it by offset_s.'
    ]


def _choices(chosen: Mapping[str, Samples], sensors: Sequence[Samples]) -> list[str]:
    """A sentence for each sensor that was taken of columns that others measure, too."""
    found: dict[tuple[str, str], list[str]] = {}
    for name, one in chosen.items():
        others = [other.topic for other in sensors if name in other.columns and other is not one]
        if others:
            found.setdefault((one.topic, " and ".join(others)), []).append(name)
    return [f"Taken from {one}, not from {others}: {', '.join(names)}." for (one, others), names in found.items()]
