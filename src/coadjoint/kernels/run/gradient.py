"""Reverse-mode derivatives of a run by native code: forward with a tape, and back over it.

A tape that takes more than ROOM is not kept: then checkpoints lead to one stretch after another.
"""

from __future__ import annotations

import ctypes
import math
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import Any, NamedTuple

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.chunk import Chunk
from coadjoint.kernels.emit import adjoint as adjoints
from coadjoint.kernels.emit.plan import plan, specialised
from coadjoint.kernels.packing import Layout, layout, pack
from coadjoint.kernels.program import Program
from coadjoint.kernels.run import native
from coadjoint.kernels.run.machine import Machine, machine
from coadjoint.kernels.run.tapes import ROOM, Tapes
from coadjoint.log import phase

KEPT = 32
"""How many adjoints stay in memory."""

STRETCH = 2048
"""Steps between checkpoints at least: a call of the machine costs as much as some hundred steps."""

_SIGNATURE = [*[ctypes.c_void_p] * 3, *[ctypes.c_int64] * 2, ctypes.c_void_p, ctypes.c_int64, *[ctypes.c_void_p] * 3]


@dataclass(frozen=True, eq=False)
class _Adjoint:
    """Machine code that takes steps with a tape, and machine code that goes back over the tape.

    A row of the tape begins with a record, of this layout.
    """

    forward: native.Kernel
    record: Layout
    machine: Machine
    function: Any

    @property
    def width(self) -> int:
        """How many numbers a row of the tape has."""
        return self.forward.record.size


class Cotangents(NamedTuple):
    """The result of a pullback, PyTrees like the arguments."""

    parameters: PyTree
    state: PyTree
    h: np.ndarray


_adjoints: OrderedDict[tuple, _Adjoint] = OrderedDict()
_lock = threading.Lock()
_tapes = Tapes()


def vjp(
    program: Program, parameters: PyTree, state: PyTree, h: float, records: int, save_every: int
) -> tuple[Chunk, Callable[[Any, Any], Cotangents]]:
    """The run, without monitors, and its pullback: (cotangent of records, of the final state) ↦ `Cotangents`.

    The cotangents are PyTrees like `chunk.records` and `chunk.final`; None stands for zero. The pullback needs memory
    for every step, or for √steps states where these exceed ROOM, and costs about as much as the run. A run that failed
    (`chunk.code`) has no derivative: its cotangents are NaN. Raises Untraceable, naming the primitive, if the program
    is outside the tracer's language.
    """
    run = NativeRun(program, parameters, state, records, save_every)
    given = np.concatenate([pack(parameters)[1], pack(state)[1], [float(h)]])

    def pull(records_bar: PyTree, final_bar: PyTree) -> Cotangents:
        rows_bar = None if records_bar is None else pack(records_bar)[1]
        end_bar = np.zeros(run.state.size) if final_bar is None else pack(final_bar)[1]
        p, s, h = run.parts(run.pulled(given, rows_bar, end_bar))
        return Cotangents(run.parameters.unpack(p), run.state.unpack(s), h[0])

    return native.chunk(*run.launch(given, taped=True), run.state, records, save_every), pull


class _Failed(Exception):
    """A step failed on the way forward."""


