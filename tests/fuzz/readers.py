"""What reads each kind of file, and a file of each kind to begin with."""

from __future__ import annotations

import json
import shutil
import signal
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
from mutations import mutated

import coadjoint as co
from coadjoint.errors import CoadjointError
from files import TOP_OF_CATALOGUE

LIMIT = 10.0
"""Seconds that a file may take."""

MISSION = b"""
[vehicle]
file = "own.toml"
[water]
velocity_m_s = [0.1, 0.0, 0.0]
[mission]
time_s = [0, 1]
heading_deg = [0, 10]
depth_m = [3.0, 3.0]
speed_m_s = [1.5, 1.5]
[initial]
position_m = [0, 0, 3]
speed_m_s = 1.5
[run]
dt = 0.1
duration_s = 2.0
"""
LOG = b"time_s,depth_m,roll_deg,pitch_deg,heading_deg,u_m_s,rudder_deg\n" + b"".join(
    b"%.1f,%.2f,0.0,%.1f,%.1f,1.5,%d\n" % (0.1 * i, 0.05 * i, i % 7, 3.0 * i, i % 5) for i in range(40)
)


class Slow(BaseException):
    """A file takes longer than LIMIT."""


@contextmanager
def limited() -> Iterator[None]:
    def stop(*_: Any) -> None:
        raise Slow

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, LIMIT)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def top() -> tuple[co.System, Any]:
    body = co.System(
        co.SO3(),
        lambda xi, a, p: 0.5 * xi @ p.inertia @ xi - p.weight * a[2],
        advected=co.Defining(),
        parameters=co.Parameters(inertia=np.diag([5.0, 5.0, 1.0]), weight=20.0),
    )
    return body, body.state(g=co.attitude.zyx(0, 0, 0.3), xi=[0, 0, 20], a0=[0, 0, 1])


class Corpus:
    """Files of all kinds in a folder, and one changed file after another."""

    def __init__(self, folder: Path):
        from coadjoint_vehicles.files.registry import vehicle_text

        self.folder = folder
        self.vehicle = vehicle_text("remus_100").encode()
        (folder / "own.toml").write_bytes(self.vehicle)
        self.system, start = top()
        run = co.simulate(self.system, start, dt=0.01, steps=40, progress=False)
        run.save(folder / "run.nc")
        co.simulate(self.system, start, dt=0.01, steps=40, save_every=2, store=folder / "store", progress=False)
        self.netcdf = (folder / "run.nc").read_bytes()
        self.kinds: dict[str, Callable[[str], None]] = {
            "run": self.run, "vehicle": self.of_vehicle, "mission": self.mission, "csv": self.csv,
            "netcdf": self.of_netcdf, "zarr": self.zarr,
        }  # fmt: skip

    def outcome(self, kind: str, number: int) -> str:
        """ "result", "sentence", or what must not be: "slow", or an error of another kind."""
        try:
            with limited(), warnings.catch_warnings(), redirect_stdout(StringIO()), redirect_stderr(StringIO()):
                warnings.simplefilter("ignore")
                self.kinds[kind](f"{kind} {number}")
        except CoadjointError as error:
            return _judged(str(error))
        except Slow:
            return "slow"
        except Exception as error:
            return f"raw {type(error).__name__}: {error}"
        return "result"

    def _file(self, name: str, content: bytes) -> Path:
        path = self.folder / name
        path.write_bytes(content)
        return path

    def run(self, seed: str) -> None:
        from coadjoint.runs.run_file import read

        file = read(self._file("changed.toml", mutated(TOP_OF_CATALOGUE.encode(), seed)))
        _ = file.inputs
        file.set_up()

    def of_vehicle(self, seed: str) -> None:
        from coadjoint_vehicles.files.file import read_vehicle

        read_vehicle(self._file("vehicle.toml", mutated(self.vehicle, seed)))

    def mission(self, seed: str) -> None:
        from coadjoint.runs.run_file import read

        file = read(self._file("mission.toml", mutated(MISSION, seed)))
        _ = file.inputs
        file.set_up()

    def csv(self, seed: str) -> None:
        from coadjoint_vehicles.logs import inputs_from_csv, read_log
        from coadjoint_vehicles.water import CurrentTable

        r = Random(seed)
        if r.random() < 0.4:
            read_log(self._file("log.csv", mutated(LOG, seed)))
        elif r.random() < 0.5:
            inputs_from_csv(self._file("log.csv", mutated(LOG, seed)))
        else:
            table = b"depth_m,north_m_s,east_m_s\n0,0.1,0\n10,0.2,0.1\n20,0.1,0.1\n"
            CurrentTable.from_csv(self._file("water.csv", mutated(table, seed)))

    def of_netcdf(self, seed: str) -> None:
        _shown(co.load(self._file("changed.nc", mutated(self.netcdf, seed, binary=True))))

    def zarr(self, seed: str) -> None:
        place = self.folder / "changed"
        shutil.rmtree(place, ignore_errors=True)
        shutil.copytree(self.folder / "store", place)
        r = Random(seed)
        file = r.choice(sorted(path for path in place.rglob("*") if path.is_file() and path.stat().st_size))
        file.write_bytes(mutated(file.read_bytes(), seed, binary=not file.name.endswith(".json") or r.random() < 0.5))
        _shown(co.load(place))
        _shown(co.resume(place, self.system, progress=False))


def _shown(run: Any) -> None:
    str(run)
    for name in run.dataset.variables:
        _ = run.dataset[name].values


def _judged(sentence: str) -> str:
    """One sentence, or a few, of one line and of no great length."""
    if "\n" in sentence.strip() or "Traceback" in sentence or len(sentence) > 2000:
        return f"no sentence: {sentence[:300]!r}"
    return "sentence"


if __name__ == "__main__":
    kind, first, last, place = sys.argv[1:]
    home = Path(place) / f"{kind}_{first}"
    home.mkdir()
    files = Corpus(home)
    for number in range(int(first), int(last)):
        print(json.dumps([number, files.outcome(kind, number)]), flush=True)
