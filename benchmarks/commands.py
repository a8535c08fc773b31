"""Processor time of fresh processes: cold, and repeated with what the first has left in the cache.

Run as: python -m benchmarks.commands [PYTHON …]; each Python, by default this one, takes its turn from the folder above
the environment that it lies in, so that two checkouts can be compared. It prints the table of docs/benchmarks.md.
"""

from __future__ import annotations

import os
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
TOP = """
import coadjoint as co
from coadjoint.models import catalogue
top = catalogue["heavy_top"].make()
co.simulate(top, catalogue["heavy_top"].start(top), dt=1e-3, steps=1000)
"""
REMUS = """
import coadjoint as co
import coadjoint_vehicles as vehicles
remus = vehicles.load("remus_100")
craft = vehicles.Craft(remus, controller=remus.controller)
wanted = {"depth": 10.0, "heading": 0.0, "speed": 1.5}
co.simulate(craft.system, craft.start(position=(0, 0, 2), speed=1.5), dt=0.05, steps=1000, inputs=wanted)
"""
ROD = """
import coadjoint as co
from coadjoint.models import rods
rod = rods.cosserat(
    elements=49, length=1.0, EI=1.0, GJ=0.8, EA=100.0, GA=100.0, mass=1.0, inertia=(0.02, 0.01, 0.01)
)
start = rods.start(rod, curvature=(0.0, 0.3, 0.2), angular_velocity=(0.2, 0.3, 0.1))
co.simulate(rod, start, dt=0.1 / 49, steps=20)
"""
FLUID = """
import numpy as np
import coadjoint as co
from coadjoint.models import fluids
random, c = np.random.default_rng(0), np.zeros((11, 11), complex)
for l in range(1, 11):
    c[l, : l + 1] = 0.1 * random.normal(size=l + 1)
fluid = fluids.euler(64)
co.simulate(fluid, fluids.start(fluid, c), dt=0.01, steps=20, method=co.IsospectralMidpoint())
"""
CASES = {
    "heavy top": ["-c", TOP],
    "REMUS 100 with its cruise controller": ["-c", REMUS],
    "`coadjoint run examples/square.toml`": ["-m", "coadjoint", "run", "examples/square.toml", "--out", "{out}"],
    "`coadjoint reproduce`": ["-m", "coadjoint", "reproduce", "--out", "{out}"],
    "rod of 50 sections": ["-c", ROD],
    "fluid of su(64)": ["-c", FLUID],
}


def measure(quick: bool, pythons: tuple[str, ...] = (sys.executable,)) -> dict[str, Any]:
    """Medians of seconds, cold and repeated, of every case by every Python."""
    found: dict[str, Any] = {}
    for name, arguments in CASES.items():
        times = [{python: _pair(python, arguments) for python in pythons} for _ in range(1 if quick else 3)]
        found[name] = {
            python: [statistics.median(pair[python][k] for pair in times) for k in (0, 1)] for python in pythons
        }
    return found


def _pair(python: str, arguments: list[str]) -> tuple[float, float]:
    """Seconds with an empty cache, and with that which this has filled."""
    with tempfile.TemporaryDirectory() as folder:
        return _spent(python, arguments, folder, "first"), _spent(python, arguments, folder, "second")


def _spent(python: str, arguments: list[str], folder: str, out: str) -> float:
    """Seconds of processor time of a process, with its children."""
    place = next((part for part in Path(python).absolute().parents if (part / "examples").is_dir()), ROOT)
    given = [python, *(part.replace("{out}", f"{folder}/{out}") for part in arguments)]
    environment = {**os.environ, "COADJOINT_CACHE": f"{folder}/cache", "OMP_NUM_THREADS": "1", "PYTHONPATH": ""}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(given, cwd=place, env=environment, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise RuntimeError(f"{python} failed: {done.stderr.strip().splitlines()[-1:]}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Print the table."""
    from benchmarks.tables import tables

    pythons = tuple(sys.argv[1:]) or (sys.executable,)
    for table in tables("commands", measure(False, pythons)):
        table.print()


if __name__ == "__main__":
    main()
