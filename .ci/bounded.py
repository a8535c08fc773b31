"""A plugin of pytest: `--within N` leaves out the tests that have not begun after N s of processor time.

The processes of pytest-xdist share them. `--before T` leaves out what has not begun at the time T of the clock, s;
`--backwards` begins with the last test.
"""

from __future__ import annotations

import os
import time

LEFT_OUT = "left out: the time of this part was up"


def pytest_addoption(parser) -> None:
    parser.addoption("--within", type=float, default=float("inf"), help="processor time after which no test begins, s")
    parser.addoption("--before", type=float, default=float("inf"), help="time of the clock after which none begins, s")
    parser.addoption("--backwards", action="store_true", help="run the last test first")


def pytest_collection_modifyitems(config, items: list) -> None:
    if config.option.backwards:
        items.reverse()


def pytest_runtest_setup(item) -> None:
    import pytest

    share = item.config.option.within / int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    if sum(os.times()[:4]) > share or time.time() > item.config.option.before:
        pytest.skip(LEFT_OUT)
