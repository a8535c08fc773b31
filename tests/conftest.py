"""What all tests share: one thread a process, no display, the seed in the header, cases that run, and their cost."""

from __future__ import annotations

import os

# Before NumPy is loaded: the matrices are small, and threads that wait for one another cost a hundredfold.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")
# Before JAX is loaded, which otherwise walks the stack for each equation that it compiles.
os.environ.setdefault("JAX_TRACEBACK_IN_LOCATIONS_LIMIT", "0")

# Most programs of the tests run few times: to compile them with fewer optimisations saves a quarter of the time.
os.environ.setdefault("JAX_DISABLE_MOST_OPTIMIZATIONS", "1")

import gc
import shutil
import tempfile

import pytest

pytest_plugins = ["cases", "costs"]

CACHE = pytest.StashKey[str]()
"""The folder in which this run of tests keeps what set-up finds; its processes share it."""

gc.set_threshold(50_000, 20, 20)  # traces are many small objects: looking for cycles took 5 % of the time
gc.disable()  # while tests are collected, all of which stays


def pytest_configure(config):
    if "COADJOINT_CACHE" not in os.environ:  # what other versions or runs have kept is not tested
        os.environ["COADJOINT_CACHE"] = config.stash[CACHE] = tempfile.mkdtemp(prefix="coadjoint-cache-")
    if config.option.markexpr == "not long" and not config.option.all:  # those of tests/kernels are optimised
        os.environ.setdefault("COADJOINT_OPTIMIZE", "0")


def pytest_collection_finish():
    gc.freeze()
    gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_unconfigure(config):
    gc.freeze()  # the end of the process looks for cycles several times, which takes seconds
    if CACHE in config.stash:
        del os.environ["COADJOINT_CACHE"]
        shutil.rmtree(config.stash[CACHE], ignore_errors=True)


@pytest.fixture(scope="module")
def optimised():
    """Machine code as users have it: operations fuse, and programs that compute the same in other orders agree."""
    from coadjoint.kernels.run.machine import processor

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COADJOINT_OPTIMIZE", "1")
        processor.cache_clear()
        yield
    processor.cache_clear()


def pytest_report_header(config):
    from systems import SEED

    return f"seed of random systems: {SEED}"
