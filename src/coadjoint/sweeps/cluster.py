"""The workers of a scheduler of dask.distributed, on other machines or on this one."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any

from coadjoint.checks import library
from coadjoint.errors import CoadjointError, FileError, error_line
from coadjoint.log import logger
from coadjoint.sweeps.local import LIVES, Done, load

AHEAD = 3
"""Tasks that are given out for each thread of a worker: one at work and some that wait."""
PATIENCE = 120.0
"""Seconds that a sweep waits for a scheduler that does not answer, or has no workers."""
ANSWER = 10.0
"""Seconds in which a scheduler must answer."""
LOOK = 0.02
"""Seconds between two looks at the finished tasks."""

NOISY = ("distributed", "tornado", "asyncio")
"""The loggers that report workers and schedulers coming and going."""

_log = logger(__name__)


class _Lost(Exception):
    """The scheduler is gone."""


def require() -> None:
    """Raise ArgumentError if dask.distributed is not installed."""
    library("distributed", "A sweep with a scheduler needs", "coadjoint[cluster]", "dask.distributed")


def run(
    made: Callable[[int], Any],
    missing: Callable[[], Sequence[int]],
    done: Done,
    scheduler: str,
) -> dict[str, float]:
    """Compute all missing tasks; one whose worker dies is given out again, and a scheduler that is lost waited for.

    made: the task of a number. missing: the numbers of those that are not in the store. Returns the seconds until
    workers were ready, and those of tasks from then on. Raises FileError if a scheduler does not answer, or has no
    workers, for PATIENCE seconds, and the errors of tasks.
    """
    require()
    waited_since: float | None = None
    spent = {"starting_seconds": 0.0, "computing_seconds": 0.0}
    while numbers := missing():
        before, began = len(numbers), time.perf_counter()
        try:
            with connected(scheduler) as client:
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
                    f"{lost}: it was waited for {PATIENCE:.0f} s. The same command again continues with the missing "
                    "tasks."
                ) from None
            _log.info("%s: the sweep continues when it is back.", lost)
            time.sleep(1.0)
    return spent


@contextmanager
def connected(scheduler: str) -> Iterator[Any]:
    """Inside this context, a client of a scheduler."""
    from dask import config
    from distributed import Client

    quiet = {"distributed.logging.distributed": "critical", "distributed.comm.timeouts.connect": f"{ANSWER} s"}
    with config.set(quiet), suppress_noise(), _opened(Client, scheduler) as client:
        yield client


@contextmanager
def _opened(cls: Any, where: str) -> Iterator[Any]:
    client = cls.__new__(cls)  # to be closed even where it could not connect
    try:
        try:
            client.__init__(where, timeout=ANSWER, set_as_default=False)
        except (OSError, TimeoutError):
            raise _Lost(f"The scheduler {where} does not answer") from None
        yield client
    finally:
        _close(client)


def _close(client: Any) -> None:
    """Close a client; one that never reached a scheduler would wait for it."""
    with suppress(Exception):
        if getattr(client, "status", "") == "connecting":
            client.status = "closed"
            client._loop_runner.stop()
        else:
            client.close(timeout=1)


@contextmanager
def suppress_noise() -> Iterator[None]:
    """Inside this context, without log messages of dask and its dependencies about workers and schedulers coming and
    going."""
    import logging

    import distributed  # noqa: F401, which names its loggers

    named = [name for name in logging.root.manager.loggerDict if name.partition(".")[0] in NOISY]
    before = {name: logging.getLogger(name).disabled for name in named}
    for name in named:
        logging.getLogger(name).disabled = True
    try:
        yield
    finally:
        for name, disabled in before.items():
            logging.getLogger(name).disabled = disabled


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
    """The finished tasks; raises _Lost if the scheduler is gone."""
    while coming.count():
        if coming.has_ready():
            yield next(coming)
            continue
        if client.status != "running":
            raise _Lost(f"The scheduler {_address(client)} is gone")
        time.sleep(LOOK)


def _address(client: object) -> str:
    return str(getattr(getattr(client, "scheduler", None), "address", "")) or "of the sweep"


def _threads(client: Any) -> int:
    """The number of threads of all workers; raises _Lost if there are none after a while."""
    try:
        client.wait_for_workers(1, timeout=60)
        return sum(client.nthreads().values())
    except (TimeoutError, OSError):
        raise _Lost(f"The scheduler {_address(client)} has no workers") from None


def _ready(client: Any) -> None:
    """Wait for workers, and let them load the modules of tasks; raises FileError if they cannot."""
    _threads(client)
    try:
        client.run(load)
    except ImportError as error:
        raise FileError(
            f"A worker cannot load the library: {error_line(error)}; install coadjoint[cluster] there."
        ) from None
    except OSError:
        raise _Lost(f"The scheduler {_address(client)} is gone") from None


def _lost_or_raise(client: Any, error: BaseException, number: int, lives: Counter[int]) -> None:
    """Continue if a task was lost with its worker; raise other errors."""
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
        raise FileError(f"Task {number} of the sweep failed on a worker: {error_line(error)}.") from error
    if lives[number] > LIVES:
        raise FileError(
            f"Task {number} of the sweep was lost with its worker again and again, as where a worker has too little "
            "memory: give fewer members a task with [sweep] task."
        )


def _call(task: Any) -> dict[str, float]:
    """On a worker: compute a task and write its shard."""
    from distributed import get_worker

    from coadjoint.sweeps.task import perform

    return perform(task, get_worker().state.nthreads)
