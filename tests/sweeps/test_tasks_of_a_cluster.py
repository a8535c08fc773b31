"""What a sweep does with the futures of a scheduler: tasks that are done, lost with their workers, or failed."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterable
from typing import Any

import pytest

from coadjoint.errors import FileError, GroupError
from coadjoint.sweeps import cluster

distributed = pytest.importorskip("distributed", reason="schedulers need dask.distributed, the extra [cluster]")


class Future:
    def __init__(self, task: Any):
        self.task, self.released = task, False

    def result(self) -> Any:
        return self.task()

    def release(self) -> None:
        self.released = True


class Client:
    """A client whose workers compute tasks in the order in which they are given."""

    loop = None

    def __init__(self, threads: int = 1, status: str = "running"):
        self.threads, self.status = threads, status
        self.waiting: list[Future] = []
        self.given: list[Any] = []
        self.most = 0
        self.cancelled: list[Future] | None = None

    def wait_for_workers(self, count: int, timeout: float) -> None:
        if not self.threads:
            raise TimeoutError

    def nthreads(self) -> dict[str, int]:
        return {"one": self.threads}

    def submit(self, call: Any, task: Any, **_: Any) -> Future:
        assert call is cluster._call
        self.given.append(task.number)
        return Future(task)

    def run(self, function: Any) -> None:
        raise ImportError("No module named coadjoint") if self.status == "bare" else OSError("gone")

    def cancel(self, futures: Iterable[Future], force: bool) -> None:
        self.cancelled = list(futures)


class Task:
    """Fails by each of the errors in turn, then is done."""

    def __init__(self, number: int, errors: list[BaseException]):
        self.number, self.errors = number, errors

    def __call__(self) -> dict[str, float]:
        if self.errors:
            raise self.errors.pop(0)
        return {"seconds": float(self.number)}


def completed(client: Client) -> Any:
    class Coming:
        """`distributed.as_completed`."""

        def __init__(self, futures: list[Future], loop: Any):
            client.waiting = futures
            client.most = len(futures)

        def count(self) -> int:
            return len(client.waiting)

        def has_ready(self) -> bool:
            return client.status == "running"

        def __next__(self) -> Future:
            return client.waiting.pop(0)

        def add(self, future: Future) -> None:
            client.waiting.append(future)

    return Coming


def computed(monkeypatch, client: Client, count: int = 9, **errors: list[BaseException]) -> list[int]:
    tasks = {k: Task(k, errors.get(f"of_{k}", [])) for k in range(count)}
    done: dict[int, Any] = {}
    monkeypatch.setattr(distributed, "as_completed", completed(client))
    cluster._run(client, tasks.__getitem__, range(count), done.__setitem__)
    assert done == {k: {"seconds": float(k)} for k in range(count)}
    assert client.cancelled == []
    return client.given


@pytest.mark.parametrize(("threads", "most"), [(1, 3), (2, 6), (4, 9)])
def test_each_thread_has_a_task_and_two_that_wait(monkeypatch, threads, most):
    client = Client(threads)
    assert computed(monkeypatch, client) == list(range(9)) and client.most == most


def test_a_task_that_was_lost_with_its_worker_is_given_out_again(monkeypatch):
    lost = [distributed.CancelledError("x"), distributed.KilledWorker("x", None, 1)]
    assert computed(monkeypatch, Client(), of_4=lost) == [0, 1, 2, 3, 4, 5, 6, 4, 7, 8, 4]


def test_a_task_that_is_lost_again_and_again_ends_the_sweep(monkeypatch):
    lost: list[BaseException] = [distributed.comm.core.CommClosedError() for _ in range(cluster.LIVES + 1)]
    with pytest.raises(FileError, match="Task 1 of the sweep was lost with its worker again and again"):
        computed(monkeypatch, Client(), of_1=lost)
    assert computed(monkeypatch, Client(), of_1=lost[1:])


@pytest.mark.parametrize(
    ("error", "kind", "says"),
    [
        (GroupError("It is no group."), GroupError, "^It is no group.$"),
        (ValueError("odd\nmore"), FileError, "Task 0 of the sweep failed on a worker: ValueError: odd"),
        (KeyboardInterrupt("stop"), KeyboardInterrupt, "stop"),
    ],
)
def test_other_errors_are_those_of_the_sweep_and_cancel_what_waits(monkeypatch, error, kind, says):
    client = Client()
    with pytest.raises(kind, match=says):
        computed(monkeypatch, client, of_0=[error])
    assert client.cancelled is not None and len(client.cancelled) == 2


def test_a_scheduler_or_workers_that_are_gone_are_waited_for(monkeypatch):
    for client in (Client(status="closed"), Client(threads=0)):
        with pytest.raises(cluster._Lost, match=r"The scheduler of the sweep (is gone|has no workers)"):
            computed(monkeypatch, client)
    with pytest.raises(cluster._Lost, match="is gone"):
        cluster._lost_or_raise(Client(status="closed"), distributed.CancelledError("x"), 0, Counter())
    with pytest.raises(cluster._Lost, match="is gone"):
        cluster._ready(Client())
    with pytest.raises(FileError, match=r"A worker cannot load the library: .*; install coadjoint\[cluster\] there"):
        cluster._ready(Client(status="bare"))


def test_the_loggers_of_dask_are_silent_meanwhile_and_no_others():
    names = {"distributed": True, "distributed.worker": True, "tornado.application": True, "coadjoint.sweeps": False}
    logging.getLogger("distributed.worker").disabled = False
    for name in names:
        logging.getLogger(name)
    before = {name: logging.getLogger(name).disabled for name in names}
    with cluster.suppress_noise():
        assert {name: logging.getLogger(name).disabled for name in names} == names
    assert {name: logging.getLogger(name).disabled for name in names} == before
