"""A logged trajectory: samples of the measurements and of the inputs of a vehicle."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from coadjoint import checks
from coadjoint.clocks import other_unit
from coadjoint.errors import ArgumentError
from coadjoint.identification.channels import POSITION, UNITS, VELOCITY
from coadjoint.identification.kinematics import undecided
from coadjoint.identification.log_checks import implausible


@dataclass(frozen=True)
class Log:
    """Samples at increasing times, at any intervals; NaN where a sensor was silent.

    `time`: (n,) s. `columns`: the measurements, name → (n,), SI units and rad, north–east–down, forward–starboard–
    down; those of a vehicle are named north, east, depth, roll, pitch, heading, u, v, w, p, q, r.
    `inputs`: the inputs, name → (n,) or (n, k), without gaps. `notes`: unusual features, a sentence each, and
    implausible columns: degrees as rad, heights as depths. `actual`: the states of actuators, if logged together with
    their commands; they are not fitted. `positions`: the place in the body of the sensor of a position or velocity,
    name → (x, y, z) m; by default O. `step`: the dt of the simulation that wrote the log, s; None for a measured log.
    `breaks`: samples at which a new stretch begins, because the clock jumped before them. `current`: the velocity of
    the water, north, east, down → (n,) m/s, where the log has it; it is not fitted. `doubts`: the notes on columns that
    do not fit their names. Raises ArgumentError for times that do not increase, for other lengths and for numbers that
    are not finite.
    """

    time: np.ndarray
    columns: Mapping[str, np.ndarray]
    inputs: Mapping[str, np.ndarray] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    step: float | None = None
    actual: Mapping[str, np.ndarray] = field(default_factory=dict)
    positions: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    breaks: tuple[int, ...] = ()
    current: Mapping[str, np.ndarray] = field(default_factory=dict)
    doubts: tuple[str, ...] = field(default=(), init=False)

    def __post_init__(self):
        time = _numbers(self.time, "time")
        if time.ndim != 1 or len(time) < 2:
            raise ArgumentError(f"A log needs at least two samples, but `time` has shape {time.shape}.")
        if not np.all(np.isfinite(time)):
            at = int(np.argmin(np.isfinite(time)))
            raise ArgumentError(f"Times of a log must be finite, but sample {at} is at {time[at]:g} s: leave it out.")
        bad = np.flatnonzero(~(np.diff(time) > 0))
        if len(bad):
            at = int(bad[0])
            raise ArgumentError(
                f"The time of a log must increase, but sample {at + 1} is at {time[at + 1]:g} s after {time[at]:g} s: "
                "sort the samples and give each once."
            )
        if doubt := other_unit(time):
            raise ArgumentError(f"Of a log {doubt}")
        if any(not 0 < k < len(time) for k in self.breaks):
            raise ArgumentError(f"`breaks` of a log must be samples from 1 to {len(time) - 1}, but are {self.breaks}.")
        for part in ("columns", "inputs", "units", "actual", "positions", "current"):
            checks.instance(getattr(self, part), f"`{part}` of a log", Mapping, "by names")
        columns = {name: _numbers(values, name) for name, values in self.columns.items()}
        inputs = {name: _numbers(values, name) for name, values in self.inputs.items()}
        actual = {name: _numbers(values, name) for name, values in self.actual.items()}
        current = {name: _numbers(values, f"current_{name}") for name, values in self.current.items()}
        checks.all_known(self.current, ("north", "east", "down"), "component", "`current` of a log")
        did = {f"actual[{name!r}]": values for name, values in actual.items()}
        water = {f"current_{name}": values for name, values in current.items()}
        for name, values in {**columns, **inputs, **did, **water}.items():
            if values.shape[:1] != time.shape or (name in columns and values.ndim != 1):
                raise ArgumentError(f"`{name}` must have one number for each of {len(time)} times: {values.shape}.")
            if np.any(np.isinf(values)):
                at = int(np.argmax(np.isinf(values).reshape(len(time), -1).any(axis=1)))
                remedy = "give NaN where a sensor was silent" if name in columns else "give what was commanded"
                raise ArgumentError(f"`{name}` is infinite in sample {at}, at {time[at]:g} s: {remedy}.")
            if name not in columns and name not in water and np.any(np.isnan(values)):
                at = time[np.isnan(values).reshape(len(time), -1).any(axis=1)][0]
                what = "Input `" if name in inputs else "`"
                raise ArgumentError(f"{what}{name}` is missing at {at:g} s: inputs of a vehicle must have no gaps.")
            if (name in columns or name in water) and np.all(np.isnan(values)):
                raise ArgumentError(f"Column `{name}` holds no number: leave it out.")
        for name in self.positions:
            if name not in columns or name not in (*POSITION, *VELOCITY):
                able = ", ".join(n for n in (*POSITION, *VELOCITY) if n in columns) or "none"
                raise ArgumentError(f"`positions` names `{name}`, but only these have a place of a sensor: {able}.")
        places = {name: _place(value, name) for name, value in self.positions.items()}
        found = {"time": time, "columns": columns, "inputs": inputs, "actual": actual, "positions": places}
        found |= {"current": current, "breaks": tuple(sorted({int(k) for k in self.breaks}))}
        for key, value in found.items():
            object.__setattr__(self, key, value)
        object.__setattr__(self, "units", {**{n: UNITS[n] for n in columns if n in UNITS}, **self.units})
        object.__setattr__(self, "doubts", tuple(implausible(time, columns, self.units)))
        sparse = undecided(time, columns, self.units)
        new = [note for note in (*self.doubts, *sparse) if note not in self.notes]
        object.__setattr__(self, "notes", (*self.notes, *new))

    def __len__(self) -> int:
        return len(self.time)

    @property
    def interval(self) -> float:
        """The median time between samples, s."""
        return float(np.median(np.diff(self.time)))

    @property
    def duration(self) -> float:
        """From the first sample to the last, s."""
        return float(self.time[-1] - self.time[0])

    def between(self, start: float, end: float) -> Log:
        """The samples with start ≤ time ≤ end."""
        return self._of((self.time >= start) & (self.time <= end))

    def stretches(self) -> tuple[Log, ...]:
        """The parts between `breaks`, each a log; those of a single sample are left out."""
        edges = [0, *self.breaks, len(self)]
        number = np.arange(len(self))
        parts = [(number >= a) & (number < b) for a, b in pairwise(edges)]
        return tuple(self._of(part) for part in parts if part.sum() > 1)

    def _of(self, here: np.ndarray) -> Log:
        """The log of some samples."""
        groups = self.columns, self.inputs, self.actual, self.current
        columns, inputs, actual, current = ({k: v[here] for k, v in part.items()} for part in groups)
        # A column may be silent in all of them, as in a run without its sensor.
        columns, current = ({k: v for k, v in part.items() if np.any(~np.isnan(v))} for part in (columns, current))
        first = np.cumsum(here)[list(self.breaks)] - here[list(self.breaks)]
        breaks = tuple(int(k) for k in first if 0 < k < here.sum())
        return Log(
            self.time[here], columns, inputs, self.units, self.notes, self.step, actual, self.positions, breaks, current
        )

    def first(self, name: str) -> np.ndarray | None:
        """The state of an actuator at the start: as logged, or else its first command; None if neither was logged."""
        known = self.actual.get(name, self.inputs.get(name))
        return None if known is None else known[0]

    def __repr__(self) -> str:
        driven = f", driven by {', '.join(self.inputs)}" if self.inputs else ""
        return f"<Log of {len(self)} samples over {self.duration:g} s: {', '.join(self.columns)}{driven}>"


def merged(logs: Sequence[Log]) -> Log:
    """Logs of one system in a row, each after the last sample of the one before it and with a break between them.

    Columns that some of them lack are missing there; inputs must be the same in all. Raises ArgumentError for logs that
    differ in inputs, in the units of a column or in the places of sensors.
    """
    found = list(logs) if isinstance(logs, (list, tuple)) else []
    checks.expect(
        found and all(isinstance(one, Log) for one in found),
        logs,
        "log",
        "a Log, as co.vehicles.logs.read_log(path) and co.identification.synthetic_log(run) make, or a list of them",
    )
    first, units = found[0], {}
    for number, one in enumerate(found, start=1):
        if set(one.inputs) != set(first.inputs):
            raise ArgumentError(
                f"Logs that are fitted together must have the same inputs, but log {number} has "
                f"{', '.join(one.inputs) or 'none'} and the first {', '.join(first.inputs) or 'none'}."
            )
        for name, unit in one.units.items():
            if units.setdefault(name, unit) != unit:
                raise ArgumentError(f"`{name}` is in {units[name]} in one log and in {unit} in log {number}.")
        if one.positions != first.positions:
            raise ArgumentError(f"The sensors of log {number} have other places, `positions`, than those of the first.")
    times, breaks, end, count = [], [], first.time[0] - first.interval, 0
    for one in found:
        times.append(one.time - one.time[0] + end + one.interval)
        breaks += [count] * (count > 0) + [count + k for k in one.breaks]
        end, count = times[-1][-1], count + len(one)

    def joined(group: str, names: Iterable[str]) -> dict[str, np.ndarray]:
        parts = [getattr(one, group) for one in found]
        missing = [np.full(len(one), np.nan) for one in found]
        return {
            name: np.concatenate([part.get(name, none) for part, none in zip(parts, missing, strict=True)])
            for name in names
        }

    def all_of(group: str) -> list[str]:
        return list(dict.fromkeys(name for one in found for name in getattr(one, group)))

    actual = [name for name in first.actual if all(name in one.actual for one in found)]
    steps = {one.step for one in found}
    return Log(
        np.concatenate(times),
        joined("columns", all_of("columns")),
        joined("inputs", first.inputs),
        units,
        tuple(dict.fromkeys(note for one in found for note in one.notes)),
        steps.pop() if len(steps) == 1 else None,
        joined("actual", actual),
        first.positions,
        tuple(breaks),
        joined("current", all_of("current")),
    )


def _numbers(values: object, name: str) -> np.ndarray:
    try:
        if np.asarray(values).dtype.kind in "biufO":
            return np.array(values, float)
    except (TypeError, ValueError):
        pass
    raise ArgumentError(f"`{name}` of a log must hold numbers, but is {values!r:.60}.")


def _place(value: object, name: str) -> tuple[float, float, float]:
    found = _numbers(value, f"positions[{name!r}]")
    checks.expect(
        found.shape == (3,) and np.all(np.isfinite(found)), value, f"`positions` of `{name}`", "three finite numbers, m"
    )
    return tuple(found.tolist())