class NativeRun:
    """records·save_every steps of a program on numbers end to end, those of parameters, state and h, and its pullback.

    `parameters` and `state` are layouts of the numbers.
    """

    def __init__(self, program: Program, parameters: PyTree, state: PyTree, records: int, save_every: int) -> None:
        self.parameters, self.state = layout(parameters), layout(state)
        self.records, self.save_every, self.steps = records, save_every, records * save_every
        self._program = program
        self._adjoints: dict[tuple[int, ...], _Adjoint] = {}
        self._plain: dict[tuple[int, ...], native.Kernel] = {}

    @property
    def size(self) -> int:
        """How many numbers parameters, state and h are."""
        return self.parameters.size + self.state.size + 1

    def parts(self, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Those of parameters, of the state and of h, (1,)."""
        return numbers[: self.parameters.size], numbers[self.parameters.size : -1], numbers[-1:]

    def value(self, given: np.ndarray, taped: bool) -> np.ndarray:
        """The records, leaf by leaf, the final state, the code and the iterations, end to end.

        Those records that a failed run lacks repeat its last good one. `taped`: as in `launch`.
        """
        kernel, found = self.launch(given, taped)
        steps, code, iterations, _ = found.status[:, 0].tolist()
        rows, good = found.records[:, :, 0], -(-steps // self.save_every)
        rows[good:] = rows[good - 1] if good else 0.0
        leaves = [
            rows[:, start:end].ravel()
            for start, end in pairwise(accumulate(map(math.prod, kernel.record.shapes), initial=0))
        ]
        return np.concatenate([*leaves, found.state[:, 0], [code, iterations]])

    def launch(self, given: np.ndarray, taped: bool) -> tuple[native.Kernel, native.LaneArrays]:
        """The output of the machine code; `taped`: its tape stays for `pulled` of the same numbers, if it fits."""
        p, s, h = self.parts(given)
        code = self._adjoint(given) if taped else None
        if code is None or not self._fits(code):
            kernel = self._kernel(given)
            return kernel, native.launch(kernel, p[:, None], h, s[:, None], self.records, self.save_every)
        room = _tapes.room((self.steps, code.width))
        found = native.launch(code.forward, p[:, None], h, s[:, None], self.steps, 1, room[:, :, None])
        if not found.status[1, 0]:
            _tapes.keep(self._key(code, given), room)
        saved = room[:: self.save_every, : code.record.size, None].copy()
        return code.forward._replace(record=code.record), found._replace(records=saved)

    def pulled(self, given: np.ndarray, records_bar: np.ndarray | None, final_bar: np.ndarray) -> np.ndarray:
        """Cotangents of the given numbers from those of the records, their leaves end to end, and of the final state.

        None stands for zero. NaN for a run that fails.
        """
        found, code = np.zeros(given.size), self._adjoint(given)
        self.parts(found)[1][:] = final_bar
        rows = (self.records, code.record.size)
        bars = np.zeros(rows) if records_bar is None else self._rows(records_bar, code.record)
        try:
            self._back(code, given, bars, found)
        except _Failed:
            found[:] = np.nan
        return found

    def _back(self, code: _Adjoint, given: np.ndarray, bars: np.ndarray, found: np.ndarray) -> None:
        """Stretch by stretch from the last to the first; `found` has the cotangent of the final state."""
        p, s, h = self.parts(given)

        def back(tape: np.ndarray, first: int) -> None:
            arrays = (p, h, tape, bars, *self.parts(found))
            at_p, at_h, rows, rows_of_bars, p_bar, s_bar, h_bar = (a.ctypes.data for a in arrays)
            code.function(at_p, at_h, rows, first, len(tape), rows_of_bars, self.save_every, p_bar, h_bar, s_bar)

        if self._fits(code):
            key = self._key(code, given)
            tape = _tapes.taken(key)
            if tape is None:
                tape = _tapes.room((self.steps, code.width))
                _forward(code.forward, p, h, s, self.steps, 1, tape)
            back(tape, 0)
            _tapes.keep(key, tape, pulled=True)
            return
        length = max(math.isqrt(self.steps), min(self.steps, STRETCH))
        starts, room = list(range(0, self.steps, length)), np.empty((length, code.width))
        checkpoints = [s]
        for _ in starts[1:]:
            checkpoints.append(_forward(self._kernel(given), p, h, checkpoints[-1], 1, length))
        for first, checkpoint in reversed(list(zip(starts, checkpoints, strict=True))):
            tape = room[: self.steps - first]
            _forward(code.forward, p, h, checkpoint, len(tape), 1, tape)
            back(tape, first)

    def _rows(self, numbers: np.ndarray, record: Layout) -> np.ndarray:
        """Records by rows, whose leaves lie one after the other with the rows of each: the numbers of one together."""
        parts, start = [], 0
        for size in map(math.prod, record.shapes):
            parts.append(numbers[start : start + self.records * size].reshape(self.records, size))
            start += self.records * size
        return np.concatenate(parts, axis=1)

    def _fits(self, code: _Adjoint) -> bool:
        """Whether the tape is kept."""
        return 8 * self.steps * code.width <= ROOM

    def _key(self, code: _Adjoint, given: np.ndarray) -> tuple[object, ...]:
        return code, self.steps, given.tobytes()

    def _adjoint(self, given: np.ndarray) -> _Adjoint:
        p, s, _ = self.parts(given)
        pattern = specialised(p)
        if pattern not in self._adjoints:
            key = self._program, self.parameters, self.state, pattern
            self._adjoints[pattern] = _adjoint(key, self.parameters.unpack(p), self.state.unpack(s))
        return self._adjoints[pattern]

    def _kernel(self, given: np.ndarray) -> native.Kernel:
        p, s, _ = self.parts(given)
        pattern = specialised(p)
        if pattern not in self._plain:
            variant = native.Variant(self.parameters, self.state, pattern, False, 1)
            arguments = self._program, self.parameters.unpack(p), self.state.unpack(s), variant
            self._plain[pattern] = native.kernel_for(*arguments)
        return self._plain[pattern]


def _forward(
    kernel: native.Kernel,
    p: np.ndarray,
    h: np.ndarray,
    s: np.ndarray,
    records: int,
    every: int,
    rows: np.ndarray | None = None,
) -> np.ndarray:
    """The state after a run; raises _Failed if a step fails. rows: where the records go."""
    found = native.launch(kernel, p[:, None], h, s[:, None], records, every, None if rows is None else rows[:, :, None])
    if found.status[1, 0]:
        raise _Failed
    return found.state[:, 0]


def _adjoint(key: tuple[Program, Layout, Layout, tuple[int, ...]], parameters: PyTree, state: PyTree) -> _Adjoint:
    with _lock:
        known = _adjoints.get(key)
        if known is not None:
            _adjoints.move_to_end(key)
            return known
    phase("Compiling a step with its adjoint.")
    program, _, _, pattern = key
    forward = plan(program, parameters, state, pattern, False, unrolled=True)
    row = adjoints.row(forward)
    taped = native.load(replace(forward, record=row), 1)
    # Derivatives by entries that happen to be 0 or 1 are wanted too: they are symbols until these are derived.
    general = plan(program, parameters, state, (2,) * len(pattern), False, unrolled=True)
    places = [row.index(node) for node in adjoints.tape(forward)]
    code = machine(adjoints.assemble(adjoints.adjoint(general, pattern), places, len(row)))
    made = _Adjoint(taped, layout(forward.record_tree), code, code.function(adjoints.NAME, *_SIGNATURE))
    with _lock:
        _adjoints[key] = made
        while len(_adjoints) > KEPT:
            _adjoints.popitem(last=False)
    return made
