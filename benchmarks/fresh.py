"""A measurement in a process of its own, which finds no machine code on the disk."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]


def fresh(module: str, family: str, size: int, limit: float) -> dict[str, Any] | None:
    """What `python -m benchmarks.MODULE --one FAMILY SIZE` prints as JSON; None where it takes over `limit`, s.

    Raises RuntimeError with the last line of its errors where it fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "COADJOINT_CACHE": folder, "OMP_NUM_THREADS": "1"}
        command = [sys.executable, "-W", "ignore", "-m", f"benchmarks.{module}", "--one", family, str(size)]
        try:
            done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=limit)
        except subprocess.TimeoutExpired:
            return None
    if done.returncode:
        raise RuntimeError(f"{family} {size}: {done.stderr.strip().splitlines()[-1:]}")
    return json.loads(done.stdout.splitlines()[-1])
