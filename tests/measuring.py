"""Processor time of each test, written to `seconds.txt` as the mean of the cases of a function.

`pytest -n 2 -m "" --measure` measures all; with fewer tests the lines of the others stay.
"""

from __future__ import annotations

import os
from collections import defaultdict

import pytest

import tiers

LEAST = 0.3
"""What all cases of a function take together must be more than this, s, for a line of the file."""

HEAD = """\
# Seconds of processor time a case takes, by function of tests; `pytest -n 2 -m "" --measure` writes this file.
# What is not here is cheap. How it is used: tiers.py.
"""


def _spent() -> float:
    """Processor time of this process and of those that it waited for, s."""
    return sum(os.times()[:4])


class Measuring:
    """A plugin that measures in each worker, and writes in the process that collects their reports."""

    def __init__(self, writes: bool):
        self.writes, self.began = writes, 0.0
        self.found: dict[str, list[float]] = defaultdict(list)

    def pytest_runtest_logstart(self):
        self.began = _spent()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item, call):
        report = yield
        if call.when == "teardown":
            report.user_properties.append(("seconds", _spent() - self.began))
        return report

    def pytest_runtest_logreport(self, report):
        if report.when == "teardown":
            self.found[report.nodeid.split("[", 1)[0]].append(dict(report.user_properties)["seconds"])

    def pytest_sessionfinish(self):
        if not self.writes:
            return
        known = tiers.seconds() if tiers.FILE.exists() else {}
        for name, times in self.found.items():
            known.pop(name, None)
            if sum(times) > LEAST:
                known[name] = sum(times) / len(times)
        lines = (f"{name} {known[name]:.3g}\n" for name in sorted(known))
        tiers.FILE.write_text(HEAD + "".join(lines))
