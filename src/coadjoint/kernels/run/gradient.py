"""Reverse-mode derivatives of a run by native code: forward with checkpoints, back over one stretch at a time."""

from __future__ import annotations

import ctypes
import math
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.chunk import Chunk
from coadjoint.kernels.emit import adjoint as adjoints
from coadjoint.kernels.emit.plan import plan, specialised
from coadjoint.kernels.packing import Layout, pack
from coadjoint.kernels.program import Program
from coadjoint.kernels.run import native
from coadjoint.kernels.run.machine import Machine, machine

KEPT = 32
"""How many adjoints stay in memory."""

STRETCH = 2048
"""Steps between checkpoints at least: a call of the machine costs as much as some hundred steps."""

_SIGNATURE = [*[ctypes.c_void_p] * 3, ctypes.c_int64, *[ctypes.c_void_p] * 4]


class _Adjoint(NamedTuple):
    """Machine code that takes steps with a tape, and machine code that goes back over the tape."""

    forward: native.Kernel
    machine: Machine
    function: Any


class Cotangents(NamedTuple):
    """The result of a pullback, PyTrees like the arguments."""

    parameters: PyTree
    state: PyTree
    h: np.ndarray


_adjoints: OrderedDict[tuple, _Adjoint] = OrderedDict()
_lock = threading.Lock()


def vjp(
    program: Program, parameters: PyTree, state: PyTree, h: float, records: int, save_every: int
) -> tuple[Chunk, Callable[[Any, Any], Cotangents]]:
    """The run, without monitors, and its pullback: (cotangent of records, of the final state) ↦ `Cotangents`.

    The cotangents are PyTrees like `chunk.records` and `chunk.final`; None stands for zero. The pullback needs memory
    for √steps states and costs a few times the run. A run that failed (`chunk.code`) has no derivative: its
    cotangents are NaN. Raises Untraceable, naming the primitive, if the program is outside the tracer's language.
    """
    chunk = native.run(program, parameters, state, h, records, save_every, monitors=False)
    return chunk, pullback(program, parameters, state, h, records, save_every)


def pullback(
    program: Program, parameters: PyTree, state: PyTree, h: float, records: int, save_every: int
) -> Callable[[Any, Any], Cotangents]:
    """The pullback of `vjp` alone, for an earlier run: a failure shows on the way."""

    def pull(records_bar: PyTree, final_bar: PyTree) -> Cotangents:
        back = _Pullback(program, parameters, state, h, records * save_every, save_every)
        return back.run(records_bar, final_bar)

    return pull


class _Failed(Exception):
    """A step failed on the way forward."""


class _Pullback:
    def __init__(
        self, program: Program, parameters: PyTree, state: PyTree, h: float, steps: int, save_every: int
    ) -> None:
        (self.shape_p, self.p), (self.shape_s, self.s) = pack(parameters), pack(state)
        self.h, self.steps, self.save_every = np.full(1, float(h)), steps, save_every
        pattern = specialised(self.p)
        key = program, self.shape_p, self.shape_s, pattern
        variant = native.Variant(self.shape_p, self.shape_s, pattern, False, 1)
        self.plain = native.kernel_for(program, parameters, state, variant)
        self.code = _adjoint(key, parameters, state)

    def run(self, records_bar: PyTree, final_bar: PyTree) -> Cotangents:
        try:
            p_bar, s_bar, h_bar = self._back(records_bar, final_bar)
        except _Failed:
            p_bar, s_bar, h_bar = np.full(self.p.size, np.nan), np.full(self.s.size, np.nan), np.full(1, np.nan)
        return Cotangents(self.shape_p.unpack(p_bar[: self.p.size]), self.shape_s.unpack(s_bar), h_bar[0])

    def _forward(self, kernel: native.Kernel, start: np.ndarray, records: int, every: int) -> native.LaneArrays:
        found = native.launch(kernel, self.p[:, None], self.h, start[:, None], records, every)
        if found.status[1, 0]:
            raise _Failed
        return found

    def _back(self, records_bar: PyTree, final_bar: PyTree) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Stretch by stretch from the last to the first: cotangents of parameters, state and h."""
        length = max(math.isqrt(self.steps), min(self.steps, STRETCH))
        starts = list(range(0, self.steps, length))
        checkpoints = self._checkpoints(length, len(starts))
        p_bar, h_bar = np.zeros(max(self.p.size, 1)), np.zeros(1)
        s_bar = np.zeros(self.s.size) if final_bar is None else pack(final_bar)[1].copy()
        rows_bar = self._rows_bar(records_bar)
        for first, checkpoint in reversed(list(zip(starts, checkpoints, strict=True))):
            count = min(length, self.steps - first)
            tape = self._forward(self.code.forward, checkpoint, count, 1).records
            bars = np.zeros((count, self.plain.record.size))
            if rows_bar is not None:
                saved = np.arange(first, first + count)
                here = saved % self.save_every == 0
                bars[here] = rows_bar[saved[here] // self.save_every]
            pointers = [np.ascontiguousarray(a) for a in (self.p, self.h, tape, bars)]
            p, h, rows, rows_of_bars = (a.ctypes.data for a in pointers)
            outputs = (p_bar.ctypes.data, h_bar.ctypes.data, s_bar.ctypes.data)
            self.code.function(p, h, rows, count, rows_of_bars, *outputs)
        return p_bar, s_bar, h_bar

    def _checkpoints(self, length: int, count: int) -> list[np.ndarray]:
        """The states from which stretches of `length` steps start."""
        states = [self.s]
        for _ in range(count - 1):
            states.append(self._forward(self.plain, states[-1], 1, length).state[:, 0])
        return states

    def _rows_bar(self, records_bar: PyTree) -> np.ndarray | None:
        if records_bar is None:
            return None
        _, numbers = pack(records_bar)
        rows = -(-self.steps // self.save_every)
        # The leaves lie one after the other, each with its rows: bring the numbers of a record together.
        parts, start = [], 0
        for shape in self.plain.record.shapes:
            size = math.prod(shape)
            parts.append(numbers[start : start + rows * size].reshape(rows, size))
            start += rows * size
        return np.concatenate(parts, axis=1)


def _adjoint(key: tuple[Program, Layout, Layout, tuple[int, ...]], parameters: PyTree, state: PyTree) -> _Adjoint:
    with _lock:
        known = _adjoints.get(key)
        if known is not None:
            _adjoints.move_to_end(key)
            return known
    program, _, _, pattern = key
    forward = plan(program, parameters, state, pattern, False, unrolled=True)
    taped = native.load(replace(forward, record=adjoints.tape(forward)), 1)
    # Derivatives by entries that happen to be 0 or 1 are wanted too: here all parameters are symbols.
    general = plan(program, parameters, state, (2,) * len(pattern), False, unrolled=True)
    code = machine(adjoints.assemble(adjoints.adjoint(general)))
    made = _Adjoint(taped, code, code.function(adjoints.NAME, *_SIGNATURE))
    with _lock:
        _adjoints[key] = made
        while len(_adjoints) > KEPT:
            _adjoints.popitem(last=False)
    return made
