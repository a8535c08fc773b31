"""Workers that are processes of this machine, killed at random, and a scheduler that is lost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from killing import Killer, bits, sweep_file

from coadjoint.sweeps.file import read_sweep
from coadjoint.sweeps.store import done
from coadjoint.sweeps.sweep import execute

pytest.importorskip("psutil", reason="kills processes by psutil, which the extra [cluster] brings")

MEMBERS, TASK, TASKS = 96, 4, 24


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """A sweep in this process, which nobody kills."""
    folder = tmp_path_factory.mktemp("undisturbed")
    return execute(read_sweep(sweep_file(folder, MEMBERS, TASK)), folder / "out", workers=1, progress=False)


@pytest.mark.long
@pytest.mark.parametrize("kills", [3, pytest.param(100, marks=pytest.mark.long)])
def test_a_sweep_whose_workers_are_killed_is_the_same_to_the_bit(undisturbed, tmp_path, kills):
    sweep = read_sweep(sweep_file(tmp_path, MEMBERS, TASK))
    left, rounds = kills, 0
    while left > 0:
        folder = tmp_path / f"out{rounds}"
        with Killer(min(left, 4), 2.0, seed=rounds) as killer:
            found = execute(sweep, folder, workers=2, progress=False)
        assert bits(found.folder) == bits(undisturbed.folder)
        left, rounds = left - killer.killed, rounds + 1
        assert rounds <= kills, "Few workers were killed: the sweeps ended too early."


@pytest.mark.long
def test_a_command_that_is_killed_goes_on_with_what_is_missing(undisturbed, tmp_path):
    file = sweep_file(tmp_path, MEMBERS, TASK)
    command = [sys.executable, "-m", "coadjoint", "sweep", str(file), "--out", str(tmp_path / "out"), "--workers", "1"]
    first = subprocess.Popen(command, start_new_session=True)
    until(lambda: len(done(tmp_path / "out")) >= 2)
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    before = len(done(tmp_path / "out"))
    assert 2 <= before < TASKS
    found = execute(read_sweep(file), tmp_path / "out", workers=1, progress=False)
    assert 0 < found.summary["computed_tasks"] <= TASKS - before
    assert bits(found.folder) == bits(undisturbed.folder)


def until(held, seconds: float = 120.0) -> None:
    """Wait until something holds."""
    end = time.monotonic() + seconds
    while not held():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.long
def test_a_scheduler_that_is_lost_and_started_again_is_waited_for(undisturbed, tmp_path):
    pytest.importorskip("distributed", reason="schedulers need dask.distributed, the extra [cluster]")
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    folder, failed = tmp_path / "out", list[BaseException]()

    def run() -> None:
        try:
            execute(read_sweep(sweep_file(tmp_path, MEMBERS, TASK)), folder, address, progress=False)
        except BaseException as error:
            failed.append(error)

    sweep = threading.Thread(target=run)
    with Cluster(port):
        sweep.start()
        until(lambda: len(done(folder)) >= 2)
    with Cluster(port):
        sweep.join(240)
    assert not sweep.is_alive() and not failed
    assert bits(folder) == bits(undisturbed.folder)


def free_port() -> int:
    """A port that nobody listens at."""
    import socket

    with socket.socket() as own:
        own.bind(("127.0.0.1", 0))
        return own.getsockname()[1]


class Cluster:
    """`dask scheduler` and `dask worker`, killed at the end."""

    def __init__(self, port: int):
        dask = [sys.executable, "-m", "dask"]
        quiet = ["--no-dashboard"]
        address = f"tcp://127.0.0.1:{port}"
        self.commands = [
            [*dask, "scheduler", "--host", "127.0.0.1", "--port", str(port), *quiet],
            [*dask, "worker", address, "--nthreads", "1", "--memory-limit", "0", "--no-nanny", *quiet],
        ]

    def __enter__(self) -> Cluster:
        kept = subprocess.DEVNULL
        self.processes = [subprocess.Popen(command, stdout=kept, stderr=kept) for command in self.commands]
        return self

    def __exit__(self, *_: object) -> None:
        for process in self.processes:
            process.kill()
            process.wait()
