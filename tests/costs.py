"""Processor time of tests: one that costs more than 1 s must be marked `long`, and all together have a budget.

Counted are this process and the children that it waited for. Apart from a test are counted imports, the collection of
garbage, and fixtures that several tests share: they fall to whichever test comes first. A loop in Python measures how
fast the processor is, when the tests begin and once more after a test that costs too much; the slower of both counts.
For the budget it is measured after every `OFTEN` tests, and the median counts.
"""

from __future__ import annotations

import _frozen_importlib
import gc
import json
import resource
from pathlib import Path
from statistics import median

import pytest

from calibration import REFERENCE, loop

LIMIT = 1.0
"""Processor time that a test may take, s, on a processor that runs the loop in `REFERENCE`."""

NOISE = 2.0
"""How many times the limit fails: the processor times of a test differ by as much when other programs run."""

FIRST, USED = 1.0, 10
"""What each of the first tests of a process may take more, s, for what is used for the first time, and how many."""

OFTEN = 250
"""After how many tests of a process the loop measures the processor for the budget."""

BUDGET = 310.0
"""Processor time that all tests which run by default may take together, s, with their collection."""


def spent() -> float:
    """Processor time of this process and of the children that it waited for, s."""
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in used)


class Apart:
    """Processor time, s, of what no single test is to blame for; what happens within another is counted once."""

    def __init__(self) -> None:
        self.seconds, self.depth, self.began = 0.0, 0, 0.0

    def __enter__(self) -> None:
        if self.depth == 0:
            self.began = spent()
        self.depth += 1

    def __exit__(self, *_: object) -> None:
        self.depth -= 1
        if self.depth == 0:
            self.seconds += spent() - self.began

    def collecting(self, phase: str, _: dict) -> None:
        """A callback of the collection of garbage."""
        if phase == "start":
            self.__enter__()
        elif self.depth:
            self.__exit__()

    def importing(self, load):
        """The function that loads a module which was not loaded before, counted apart."""

        def loaded(name, import_):
            with self:
                return load(name, import_)

        return loaded


def pytest_addoption(parser) -> None:
    parser.addoption("--budget", action="store_true", help="fail if all tests together exceed their processor time")
    parser.addoption("--costs", metavar="FILE", help="write the processor time of each test, s, to a JSON file")


def pytest_configure(config) -> None:
    config.pluginmanager.register(Costs(config))


class Costs:
    """Measures each test in its process; the process that reports adds up what all of them took."""

    def __init__(self, config) -> None:
        self.config, self.apart = config, Apart()
        self.calibration = loop()
        self.speeds = [self.calibration]
        self.count = 0
        self.began, self.collected, self.tests = 0.0, 0.0, {}
        self.processes: list[dict[str, float]] = []
        self.load = _frozen_importlib._find_and_load
        _frozen_importlib._find_and_load = self.apart.importing(self.load)
        gc.callbacks.append(self.apart.collecting)

    def pytest_unconfigure(self) -> None:
        _frozen_importlib._find_and_load = self.load
        gc.callbacks.remove(self.apart.collecting)

    def pytest_collection_finish(self) -> None:
        self.collected = spent()

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef):
        if fixturedef.scope == "function":
            return (yield)
        with self.apart:
            return (yield)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_setup(self):
        self.began, self.apart.seconds = spent(), 0.0
        return (yield)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item, call):
        report = yield
        cost = spent() - self.began
        if call.when == "teardown":
            report.user_properties.append(("processor", cost))
        elif call.when == "call" and report.passed and "long" not in item.keywords and not item.config.option.all:
            own = cost - self.apart.seconds
            self.count += 1
            if self.count % OFTEN == 0:
                self.speeds.append(loop(1))
            if self.over(own, self.calibration / REFERENCE):
                self.judge(report, own)
        return report

    def over(self, own: float, slower: float) -> bool:
        """Whether a test costs too much on a processor that is so many times as slow as the reference."""
        return own > (LIMIT + (FIRST if self.count <= USED else 0.0)) * NOISE * slower

    def judge(self, report, own: float) -> None:
        """Fail a test that costs too much, unless the processor has become slower meanwhile."""
        slower = max(1.0, self.calibration / REFERENCE, loop() / REFERENCE)
        if self.over(own, slower):
            report.outcome = "failed"
            report.longrepr = (
                f"The test took {own:.2f} s of processor time, but may take {LIMIT:g} s, {slower:.2f} times that on "
                f"this processor, and {NOISE:g} times that for noise: mark it `long` or make it cheaper."
            )

    def pytest_runtest_logreport(self, report) -> None:
        if report.when == "teardown":
            self.tests[report.nodeid] = dict(report.user_properties)["processor"]

    def own(self) -> dict[str, float]:
        """What this process took, s."""
        return {"all": spent(), "collection": self.collected, "calibration": median(self.speeds)}

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node) -> None:
        if "costs" in getattr(node, "workeroutput", {}):
            self.processes.append(node.workeroutput["costs"])

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session) -> None:
        if hasattr(self.config, "workeroutput"):
            self.config.workeroutput["costs"] = self.own()
            return
        if path := self.config.option.costs:
            Path(path).write_text(json.dumps(self.tests, indent=0))
        if self.config.option.budget and self.total() > BUDGET * self.slowest():
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def total(self) -> float:
        """Processor time of all processes, s; the workers are children that this one has waited for, or not yet."""
        mine = resource.getrusage(resource.RUSAGE_SELF)
        return mine.ru_utime + mine.ru_stime + sum(one["all"] for one in self.processes) if self.processes else spent()

    def slowest(self) -> float:
        """How many times as long as on the reference the loop took, in the slowest process."""
        return max(1.0, *(one["calibration"] / REFERENCE for one in (self.own(), *self.processes)))

    def pytest_terminal_summary(self, terminalreporter) -> None:
        all_ = [self.own(), *self.processes]
        collection, slowest, total = sum(one["collection"] for one in all_), self.slowest(), self.total()
        tests = sum(self.tests.values())
        terminalreporter.write_line(
            f"processor time: {total:.0f} s (collection {collection:.0f} s in {len(all_)} processes, tests {tests:.0f} "
            f"s); a loop of {REFERENCE:g} s took {slowest * REFERENCE:.3f} s"
        )
        if self.config.option.budget:
            over = "is exceeded" if total > BUDGET * slowest else "is kept"
            terminalreporter.write_line(f"the budget of {BUDGET:g} s × {slowest:.2f} = {BUDGET * slowest:.0f} s {over}")
