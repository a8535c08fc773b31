"""The engine of a stepper in machine code."""

from __future__ import annotations

import ctypes
import os
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Any

from coadjoint.kernels.run.machine import Machine, compiled
from coadjoint.simulation.steppers.interface import Buffers

ENTRY = "online"


class NativeEngine:
    """Machine code of `kernels.emit.online`, from LLVM assembly or from `code`, where that was compiled here before."""

    _threads: tuple[int, ThreadPoolExecutor] | None = None

    def __init__(self, assembly: str, lanes: int, code: bytes | None = None):
        self.assembly, self.lanes = assembly, lanes
        self.code = compiled(assembly) if code is None else code
        self._machine = Machine(self.code)
        whole = ctypes.c_int64
        self._function = self._machine.function(ENTRY, ctypes.c_void_p, whole, whole, whole, result=whole)

    def _pool(self) -> ThreadPoolExecutor:
        """The threads of this process: those of a parent do not live in its fork."""
        if self._threads is None or self._threads[0] != os.getpid():
            self._threads = os.getpid(), ThreadPoolExecutor()
        return self._threads[1]

    def advance(self, buffers: Buffers, context: int, groups: int, steps: int, threads: int) -> int:
        """All groups by one call of the machine, which lets other threads run; or a share of them on each thread."""
        if threads == 1 or groups == 1:
            return self._function(context, 0, groups, steps)
        return self._shared(context, groups, steps, min(threads, groups))

    def _shared(self, context: int, groups: int, steps: int, threads: int) -> int:
        borders = [groups * part // threads for part in range(threads + 1)]

        def run(part: int) -> int:
            return self._function(context, borders[part], borders[part + 1], steps)

        pool, waiting = self._pool(), []
        try:
            waiting += [pool.submit(run, part) for part in range(1, threads)]
            flags = run(0)
        finally:
            # Wait until all threads have left the memory, also after an interrupt.
            _finished(waiting)
        for future in waiting:
            flags |= future.result()
        return flags

    def __reduce__(self) -> Any:
        raise TypeError("An engine is saved by its stepper.")


def _finished(waiting: list[Future[int]]) -> None:
    """Wait for all threads, then raise an interrupt that occurred in the meantime."""
    interrupt = None
    while not all(future.done() for future in waiting):
        try:
            wait(waiting)
        except KeyboardInterrupt as raised:
            interrupt = raised
    if interrupt is not None:
        raise interrupt
