"""What all tests share: one thread a process, no display, the seed in the header, and which tests run when."""

from __future__ import annotations

import os

# Before NumPy is loaded: the matrices are small, and threads that wait for one another cost a hundredfold.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")
# Before JAX is loaded, which otherwise walks the stack for each equation that it compiles.
os.environ.setdefault("JAX_TRACEBACK_IN_LOCATIONS_LIMIT", "0")

import gc
import shutil
import tempfile
import time
from collections import defaultdict

import pytest

import tiers

CACHE = pytest.StashKey[str]()
"""The folder in which this run of tests keeps what set-up finds; its processes share it."""

END = pytest.StashKey[float]()
"""The time, s, after which no test begins, with `--minutes`."""

gc.set_threshold(50_000, 20, 20)  # traces are many small objects: looking for cycles took 5 % of the time


def pytest_addoption(parser):
    parser.addoption("--measure", action="store_true", help="write what each test costs to tests/seconds.txt")
    parser.addoption("--minutes", type=float, help="tests that have not begun after so many minutes are skipped")


def pytest_configure(config):
    if "COADJOINT_CACHE" not in os.environ:  # what other versions or runs have kept is not tested
        os.environ["COADJOINT_CACHE"] = config.stash[CACHE] = tempfile.mkdtemp(prefix="coadjoint-cache-")
    if config.getoption("--minutes") is not None:
        config.stash[END] = time.monotonic() + 60 * config.getoption("--minutes")
    if config.getoption("--measure"):
        from measuring import Measuring

        config.pluginmanager.register(Measuring(writes=not hasattr(config, "workerinput")))


def pytest_unconfigure(config):
    if CACHE in config.stash:
        del os.environ["COADJOINT_CACHE"]
        shutil.rmtree(config.stash[CACHE], ignore_errors=True)


def pytest_runtest_setup(item):
    if time.monotonic() > item.config.stash.get(END, float("inf")):
        pytest.skip(f"not begun after {item.config.getoption('--minutes'):g} minutes")


def pytest_report_header(config):
    from systems import SEED

    return f"seed of random systems: {SEED}"


def _function(nodeid: str) -> str:
    return nodeid.split("[", 1)[0]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Mark what a budget of processor time leaves to `-m long` and `-m exhaustive`; those run only when asked for."""
    named = [_function(argument) for argument in config.args if "::" in argument]
    functions: dict[str, list[pytest.Item]] = defaultdict(list)
    for item in items:
        if not any(_function(item.nodeid).endswith(name) for name in named):
            functions[_function(item.nodeid)].append(item)
    together = defaultdict(list)  # functions of a file with the same cases, which share what is prepared for each
    for name, cases in functions.items():
        alike = [item.nodeid[len(name) :] for item in cases]
        together[(name.split("::")[0], *alike) if any(alike) else (name,)].append(name)
    known = tiers.seconds()
    for names in together.values():
        budgets = [functions[name][0].get_closest_marker("budget") for name in names]
        more = [mark.args[0] if mark else tiers.LONG for mark in budgets]
        further = ["further" in item.keywords for item in functions[names[0]]]
        found = tiers.tiers(further, [known.get(name, 0.0) for name in names], more)
        for name in names:
            for item, tier in zip(functions[name], found, strict=True):
                if tier:
                    item.add_marker(tier)
