"""Workers on this machine: no network, no orphans, errors in a sentence."""

from __future__ import annotations

import functools
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

import coadjoint as co
from coadjoint.sweeps import local

linux = pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="reads /proc")

KILLED = """
import os, signal, sys, time
from functools import partial
from coadjoint.sweeps import local
from test_local_workers import busy
local.load = print
local.run(lambda number: partial(busy, sys.argv[1], number), [0, 1], print, 2)
"""


@pytest.fixture(autouse=True)
def without_jax(monkeypatch):
    """Workers start without what tasks of sweeps load."""
    monkeypatch.setattr(local, "load", print)


def busy(folder: str, number: int) -> None:
    """Say which process this is, and work for a minute."""
    Path(folder, f"{number}.part").write_text(str(os.getpid()))
    Path(folder, f"{number}.part").rename(Path(folder, f"{number}.pid"))
    time.sleep(60)


def sockets() -> list[str]:
    """The sockets that this process has open."""
    links = [os.readlink(path) for path in Path("/proc/self/fd").iterdir() if path.is_symlink()]
    return [link for link in links if link.startswith("socket:")]


def running(process: int) -> bool:
    """Whether a process is there, and no zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def until(held, seconds: float) -> bool:
    """Whether something holds within some seconds."""
    end = time.monotonic() + seconds
    while not (found := held()) and time.monotonic() < end:
        time.sleep(0.01)
    return found


@linux
def test_workers_in_the_middle_of_a_task_end_when_their_parent_is_killed(tmp_path):
    home = {**os.environ, "PYTHONPATH": str(Path(__file__).parent)}
    parent = subprocess.Popen([sys.executable, "-c", KILLED, str(tmp_path)], env=home)
    try:
        files = [tmp_path / "0.pid", tmp_path / "1.pid"]
        assert until(lambda: all(file.exists() for file in files), 120)
        workers = [int(file.read_text()) for file in files]
        assert all(map(running, workers)) and parent.pid not in workers
    finally:
        os.kill(parent.pid, signal.SIGKILL)
        parent.wait()
    assert until(lambda: not any(map(running, workers)), 10)


@linux
def test_workers_open_no_socket():
    before, found = sockets(), {}
    local.run(lambda _: sockets, [0, 1, 2], found.__setitem__, 2)
    assert found == {0: [], 1: [], 2: []} and sockets() == before


def dies_once(folder: str, number: int) -> int:
    """End the process, as the killer of processes that take too much memory does, but not the second time."""
    if number == 1 and not (mark := Path(folder, "died")).exists():
        mark.touch()
        os._exit(9)
    return number


def test_a_task_whose_worker_dies_is_given_out_again(tmp_path):
    found = {}
    local.run(lambda n: functools.partial(dies_once, str(tmp_path), n), [0, 1, 2], found.__setitem__, 2)
    assert found == {0: 0, 1: 1, 2: 2} and (tmp_path / "died").exists()


def dies_later(number: int) -> int:
    """A worker that ends while it waits for more, and another one that is at work until long after that."""
    if number == 0:
        threading.Timer(0.1, os._exit, [9]).start()
    else:
        time.sleep(1.5)
    return number


@pytest.mark.long
def test_a_worker_that_dies_without_a_task_costs_no_other_task():
    found = []
    local.run(lambda n: functools.partial(dies_later, n), [0, 1], lambda n, _: found.append(n), 2)
    assert found == [0, 1]


def raises(number: int) -> None:
    raise (co.errors.ArgumentError("Argument `mass` must be positive.") if number else KeyError("two\nlines"))


@pytest.mark.parametrize(("numbers", "kind", "sentence"), [
    ([1, 1], co.errors.ArgumentError, "^Argument `mass` must be positive.$"),
    ([0, 0], co.errors.FileError, r"^A task of the sweep failed: KeyError: 'two\\nlines'\.$"),
])  # fmt: skip
def test_an_error_of_a_task_is_raised_here(numbers, kind, sentence):
    with pytest.raises(kind, match=sentence):
        local.run(lambda n: functools.partial(raises, n), numbers, print, 2)


def test_a_task_that_ends_every_worker_is_reported(monkeypatch):
    monkeypatch.setattr(local, "LIVES", 0)
    with pytest.raises(co.errors.FileError, match=r"lost with its worker 1 times.*fewer members a task"):
        local.run(lambda _: functools.partial(os._exit, 9), [0, 1], print, 2)


def test_one_worker_is_this_process():
    found = {}
    local.run(lambda _: os.getpid, [4, 5], found.__setitem__, 1)
    assert found == {4: os.getpid(), 5: os.getpid()}


def test_what_tasks_print_is_no_answer(capfd):
    found = {}
    local.run(lambda _: functools.partial(print, "no answer"), [0, 1], found.__setitem__, 2)
    assert found == {0: None, 1: None} and "no answer" in capfd.readouterr().err


def test_tasks_in_this_process_are_done_in_order_and_timed():
    done, began = [], time.perf_counter()
    times = local.run(lambda number: lambda: {"seconds": number}, [3, 1], lambda *one: done.append(one), 1)
    assert done == [(3, {"seconds": 3}), (1, {"seconds": 1})]
    assert times["starting_seconds"] == 0.0 <= times["computing_seconds"] <= time.perf_counter() - began
