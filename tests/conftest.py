"""What all tests share: one thread a process, no display, the seed in the header, `long` tests only when asked for."""

from __future__ import annotations

import os

# Before NumPy is loaded: the matrices are small, and threads that wait for one another cost a hundredfold.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")


def pytest_report_header(config):
    from systems import SEED

    return f"seed of random systems: {SEED}"


def pytest_collection_modifyitems(config, items):
    if "long" in config.getoption("-m"):
        return
    config.hook.pytest_deselected(items=[item for item in items if "long" in item.keywords])
    items[:] = [item for item in items if "long" not in item.keywords]
