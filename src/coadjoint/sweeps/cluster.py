"""The workers of a sweep, by dask.distributed: those of a scheduler, or processes on this machine."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from coadjoint.errors import ArgumentError, CoadjointError, FileError, told
from coadjoint.kernels.run.ensemble import cores
from coadjoint.log import logger

AHEAD = 3
"""Tasks that are given out for each thread of a worker: one at work and some that wait."""
LIVES = 10
"""How often a task is given out again after the workers that had it died."""
PATIENCE = 120.0
"""Seconds that a sweep waits for a scheduler that does not answer, or has no workers."""
ANSWER = 10.0
"""Seconds in which a scheduler must answer."""
LOOK = 0.02
"""Seconds between two looks at what has been computed."""

NOISY = ("distributed", "tornado", "asyncio")
"""What speaks of workers and schedulers that come and go."""

_log = logger(__name__)

Done = Callable[[int, Mapping[str, float]], None]
"""Called with the number of a task that is done, and with its times."""


class _Lost(Exception):
    """The scheduler is gone."""


def require() -> None:
    """Raise ArgumentError where dask.distributed is not installed."""
    if find_spec("distributed") is None:
        raise ArgumentError('A sweep needs dask.distributed: install it with pip install "coadjoint[cluster]".')


def run(
    made: Callable[[int], Any],
    missing: Callable[[], Sequence[int]],
    done: Done,
    scheduler: str | None,
    workers: int | None,
) -> dict[str, float]:
    """Compute all missing tasks; one whose worker dies is given out again, and a scheduler that is lost waited for.

    made: the task of a number. missing: the numbers of those that are not in the store. Returns the
    seconds until workers were there, and those of tasks from then on. Raises FileError where a scheduler does not
    answer, or has no workers, for PATIENCE seconds, and what a task raises.
    """
    require()
    waited_since: float | None = None
    spent = {"starting_seconds": 0.0, "computing_seconds": 0.0}
    while numbers := missing():
        before, began = len(numbers), time.perf_counter()
        try:
            with connected(scheduler, workers) as client:
                waited_since = None
                _ready(client)
                there = time.perf_counter()
                spent["starting_seconds"] += there - began
                try:
                    _run(client, made, numbers, done)
                finally:
                    spent["computing_seconds"] += time.perf_counter() - there
        except _Lost as lost:
            now = time.monotonic()
            waited_since = now if waited_since is None or len(missing()) < before else waited_since
            if now - waited_since >= PATIENCE:
                raise FileError(
                    f"{lost}: it was waited for {PATIENCE:.0f} s. The same command again goes on with what is missing."
                ) from None
            _log.info("%s: the sweep goes on when it is there again.", lost)
            time.sleep(1.0)
    return spent


@contextmanager
def connected(scheduler: str | None, workers: int | None) -> Iterator[Any]:
    """A client of a scheduler with workers; without an address, of one that is started for as long as this lasts."""
    from dask import config
    from distributed import Client

    quiet = {"distributed.logging.distributed": "critical", "distributed.comm.timeouts.connect": f"{ANSWER} s"}
    with config.set({**quiet, "distributed.scheduler.allowed-failures": LIVES}):
        if scheduler is not None:
            with suppress_noise(), _opened(Client, scheduler) as client:
                yield client
            return
        with suppress_noise(), _local(workers or cores()) as cluster, _opened(Client, cluster) as client:
            yield client


@contextmanager
def _opened(cls: Any, where: Any) -> Iterator[Any]:
    client = cls.__new__(cls)  # to be closed even where it could not connect
    try:
        try:
            client.__init__(where, timeout=ANSWER, set_as_default=False)
        except (OSError, TimeoutError):
            told_of = where if isinstance(where, str) else "of this machine"
            raise _Lost(f"The scheduler {told_of} does not answer") from None
        yield client
    finally:
        _close(client)


def _close(client: Any) -> None:
    """Close a client; one that never reached a scheduler has nothing to tell it, and would wait for it."""
    with suppress(Exception):
        if getattr(client, "status", "") == "connecting":
            client.status = "closed"
            client._loop_runner.stop()
        else:
            client.close(timeout=1)


@contextmanager
def _local(workers: int) -> Iterator[Any]:
    """A scheduler and workers on this machine, each a process that is spawned and has one thread."""
    from distributed.deploy.subprocess import SubprocessCluster

    own = {"memory_limit": 0, "death_timeout": 60}
    scheduler = {"allowed_failures": LIVES}
    start: Any = SubprocessCluster
    size = {"n_workers": workers, "threads_per_worker": 1, "dashboard_address": None}
    with _deaf():
        cluster = start(**size, worker_kwargs=own, scheduler_kwargs=scheduler)
    try:
        yield cluster
    finally:
        _end([*cluster.workers.values()])
        with suppress(Exception):
            cluster.close(timeout=2)
        cluster.shutdown_on_close = False  # at the end of Python, which would wait for what is gone
        _end([cluster.scheduler])


def _end(started: Sequence[Any]) -> None:
    """End processes and their children at once: what tasks were at is not waited for."""
    import psutil

    for one in started:
        with suppress(psutil.Error, AttributeError):
            process = psutil.Process(one.process.pid)
            for running in (*process.children(recursive=True), process):
                with suppress(psutil.Error):
                    running.kill()


@contextmanager
def suppress_noise() -> Iterator[None]:
    """Without the log messages of dask and what it stands on about workers and schedulers that come and go."""
    import logging

    import distributed.deploy.subprocess  # noqa: F401, which names its loggers

    named = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] in NOISY]
    before = {name: logging.getLogger(name).disabled for name in named}
    for name in named:
        logging.getLogger(name).disabled = True
    try:
        yield
    finally:
        for name, disabled in before.items():
            logging.getLogger(name).disabled = disabled


@contextmanager
def _deaf() -> Iterator[None]:
    """Processes that are started meanwhile hear no Ctrl-C, which is for this one to end them."""
    import signal
    import threading

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _run(client: Any, made: Callable[[int], Any], numbers: Sequence[int], done: Done) -> None:
    from distributed import as_completed

    waiting, lives = list(reversed(numbers)), Counter[int]()
    futures: dict[Any, int] = {}

    def give() -> Any:
        number = waiting.pop()
        future = client.submit(_call, made(number), pure=False, retries=0)
        futures[future] = number
        return future

    threads = _threads(client)
    room = min(max(AHEAD * threads, 2), len(waiting))
    coming = as_completed([give() for _ in range(room)], loop=client.loop)
    try:
        for future in _following(coming, client):
            number = futures.pop(future)
            try:
                done(number, future.result())
            except CoadjointError:
                raise
            except BaseException as error:
                _lost_or_raise(client, error, number, lives)
                waiting.append(number)
            future.release()
            if waiting:
                coming.add(give())
    finally:
        with suppress(Exception):
            client.cancel(list(futures), force=True)


def _following(coming: Any, client: Any) -> Iterator[Any]:
    """What has been computed; _Lost where the scheduler is gone."""
    while coming.count():
        if coming.has_ready():
            yield next(coming)
            continue
        if client.status != "running":
            raise _Lost(f"The scheduler {_address(client)} is gone")
        time.sleep(LOOK)


def _address(client: Any) -> str:
    return str(getattr(getattr(client, "scheduler", None), "address", "")) or "of the sweep"


def _threads(client: Any) -> int:
    """How many threads all workers have together; raises _Lost where there are none after a while."""
    try:
        client.wait_for_workers(1, timeout=60)
        return sum(client.nthreads().values())
    except (TimeoutError, OSError):
        raise _Lost(f"The scheduler {_address(client)} has no workers") from None


def _ready(client: Any) -> None:
    """Wait for workers, and let them load what tasks need; raises FileError where they cannot."""
    _threads(client)
    try:
        client.run(_load)
    except ImportError as error:
        raise FileError(f"A worker cannot load the library: {told(error)}; install coadjoint[cluster] there.") from None
    except OSError:
        raise _Lost(f"The scheduler {_address(client)} is gone") from None


def _load() -> None:
    import coadjoint.sweeps.task  # noqa: F401


def _lost_or_raise(client: Any, error: BaseException, number: int, lives: Counter[int]) -> None:
    """Go on where a task was lost with its worker; raise what else happened."""
    from distributed import CancelledError, KilledWorker
    from distributed.comm.core import CommClosedError

    if isinstance(error, (KeyboardInterrupt, SystemExit)):
        raise error
    if isinstance(error, (CancelledError, CommClosedError)) or "Cancelled" in type(error).__name__:
        if client.status != "running":
            raise _Lost(f"The scheduler {_address(client)} is gone") from None
        lives[number] += 1
    elif isinstance(error, KilledWorker):
        lives[number] += 1
    else:
        raise FileError(f"Task {number} of the sweep failed on a worker: {told(error)}.") from error
    if lives[number] > LIVES:
        raise FileError(
            f"Task {number} of the sweep was lost with its worker again and again, as where a worker has too little "
            "memory: give fewer members a task with [sweep] task."
        )


def _call(task: Any) -> Any:
    """On a worker: compute a task and write its shard."""
    from distributed import get_worker

    from coadjoint.sweeps.store import write
    from coadjoint.sweeps.task import compute, swept

    shard = compute(task, get_worker().state.nthreads)
    began = time.perf_counter()
    keep = swept(task.folder, task.configuration).results.keep
    shard.members = {**task.rows, **shard.members}
    write(Path(task.folder), task.number, task.first, shard, keep != "statistics")
    spent = time.perf_counter() - began
    return {"seconds": shard.seconds + spent, "kernel": shard.kernel, "writing": spent, "process": float(os.getpid())}
