"""The interface of a stepper: its names and shapes, its memory, its lock, and the messages of a failed step."""

from __future__ import annotations

import ctypes
import os
import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple, Protocol
from weakref import WeakSet

import numpy as np

from coadjoint.errors import StepError
from coadjoint.kernels.lanes import in_lanes
from coadjoint.kernels.program import Code
from coadjoint.kernels.run.machine import Machine, compiled
from coadjoint.simulation.steppers.fields import Fields


class Buffers(NamedTuple):
    """Arrays that machine code reads and writes; lanes beyond the last member repeat it and wait.

    parameters (groups or 1, size, lanes), h (lanes,), state (groups, size, lanes), status (groups, 4, lanes): steps
    done since the last reset, code, Newton's iterations and the most of one step; commands and observations
    (groups · lanes, size); limits (2, commands, lanes): the lowest and highest commands, infinite where there are none.
    """

    parameters: np.ndarray
    h: np.ndarray
    state: np.ndarray
    status: np.ndarray
    commands: np.ndarray
    observations: np.ndarray
    limits: np.ndarray

    @classmethod
    def filled(cls, parameters: np.ndarray, h: float, state: np.ndarray, sizes: tuple[int, int], lanes: int) -> Buffers:
        """From parameters (members or 1, size) and states (members, size); sizes of commands and observations.

        Commands are without limits.
        """
        members = len(state)
        groups = -(-members // lanes)
        status, idle = np.zeros((groups, 4, lanes), np.int64), np.arange(members, groups * lanes)
        status[idle // lanes, 1, idle % lanes] = Code.ABSENT
        return cls(
            parameters=in_lanes(parameters, lanes, 1 if len(parameters) == 1 else groups),
            h=np.full(lanes, float(h)),
            state=in_lanes(state, lanes),
            status=status,
            commands=np.zeros((groups * lanes, sizes[0])),
            observations=np.zeros((groups * lanes, sizes[1])),
            limits=unlimited(sizes[0], lanes),
        )

    def with_limits(self, ends: np.ndarray) -> Buffers:
        """The same memory with lowest and highest commands (2, commands)."""
        return self._replace(limits=np.repeat(ends[..., None], len(self.h), axis=2))

    def with_parameters(self, rows: np.ndarray, shared: bool | None = None) -> Buffers:
        """The same memory with parameters (members, size); shared if all are equal, unless `shared` is given."""
        groups, _, lanes = self.state.shape
        shared = bool(np.all(rows == rows[0])) if shared is None else shared
        return self._replace(parameters=in_lanes(rows[:1] if shared else rows, lanes, 1 if shared else groups))

    def copy(self) -> Buffers:
        """A copy of all arrays."""
        return Buffers(*(array.copy() for array in self))

    def context(self) -> np.ndarray:
        """The arguments of machine code: `kernels.emit.online.CONTEXT`."""
        p = self.parameters
        stride = 0 if len(p) == 1 else p.shape[1] * p.shape[2]
        arrays = (self.h, self.state, self.status, self.commands, self.observations, self.limits)
        return np.array([p.ctypes.data, stride, *(array.ctypes.data for array in arrays)], np.int64)


def unlimited(commands: int, lanes: int) -> np.ndarray:
    """Limits (2, commands, lanes) that no command goes beyond."""
    return np.broadcast_to(np.array([-np.inf, np.inf])[:, None, None], (2, commands, lanes)).copy()


def put(grouped: np.ndarray, members: np.ndarray, rows: np.ndarray) -> None:
    """Write rows (k, size) of these members (k,) into an array (groups, size, lanes)."""
    lanes = grouped.shape[2]
    grouped[members // lanes, :, members % lanes] = rows


@dataclass(frozen=True)
class StepperInterface:
    """The public face of a stepper: names and shapes of its numbers, its step size, and remedies for a failed step.

    `members` is None for a single one. `commanded` are the places of the commands in a state, `time` that of t.
    """

    title: str
    dt: float
    members: int | None
    parameters: Fields
    state: Fields
    commands: Fields
    observations: Fields
    commanded: tuple[int, ...]
    time: int
    remedies: tuple[str, str]
    compiled_in: tuple[tuple[int, float], ...] = ()
    """Places and values of parameters that are 0 or 1 in the machine code itself."""
    of_momenta: tuple[int, ...] = ()
    """Places of parameters that the momenta of a place depend on, where ℓ is linear in the velocities."""

    def compiled_out(self, parameters: np.ndarray) -> list[int]:
        """The places where parameters (members, size) differ from the compiled-in values."""
        return [place for place, value in self.compiled_in if np.any(parameters[:, place] != value)]

    @property
    def count(self) -> int:
        """How many members there are."""
        return 1 if self.members is None else self.members


class Engine(Protocol):
    """The interface of an engine; one engine serves all clones of a stepper."""

    lanes: int

    def advance(self, buffers: Buffers, context: int, groups: int, steps: int, threads: int) -> int:
        """Read commands, take `steps` steps of all groups, write observations; 0, or the failures (`StatusFlag`)."""
        ...


class Prepared(NamedTuple):
    """Rows of numbers: states (k, size), and parameters (k, size), None if the stepper keeps its own."""

    states: np.ndarray
    parameters: np.ndarray | None

    def __len__(self) -> int:
        return len(self.states)


def failed_step(where: str, code: int, dt: float, remedies: tuple[str, str], commands: Mapping[str, np.ndarray]) -> str:
    """The failure of a step that ended with this code, and the remedy."""
    unsolved, beyond = remedies
    if bad := [name for name, value in commands.items() if not np.all(np.isfinite(value))]:
        return f"{where} could not be taken: the command `{bad[0]}` is not finite."
    again = "then reset or restore the stepper"
    if code == Code.NOT_CONVERGED:
        return f"{where} did not converge with dt = {dt:g}; {unsolved}, {again}."
    if code == Code.BEYOND_CHART:
        return f"{where} left the chart of the difference map: {beyond}, {again}."
    functions = "the Lagrangian or Hamiltonian, forces and `until`"
    return f"{where} gave numbers that are not finite; {unsolved}, or check {functions} there."


BUSY = "Another thread is stepping this stepper: give each thread a clone() of its own."


class StepperLock:
    """A lock that raises for a second thread that steps or changes, and makes threads that only read wait.

    `lock.acquire(False)` and `lock.release()` are the fast path; if acquiring fails, `wait()` decides.
    """

    def __init__(self) -> None:
        self.renew()
        _all.add(self)

    def renew(self) -> None:
        """Make the lock free."""
        self.lock, self._readers = threading.RLock(), set[int]()

    def wait(self) -> None:
        """Have the lock once all have read; raises StepError if another thread is stepping."""
        if not self.lock.acquire(bool(self._readers)):
            raise StepError(BUSY)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Hold the lock while the memory changes."""
        lock = self.lock
        if not lock.acquire(False):
            self.wait()
        try:
            yield
        finally:
            lock.release()

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Hold the lock while memory is only copied: waits for the end of a call in another thread."""
        me = threading.get_ident()
        self._readers.add(me)
        try:
            with self.lock:
                yield
        finally:
            self._readers.discard(me)


_all: WeakSet[StepperLock] = WeakSet()


def _renew_all() -> None:
    """In a fork, threads that had a lock are gone."""
    for turn in list(_all):
        turn.renew()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew_all)


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

    def __reduce__(self) -> tuple[object, ...]:
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
