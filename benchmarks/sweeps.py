"""Sweeps of one-minute missions of BlueROV2: runs a second, what orchestration costs, what a second worker adds."""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path
from typing import Any

from coadjoint.sweeps.file import Sweep, of_tables, table_of
from coadjoint.sweeps.sweep import execute

MISSION = Path(__file__).parents[1] / "examples" / "station.toml"
STEPS = 1200
"""Of a mission: one minute in steps of 0.05 s."""
MANY = 10_000_000


def measure(quick: bool) -> dict[str, Any]:
    """The same sweep by one worker and by two, tasks of some ten seconds; `quick`, few members and short tasks.

    COADJOINT_SWEPT gives another number of members than 200,000.
    """
    members = int(os.environ.get("COADJOINT_SWEPT", "4096" if quick else "200000"))
    task = 512 if quick else min(20_032, -(-members // 10))
    found: dict[str, Any] = {"members": members, "task": task, "steps": STEPS, "cores": os.cpu_count()}
    for workers in (1, 2):
        for keep in ("statistics", "members") if workers == 1 and not quick else ("statistics",):
            found[f"{keep}_{workers}"] = _swept(_sweep(members, task, keep), workers)
    one, two = found["statistics_1"], found["statistics_2"]
    found["speed_up"] = one["seconds"] / two["seconds"]
    found["run_seconds"] = one["busy_seconds"] / members
    found["hours_of_many"] = {str(cores): found["run_seconds"] * MANY / cores / 3600 for cores in (2, 1000)}
    return found


def _sweep(members: int, task: int, keep: str) -> Sweep:
    table = {
        "sweep": {"run": MISSION.name, "sampling": "sobol", "members": members, "task": task},
        "vary": {
            "parameters": {"mass_kg": {"from": 13.0, "to": 14.0}},
            "initial": {"position_m": [0.0, 0.0, {"from": 0.5, "to": 8.0}], "heading_deg": {"from": 0.0, "to": 360.0}},
        },
        "results": {"keep": keep, "figures": False},
    }
    return of_tables(table, table_of(MISSION, "mission file"), MISSION, {})


def _swept(sweep: Sweep, workers: int) -> dict[str, float]:
    """Wall time from the first line to the last, and its parts. Orchestration is what no worker was at work in."""
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        told = execute(sweep, Path(folder) / "out", workers=workers, progress=False).summary
        whole = time.perf_counter() - began
    there = workers * told["computing_seconds"]
    return {
        "seconds": whole,
        "starting_seconds": told["starting_seconds"],
        "busy_seconds": told["busy_seconds"],
        "kernel_seconds": told["kernel_seconds"],
        "writing_seconds": told["writing_seconds"],
        "task_seconds": told["busy_seconds"] / told["tasks"],
        "orchestration": (there - told["busy_seconds"]) / there,
        "failed": float(sweep.members - told["finished"]),
    }
