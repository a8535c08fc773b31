"""How fast this processor is, by a loop in Python: tests and `.ci/run` scale their limits with it."""

from __future__ import annotations

import time

REFERENCE = 0.033
"""Processor time of the loop, s, on the processor for which the limits are meant."""


def loop(count: int = 3) -> float:
    """Processor time of a million additions, s: the median of so many."""
    times = []
    for _ in range(count):
        began, total = time.thread_time(), 0.0
        for i in range(1_000_000):
            total += (i % 7) * 0.5
        times.append(time.thread_time() - began)
    return sorted(times)[count // 2]
