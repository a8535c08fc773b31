"""Times of contenders that take turns on a machine which others use too."""

from __future__ import annotations

import gc
import os
import statistics
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

Clock = Callable[[], float]


def single_threaded() -> None:
    """One thread for BLAS, OpenMP and XLA; call before they are imported."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[name] = "1"
    os.environ["MPLBACKEND"] = "Agg"


def pin(cores: int) -> list[int]:
    """Keep this process on the least busy `cores` cores; returns them. Nothing happens where the system cannot."""
    if not hasattr(os, "sched_setaffinity"):
        return []
    usable = sorted(os.sched_getaffinity(0), key=_busy(0.3))[:cores]
    os.sched_setaffinity(0, usable)
    return usable


def _busy(seconds: float) -> Callable[[int], float]:
    """Core → the time that it was not idle during `seconds`."""

    def idle() -> dict[int, int]:
        with open("/proc/stat", encoding="ascii") as file:
            rows = [line.split() for line in file if line.startswith("cpu") and line[3].isdigit()]
        return {int(row[0][3:]): int(row[4]) for row in rows}

    try:
        before = idle()
        time.sleep(seconds)
        after = idle()
    except OSError:
        return lambda core: 0.0
    return lambda core: -(after.get(core, 0) - before.get(core, 0))


@dataclass(frozen=True)
class Contender:
    """Something to time: `run` does `steps` steps' worth of work."""

    run: Callable[[], object]
    steps: float = 1.0


@dataclass(frozen=True)
class Timing:
    """Seconds per step, repetition by repetition."""

    each: tuple[float, ...]

    @property
    def median(self) -> float:
        return statistics.median(self.each)

    def ratio(self, other: Timing) -> float:
        """The median over the repetitions of what this took relative to the other."""
        return statistics.median(mine / theirs for mine, theirs in zip(self.each, other.each, strict=True))


def interleaved(
    contenders: Mapping[str, Contender], repetitions: int, clock: Clock = time.process_time
) -> dict[str, Timing]:
    """Every contender once in each repetition, after one run that is not counted.

    The default clock is the processor time of this process, all of its threads together: time for which the machine
    runs others does not count. For several threads take time.perf_counter.
    """
    found: dict[str, list[float]] = {name: [] for name in contenders}
    for contender in contenders.values():
        contender.run()
    gc.disable()
    try:
        for _ in range(repetitions):
            for name, contender in contenders.items():
                began = clock()
                contender.run()
                found[name].append((clock() - began) / contender.steps)
    finally:
        gc.enable()
    return {name: Timing(tuple(times)) for name, times in found.items()}


def table_of(timings: Mapping[str, Timing], yardstick: str) -> dict[str, dict[str, float]]:
    """Name → median seconds per step and ratio to the yardstick."""
    return {
        name: {"seconds": timing.median, "ratio": timing.ratio(timings[yardstick])} for name, timing in timings.items()
    }


def spread(values: Iterable[float]) -> float:
    """(largest − smallest)/median."""
    values = list(values)
    return (max(values) - min(values)) / statistics.median(values)
