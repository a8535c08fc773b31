"""Sweeps whose workers are killed at random."""

from __future__ import annotations

import contextlib
import json
import random
import threading
from pathlib import Path
from typing import Any

import xarray

TOP = """
[system]
model = "simo_wong_top"
[initial]
euler_zyx_deg = [0, 10, 0]
angular_velocity_rpm = [0, 0, 400]
[run]
dt = 0.001
steps = 20000
"""


def sweep_file(folder: Path, members: int, task: int) -> Path:
    """A sweep whose tasks take about as long as a worker needs to die in the middle of one."""
    (folder / "top.toml").write_text(TOP)
    file = folder / "sweep.toml"
    file.write_text(f"""
[sweep]
run = "top.toml"
sampling = "random"
members = {members}
task = {task}
[vary.parameters]
mass = {{ from = 4.0, to = 6.0 }}
[results]
variables = ["xi", "euler_angles"]
keep = "trajectories"
courses = true
save_every = 2000
""")
    return file


def bits(folder: Path) -> dict[str, bytes]:
    """All files but those with times, by their names; of a netCDF file what it says: HDF5 may keep the time in it."""
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    times = ("summary.json", "manifest.json")
    return {str(path.relative_to(folder)): _content(path) for path in files if path.name not in times}


def _content(path: Path) -> bytes:
    if path.suffix != ".nc":
        return path.read_bytes()
    with xarray.open_dataset(path, engine="h5netcdf") as dataset:
        return json.dumps(dataset.to_dict(), default=repr).encode()


def workers() -> list[Any]:
    """The processes of workers that this one has started."""
    import psutil

    found = []
    for child in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.Error):
            if "sweeps.local" in " ".join(child.cmdline()):
                found.append(child)
    return found


class Killer(threading.Thread):
    """Kills a worker at random, `times` times, a random while of up to `longest` seconds apart."""

    def __init__(self, times: int, longest: float, seed: int):
        super().__init__(daemon=True)
        self.times, self.longest, self.random, self.killed = times, longest, random.Random(seed), 0
        self.ended = threading.Event()

    def run(self) -> None:
        while self.killed < self.times and not self.ended.wait(self.random.uniform(0.0, self.longest)):
            there = workers()
            if there:
                with contextlib.suppress(Exception):
                    self.random.choice(there).kill()
                    self.killed += 1

    def __enter__(self) -> Killer:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.ended.set()
        self.join()
