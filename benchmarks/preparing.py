"""What comes before the first step: tracing and compiling in fresh processes, and `coadjoint reproduce` as a whole."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
REPRODUCE = "from coadjoint.cli.main import main; main()"


def measure(quick: bool) -> dict[str, Any]:
    """Medians of seconds, with an empty folder for machine code and with a filled one."""
    repetitions = 1 if quick else 5
    runs = [_once() for _ in range(repetitions)]
    rows = {name: _medians([rows[name] for rows, _ in runs]) for name in runs[0][0]}
    rows["xla"] = _medians([_first_use("xla", "") for _ in range(1 if quick else 2)])
    return {"rows": rows, "reproduce": _medians([reproduced for _, reproduced in runs])}


def _medians(runs: list[dict[str, float]]) -> dict[str, float]:
    return {name: statistics.median(run[name] for run in runs) for name in runs[0]}


def _once() -> tuple[dict[str, dict[str, float]], dict[str, float]]:
    """Everything twice: the first run fills the folder for the second."""
    rows, reproduced = {}, {}
    with tempfile.TemporaryDirectory() as folder:
        for cache in ("empty", "filled"):
            for what in ("kernel", "simulate"):
                rows[f"{what}, {cache}"] = _first_use(what, f"{folder}/{what}")
            reproduced[cache] = _reproduce(f"{folder}/{cache}", f"{folder}/reproduce")
    return rows, reproduced


def _first_use(what: str, cache: str) -> dict[str, float]:
    return json.loads(_call([sys.executable, "-m", "benchmarks.first_use", what], cache).splitlines()[-1])


def _reproduce(out: str, cache: str) -> float:
    """Wall time of the command, imports and files included."""
    began = time.perf_counter()
    _call([sys.executable, "-c", REPRODUCE, "reproduce", "--out", out], cache)
    return time.perf_counter() - began


def _call(command: list[str], cache: str) -> str:
    environment = {**os.environ, "COADJOINT_CACHE": cache}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=120, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command[:4])} failed: {done.stderr.strip().splitlines()[-1:]}")
    return done.stdout
