"""The workers of a sweep on this machine: processes at the other end of two pipes, without any network service.

A worker calls the functions that come through its standard input, one after another, and answers through its standard
output. Its input ends when the process that started it ends, in whatever way; then the worker ends as well, in the
middle of a task if necessary.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from queue import Empty, SimpleQueue
from typing import Any

from coadjoint.errors import CoadjointError, FileError, error_line, rephrased
from coadjoint.interrupts import look

LIVES = 10
"""The number of attempts for a task whose workers died."""
LOOK = 0.5
"""Seconds between two looks for an interrupt."""

ALONE = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Variables by which each worker computes on one thread."""

_START = "import sys; sys.path[:] = sys.argv[1:]; from coadjoint.sweeps.local import serve; serve()"

_GONE = object()
"""The mark for the end of a worker's answers."""

Call = Callable[[], Any]
Done = Callable[[int, Mapping[str, float]], None]
"""Called with the number of a task that is done, and with its times."""


def run(call: Callable[[int], Call], numbers: Sequence[int], done: Done, workers: int) -> dict[str, float]:
    """Call the task of each number: in this process where one worker would do, otherwise in processes.

    call: computes the task of a number. Returns the seconds until a worker was ready, and those of tasks from then on.
    Raises the errors of tasks, and FileError for one whose worker dies again and again.
    """
    began = time.perf_counter()
    if min(workers, len(numbers)) <= 1:
        for number in numbers:
            done(number, call(number)())
        return {"starting_seconds": 0.0, "computing_seconds": time.perf_counter() - began}
    with _Crew(min(workers, len(numbers))) as crew:
        ready = crew.work(call, numbers, done)
    return {"starting_seconds": ready - began, "computing_seconds": time.perf_counter() - ready}


class _Crew:
    """Workers, each with a thread that waits for its answers."""

    def __init__(self, workers: int):
        self.answers: SimpleQueue[tuple[_Worker, Any]] = SimpleQueue()
        self.workers: list[_Worker] = []
        self.size = workers

    def __enter__(self) -> _Crew:
        return self

    def __exit__(self, *_: object) -> None:
        for worker in self.workers:
            worker.end()

    def start(self) -> None:
        """Start a worker, which first loads the modules of tasks."""
        worker = _Worker(self.answers)
        self.workers.append(worker)
        worker.give(None, load)

    def work(self, call: Callable[[int], Call], numbers: Sequence[int], done: Done) -> float:
        """All tasks; when the first worker was ready for them."""
        waiting, left, lives, ready = list(reversed(numbers)), len(numbers), Counter[int | None](), 0.0
        for _ in range(self.size):
            self.start()
        while left:
            worker, answer = self._answer()
            number = worker.number
            if answer is _GONE:
                self.workers.remove(worker)
                worker.end()
                if worker.resting:
                    continue
                lives[number] += 1
                _require_life(number, lives[number])
                if number is not None:
                    waiting.append(number)
                self.start()
                continue
            if isinstance(answer, CoadjointError):
                raise answer
            if number is None:
                ready = ready or time.perf_counter()
            else:
                left -= 1
                done(number, answer)
            worker.resting = not waiting
            if waiting:
                worker.give(waiting[-1], call(waiting.pop()))
        return ready

    def _answer(self) -> tuple[_Worker, Any]:
        while True:
            look()
            with suppress(Empty):
                return self.answers.get(timeout=LOOK)


class _Worker:
    """A process that calls functions; `number` is the task that it has, None before the first; `resting`: it has done
    that, and there was no other."""

    def __init__(self, answers: SimpleQueue[tuple[_Worker, Any]]):
        self.number: int | None = None
        self.resting = False
        alone = {**dict.fromkeys(ALONE, "1"), **os.environ}
        with rephrased("A worker of the sweep could not be started"), _deaf():
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-c", _START, *sys.path],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=alone,
            )
        threading.Thread(target=self._hear, args=(answers,), daemon=True).start()

    def give(self, number: int | None, call: Call) -> None:
        """Let it call a function."""
        assert self.process.stdin is not None
        self.number = number
        with suppress(OSError):  # of one that has died, whose answers end
            pickle.dump(pickle.dumps(call), self.process.stdin)
            self.process.stdin.flush()

    def _hear(self, answers: SimpleQueue[tuple[_Worker, Any]]) -> None:
        """Pass on its answers, and _GONE when they end."""
        with suppress(EOFError, OSError, ValueError, pickle.UnpicklingError):
            while True:
                answers.put((self, pickle.load(self.process.stdout)))  # pyright: ignore[reportArgumentType]
        answers.put((self, _GONE))

    def end(self) -> None:
        """Kill it, without waiting for its task."""
        self.process.kill()
        self.process.wait()
        with suppress(OSError):
            self.process.stdin.close()  # pyright: ignore[reportOptionalMemberAccess]


def _require_life(number: int | None, lost: int) -> None:
    """Raise FileError if workers died too often."""
    if lost <= LIVES:
        return
    if number is None:
        raise FileError(f"Workers of the sweep ended {lost} times before their first task: see what they wrote above.")
    raise FileError(
        f"Task {number} of the sweep was lost with its worker {lost} times, as where a worker has too little memory: "
        "give fewer members a task with [sweep] task."
    )


@contextmanager
def _deaf() -> Iterator[None]:
    """Inside this context, started processes ignore Ctrl-C; this process ends them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


# The worker.


def serve() -> None:
    """Call the functions that come through the standard input, and answer; ends with the process at the other end."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    source, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    os.dup2(2, 1)  # The output of tasks is not an answer.
    calls: SimpleQueue[bytes] = SimpleQueue()
    threading.Thread(target=_listen, args=(source, calls), daemon=True).start()
    while True:
        pickle.dump(_called(calls.get()), answers)
        answers.flush()


def _listen(source: Any, calls: SimpleQueue[bytes]) -> None:
    """Put messages into the queue; at its end the starting process is gone."""
    try:
        while True:
            calls.put(pickle.load(source))
    finally:
        os._exit(0)


def _called(call: bytes) -> Any:
    """The result of a call, or the error that it raises."""
    try:
        return pickle.loads(call)()
    except CoadjointError as error:
        return type(error)(str(error))
    except Exception as error:
        return FileError(f"A task of the sweep failed: {error_line(error)}.")


def load() -> None:
    """Load the modules of tasks."""
    import_module("coadjoint.sweeps.task")
