"""How long a sweep waits for a scheduler that is lost, and into how many cells members fall."""

from __future__ import annotations

from contextlib import contextmanager, nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from coadjoint.errors import FileError
from coadjoint.sweeps import address, cluster
from coadjoint.sweeps.figures import CELLS, _edges, _ends, _varies


def waited(monkeypatch, missing, times) -> list[float]:
    """The pauses of a sweep whose scheduler never answers, at these times of a clock."""
    clock, pauses = iter(times), []

    @contextmanager
    def lost(scheduler):
        raise cluster._Lost("It is gone")
        yield

    monkeypatch.setattr(cluster, "require", lambda: None)
    monkeypatch.setattr(cluster, "connected", lost)
    false = SimpleNamespace(monotonic=lambda: next(clock), perf_counter=lambda: 0.0, sleep=pauses.append)
    monkeypatch.setattr(cluster, "time", false)
    with pytest.raises(FileError, match="It is gone: it was waited for 120 s"):
        cluster.run(lambda number: None, missing, lambda *_: None, "tcp://there")
    return pauses


def test_a_scheduler_that_is_lost_is_waited_for_so_long_and_no_longer(monkeypatch):
    assert waited(monkeypatch, lambda: [1, 2], [1000.0, 1060.0, 1119.9, 1120.0]) == [1.0] * 3


def test_the_wait_begins_again_where_tasks_were_done_meanwhile(monkeypatch):
    left = iter([[1, 2], [1, 2], [1, 2], [1, 2], [1], [1], [1], [1], [1]])
    assert len(waited(monkeypatch, lambda: next(left), [1000.0, 1100.0, 1150.0, 1220.0, 1270.0])) == 4


def test_few_values_have_a_cell_each_and_many_as_many_as_their_number_fills():
    assert _edges(np.array([0.0, 1.0, 1.0, 3.0])).tolist() == [0.0, 0.5, 2.0, 3.0]
    many = np.linspace(0.0, 1.0, 40 * CELLS)
    assert len(_edges(many)) == int(np.sqrt(10 * CELLS)) + 1
    assert len(_edges(np.linspace(0.0, 1.0, 5 * CELLS**2))) == CELLS + 1
    assert _edges(np.full(9, 2.0)).tolist() == [2.0, 2.0, 2.0] and _ends(many) == (0.0, 1.0)
    assert _varies(np.array([1.0, 2.0])) and not _varies(np.array([1.0, 1.0]))


def test_a_scheduler_listens_at_its_host_and_port(monkeypatch):
    asked = []

    def connect(place, timeout):
        asked.append(place)
        if place[1] != 8786:
            raise OSError
        return nullcontext()

    monkeypatch.setattr(address.socket, "create_connection", connect)
    found = [address._listens(address._split(one)) for one in ("tcp://node:8786", "node:8787", "inproc://a", "node")]
    assert found == [True, False, True, False] and asked == [("node", 8786), ("node", 8787), ("node", 0)]
