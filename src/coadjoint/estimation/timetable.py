"""The timetable of the measurements of a log, as orders for the engine of a filter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree, Scalar
from coadjoint.clocks import jumps_ahead
from coadjoint.errors import ArgumentError, shown, warn
from coadjoint.estimation.numbers import float64
from coadjoint.kernels.emit.kalman import CORRECT, PREDICT, SAVE, SET
from coadjoint.memory import require_room
from coadjoint.units import jumps_by_degrees

SAME = 1e-9
"""Times that differ by less, s, are one."""
GAP = 5.0
"""The multiple of the usual time for which a reading may be held without a warning."""
SELDOM = 1.0
"""s between readings held over steps, from which on their times seem to be in another unit."""
LARGEST = 8e9
"""Bytes that a log may take, with its saved results."""
OF_A_NODE = 300.0
"""Bytes that the orders at a node take."""
LATEST = 1e6
"""s; up to here float64 distinguishes times that differ by `SAME`."""


def require_times(t: float, what: str) -> None:
    """Raise ArgumentError where float64 does not resolve times around t, s."""
    if not abs(t) <= LATEST:
        raise ArgumentError(
            f"{what} at t = {t:.10g} s, but a filter counts from a time near 0, at most {LATEST:g} s away, where "
            "numbers resolve short steps: subtract the time at which the log begins."
        )


def require_readings(name: str, one: Series | None, nodes: np.ndarray, dt: float, first: bool) -> None:
    """Raise ArgumentError where steps have no reading of an input that they await, and warn of gaps.

    nodes: the times of the log, (K,) s. first: whether there was no reading before.
    """
    times = np.zeros(0) if one is None else one.times[one.times < nodes[-1]]
    if first and not (len(times) and times[0] <= nodes[0] + SAME):
        later = f"begin at {times[0]:g} s" if len(times) else "are missing"
        raise ArgumentError(
            f"There is no step without a reading of `{name}`, but those of `inputs` {later}, and the filter is at t = "
            f"{nodes[0]:g} s: start it with them."
        )
    times = np.concatenate([nodes[:1], times[times > nodes[0]], nodes[-1:]])
    held = np.diff(times)
    if len(held) > 2 and (usual := float(np.median(held[:-1]))) >= SELDOM:
        warn(
            f"Readings of `{name}` come every {usual:.6g} s, and each is held that long: are their times in seconds?",
            stacklevel=3,
        )
    if np.max(held) > GAP * max(dt, float(np.median(held[:-1])) if len(held) > 1 else 0.0):
        k = int(np.argmax(held))
        if len(jumps_ahead(times)):
            raise ArgumentError(
                f"There is no reading of `{name}` from {times[k]:.6g} s to {times[k + 1]:.6g} s, which is a jump "
                "of the "
                "clock, or a pause that no filter bridges: run one filter on each stretch, up to there by `until`, and "
                "from there from a new start."
            )
        warn(
            f"There is no reading of `{name}` from {times[k]:.6g} s to {times[k + 1]:.6g} s: the one before is held, "
            "and the deviations do not tell what that costs.",
            stacklevel=3,
        )


def require_radians(name: str, one: Series, angles: np.ndarray) -> None:
    """Warn of angles that are in degrees; angles: which of the numbers are, (size,)."""
    if jumps_by_degrees(one.values[..., angles]):
        warn(
            f"`{name}` of `measured` jumps by 360 from one value to the next, as degrees do and radians never: give "
            "np.radians of it.",
            stacklevel=3,
        )


class Series(NamedTuple):
    """times (K,) s, and values (K, size), or (K, members, size)."""

    times: np.ndarray
    values: np.ndarray


def series(name: str, given: PyTree, argument: str, sizes: Mapping[str, int], members: int | None) -> Series:
    """(times, values) as given for a name; raises ArgumentError unless they fit."""
    checks.known(name, sizes, "part", f"Argument `{argument}`")
    try:
        times, values = (float64(part) for part in given)
    except (TypeError, ValueError):
        raise ArgumentError(
            f"`{name}` of `{argument}` must be (times, values), both numbers, but is {shown(given)}."
        ) from None
    size, count = sizes[name], len(np.atleast_1d(times))
    if times.ndim != 1 or len(np.atleast_1d(values)) != count:
        raise ArgumentError(
            f"`{name}` of `{argument}` must be times (K,) and as many values, but their shapes are {times.shape} and "
            f"{values.shape}."
        )
    if not np.all(np.isfinite(times)):
        k = int(np.argmin(np.isfinite(times)))
        raise ArgumentError(
            f"The times of `{name}` of `{argument}` must be finite, but number {k} of {count} is {times[k]}: leave it "
            "out."
        )
    if argument == "inputs" and not np.all(np.isfinite(values)):
        at = times[int(np.argmin(np.all(np.isfinite(values.reshape(count, -1)), axis=1)))]
        raise ArgumentError(
            f"`{name}` of `inputs` must be finite numbers, but not all are at t = {at:g} s: leave such readings out, "
            "and the one before is held."
        )
    if np.any(np.isinf(values)):
        k = int(np.argmax(np.any(np.isinf(values.reshape(count, -1)), axis=1)))
        raise ArgumentError(
            f"`{name}` of `{argument}` must be numbers, NaN where nothing was measured, but number {k + 1} of {count} "
            "is infinite: leave it out, or give NaN."
        )
    if np.any(np.diff(times) < 0):
        raise ArgumentError(f"The times of `{name}` of `{argument}` must not go back: sort them.")
    if values.size == count * size:
        return Series(times, values.reshape(count, size))
    if members is not None and values.size == count * members * size and values.shape[1] == members:
        return Series(times, values.reshape(count, members, size))
    raise ArgumentError(
        f"`{name}` of `{argument}` is {size} numbers at each time, but its values have the shape {values.shape}."
    )


class Orders(NamedTuple):
    """orders (count, 4), data (1 or members, …), and the places of everything in an output (members, size)."""

    orders: np.ndarray
    data: np.ndarray
    size: int
    times: np.ndarray
    rows: int
    P: int
    nis: dict[str, tuple[np.ndarray, int]]


class Timetable:
    """The nodes of a log: multiples of dt after the start, and the times of measurements and inputs between them."""

    def __init__(self, begin: float, dt: Scalar, until: Any, measured: dict[str, Series], inputs: dict[str, Series]):
        checks.positive(dt, "dt")
        ends = [one.times[-1] for one in measured.values() if len(one.times)]
        if until is None and not ends:
            raise ArgumentError("Without measurements a run needs `until`, the time at which it ends.")
        if until is not None:
            checks.number(until, "until")
        end = float(max(ends) if until is None else until)
        require_times(end, "The log ends")
        if not end > begin - SAME:
            raise ArgumentError(f"The filter is at t = {begin:g} s, after the last time of the log, {end:g} s.")
        for name, one in measured.items():
            if len(one.times) and one.times[0] < begin - SAME:
                raise ArgumentError(
                    f"`{name}` begins at {one.times[0]:g} s, before the filter, which is at t = {begin:g} s: leave out "
                    "earlier values, or begin the filter there."
                )
        count = (end - begin) / float(dt)
        require_room(f"A log of {count:.3g} steps of {dt:g} s", OF_A_NODE * count, "take a longer dt", LARGEST)
        grid = begin + float(dt) * np.arange(int(np.ceil((end - begin) / dt - SAME)) + 1)
        others = [one.times for one in (*measured.values(), *inputs.values())]
        times = np.unique(np.concatenate([grid, [end], *others]))
        times = times[(times >= begin - SAME) & (times <= end + SAME)]
        self.times = times[np.concatenate([[True], np.diff(times) > SAME])]
        self.times[0] = begin
        self._measured, self._inputs, self._end = measured, inputs, end

    def orders(
        self,
        sizes: tuple[int, int, int],
        places: Mapping[str, int],
        every: int,
        full: bool,
        numbers: list[int],
    ) -> Orders:
        """The orders in sequence.

        sizes: of a row and of e, and the number of members. places: name of an input → its first number among all.
        every: the interval of saved nodes. full: whether all of P is saved. numbers: of the measurements.
        """
        size, n, members = sizes
        nodes, columns = len(self.times), _Columns()
        steps = columns.add(np.diff(self.times)[:, None])
        found = [_rows(np.arange(1, nodes), 0, PREDICT, steps + np.arange(nodes - 1), 0, 0)]
        kept, width = np.arange(0, nodes, every), n * n if full else n
        rows, P = 0, len(kept) * size
        needed = 8.0 * len(kept) * (size + width) * members
        require_room(f"A log of {len(kept):,} nodes", needed, "raise save_every", LARGEST)
        at = np.arange(len(kept))
        found.append(_rows(kept, 2, SAVE, rows + at * size, P + at * width, int(full)))
        output, nis = P + len(kept) * width, {}
        for number, (name, one) in zip(numbers, self._measured.items(), strict=True):
            here = one.times <= self._end + SAME
            j = np.arange(np.count_nonzero(here))
            place, m = columns.add(one.values[here]), one.values.shape[-1]
            found.append(_rows(self._node(one.times[here]), 1, CORRECT, number, place + j * m, output + 2 * j))
            nis[name], output = (one.times[here], output), output + 2 * len(j)
        for name, one in self._inputs.items():
            here = one.times <= self._end + SAME
            j, m = np.arange(np.count_nonzero(here)), one.values.shape[-1]
            place = columns.add(one.values[here])
            found.append(_rows(self._node(one.times[here]), 3, SET, places[name], m, place + j * m))
        table = np.concatenate(found)
        table = table[np.lexsort((table[:, 1], table[:, 0]))]
        return Orders(
            np.ascontiguousarray(table[:, 2:]), columns.joined(), output, self.times[kept], rows, P, nis
        )  # fmt: skip

    def _node(self, times: np.ndarray) -> np.ndarray:
        """The nodes of times; earlier times count as at the first one."""
        return np.clip(np.searchsorted(self.times, times - SAME), 0, len(self.times) - 1)


def _rows(*columns: Any) -> np.ndarray:
    """Rows of integers from columns, some of which are constant."""
    return np.stack(np.broadcast_arrays(*columns), axis=1).astype(np.int64).reshape(-1, 6)


class _Columns:
    """Numbers for all members, or separately for each, one after the other."""

    def __init__(self) -> None:
        self._parts: list[np.ndarray] = []
        self._size = 0

    def add(self, values: np.ndarray) -> int:
        """The beginnings of (K, size) or (K, members, size)."""
        part = values.reshape(1, -1) if values.ndim == 2 else values.transpose(1, 0, 2).reshape(values.shape[1], -1)
        self._parts.append(part)
        start, self._size = self._size, self._size + part.shape[1]
        return start

    def joined(self) -> np.ndarray:
        members = max(len(part) for part in self._parts)
        return np.concatenate([np.broadcast_to(part, (members, part.shape[1])) for part in self._parts], axis=1).copy()
