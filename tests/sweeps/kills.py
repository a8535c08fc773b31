"""Main processes and workers of sweeps are killed at random: `python tests/sweeps/kills.py 100` prints what came of it.

Each sweep goes on after every kill until it is finished; then its files are compared with those of one that nothing
disturbed. After each kill of a main process no worker may be there any more within ORPHAN seconds.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import tempfile
import time
import uuid
from pathlib import Path

from killing import bits, sweep_file

from coadjoint.sweeps.file import read_sweep
from coadjoint.sweeps.sweep import execute

ORPHAN = 10.0
LONGEST = 12.0
"""Seconds until a kill at most."""
MARK = f"/nowhere/{uuid.uuid4().hex}"
"""A folder of Python's path, by which workers are found: it stands in their command lines."""


def begun(file: Path, folder: Path, workers: int) -> int:
    """The number of a process that runs a sweep."""
    child = os.fork()
    if child == 0:
        try:
            execute(read_sweep(file), folder, workers=workers, progress=False)
            os._exit(0)
        except BaseException as error:
            print(repr(error), flush=True)
        finally:
            os._exit(1)
    return child


def workers() -> list[int]:
    """The workers of all sweeps of this program, orphans among them."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            command = (path / "cmdline").read_bytes()
            state = (path / "stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            continue
        if MARK.encode() in command and state not in "ZX":
            found.append(int(path.name))
    return found


def ended(process: int) -> int | None:
    """The status of a process that has ended."""
    done, status = os.waitpid(process, os.WNOHANG)
    return os.waitstatus_to_exitcode(status) if done else None


def campaign(kills: int, seed: int) -> dict[str, int]:
    """So many kills, main processes and workers by turns."""
    found = dict.fromkeys(("main", "worker", "sweeps", "orphans", "different", "failed"), 0)
    chance = random.Random(seed)
    sys.path.append(MARK)
    with tempfile.TemporaryDirectory() as place:
        file = sweep_file(Path(place), 48, 4)
        os.waitpid(begun(file, Path(place) / "undisturbed", 1), 0)
        right = bits(Path(place) / "undisturbed")
        folder, process = Path(place) / "0", None
        while found["main"] + found["worker"] < kills or process is not None:
            process = begun(file, folder, 2) if process is None else process
            due = time.monotonic() + chance.uniform(0.0, LONGEST)
            left = kills - found["main"] - found["worker"]
            while (status := ended(process)) is None and (not left or time.monotonic() < due):
                time.sleep(0.05)
            if status is not None:
                found["failed"] += status != 0
                found["sweeps"] += 1
                found["different"] += bits(folder) != right
                folder, process = Path(place) / str(found["sweeps"]), None
            elif left % 2 and (there := workers()):
                os.kill(chance.choice(there), signal.SIGKILL)
                found["worker"] += 1
            else:
                os.kill(process, signal.SIGKILL)
                os.waitpid(process, 0)
                process, found["main"] = None, found["main"] + 1
                end = time.monotonic() + ORPHAN
                while workers() and time.monotonic() < end:
                    time.sleep(0.05)
                found["orphans"] += len(workers())
    return found


if __name__ == "__main__":
    counts = campaign(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0)
    print(counts)
    sys.exit(counts["orphans"] + counts["different"] + counts["failed"] > 0)
