"""Many short runs driven from tables, and their tangents: one run in each SIMD lane, all steps of all runs kept.

The inputs of a run are written into its state before every step, so that a table may have any length.
"""

from __future__ import annotations

import ctypes
import threading
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from coadjoint.arrays import PyTree, Scalar
from coadjoint.kernels.emit import tangent as tangents
from coadjoint.kernels.emit.adjoint import tape
from coadjoint.kernels.emit.plan import plan, specialised
from coadjoint.kernels.lanes import in_lanes, of_lanes
from coadjoint.kernels.packing import pack
from coadjoint.kernels.program import Program
from coadjoint.kernels.run import native
from coadjoint.kernels.run.ensemble import lanes
from coadjoint.kernels.run.interruptible import Clock, PieceLength
from coadjoint.kernels.run.machine import Machine, machine

KEPT = 16
"""How many programs stay in memory with their tangents."""

_SIGNATURE = [*[ctypes.c_void_p] * 3, ctypes.c_int64, ctypes.c_void_p, ctypes.c_int64, *[ctypes.c_void_p] * 2]


class Driven(NamedTuple):
    """Machine code that takes steps with a tape, and that which pushes directions along the tape."""

    forward: native.Kernel
    machine: Machine
    tangent: PyTree
    taped: int
    """How many numbers of a row are the tape; the rest is the record."""
    width: int
    pace: PieceLength


class Path(NamedTuple):
    """The output of runs, with a first axis of groups and a last one of lanes; `runs` of the lanes are in use."""

    rows: np.ndarray
    state: np.ndarray
    status: np.ndarray
    taped: int
    runs: int

    @property
    def records(self) -> np.ndarray:
        """The record of every step: (runs, steps, record)."""
        return of_lanes(self.rows[:, :, self.taped :], self.runs)

    @property
    def states(self) -> np.ndarray:
        """The state at every node but the last: (runs, steps, state)."""
        return of_lanes(self.rows[:, :, : self.state.shape[1]], self.runs)

    @property
    def codes(self) -> np.ndarray:
        """The `Code` with which each run ended."""
        return of_lanes(self.status, self.runs)[:, 1]


class PiecewiseParameters(NamedTuple):
    """Parameters that change in the midst of runs: to p[places] + values of knot k, (runs, knots, places), from step
    k `steps` on; the last knot lasts to the end. `components`: how many columns of derivatives a knot has."""

    places: np.ndarray
    components: int
    steps: int
    values: np.ndarray

    def knots(self, steps: int) -> list[tuple[int, int, int]]:
        """(knot, first step, steps) of a run of so many steps."""
        last = self.values.shape[1] - 1
        edges = [*(k * self.steps for k in range(last + 1) if k * self.steps < steps), steps]
        return [(k, edges[k], edges[k + 1] - edges[k]) for k in range(len(edges) - 1)]


_known: OrderedDict[tuple, Driven] = OrderedDict()
_lock = threading.Lock()


def driven(program: Program, parameters: PyTree, state: PyTree, active: Sequence[int]) -> Driven:
    """The code for a program whose record holds the wanted results of every step, with the parameters numbered
    `active`.

    Raises Untraceable, naming the primitive, if the program is outside the tracer's language.
    """
    (shape_p, p), (shape_s, _) = pack(parameters), pack(state)
    pattern = tuple(2 if i in set(active) else kind for i, kind in enumerate(specialised(p)))
    key = program, shape_p, shape_s, pattern, tuple(active), lanes()
    with _lock:
        if key in _known:
            _known.move_to_end(key)
            return _known[key]
    planned = plan(program, parameters, state, pattern, False, unrolled=True)
    rows = tape(planned)
    forward = native.load(replace(planned, record=[*rows, *planned.record]), lanes())
    code = machine(tangents.assemble(tangents.tangent(planned, active), lanes()))
    made = Driven(forward, code, code.function(tangents.NAME, *_SIGNATURE), len(rows), lanes(), PieceLength())
    with _lock:
        _known[key] = made
        while len(_known) > KEPT:
            _known.popitem(last=False)
    return made


def run(
    code: Driven,
    p: np.ndarray,
    h: Scalar,
    start: np.ndarray,
    places: np.ndarray,
    table: np.ndarray,
    wandering: PiecewiseParameters | None = None,
) -> Path:
    """Steps of length h of every run from `start` (runs, state), with the same parameters p for all but `wandering`.

    Before step j the entries `places` of the state become those of the table, `grouped` (steps, runs, places).
    """
    runs = len(start)
    state = in_lanes(start, code.width)
    groups, steps, width = len(state), len(table), code.width
    rows = np.empty((groups, steps, code.forward.record.size, width))
    status = np.zeros((groups, 4, width), np.int64)
    codes = np.zeros((groups, width), np.int64)
    numbers, length = _numbers(p, groups, width), np.full(width, float(h))
    changes = {first: knot for knot, first, _ in wandering.knots(steps)} if wandering else {}
    nothing = np.zeros(1)
    none, step = nothing.ctypes.data, length.ctypes.data
    starts = [
        (numbers.ctypes.data + i * numbers.strides[0], state.ctypes.data + i * state.strides[0],
         rows.ctypes.data + i * rows.strides[0], status.ctypes.data + i * status.strides[0])
        for i in range(groups)
    ]  # fmt: skip
    function, ahead = code.forward.function, rows.strides[1]
    for j in range(steps):
        state[:, places] = table[j]
        if wandering and j in changes:
            _move(numbers, p, wandering, changes[j])
        status[:] = 0
        for given, here, out, told in starts:
            function(given, step, here, 1, 1, out + j * ahead, none, none, told)
        np.maximum(codes, status[:, 1], out=codes)
    status[:, 1] = codes
    return Path(rows, state, status, code.taped, runs)


def grouped(table: np.ndarray) -> np.ndarray:
    """A table (steps, runs, places) as `run` takes it: (steps, groups, places, lanes)."""
    steps, runs, places = table.shape
    width = lanes()
    if not places:
        return np.zeros((steps, -(-runs // width), 0, width))
    return np.stack([in_lanes(row, width) for row in table])


def push(
    code: Driven,
    p: np.ndarray,
    h: float,
    path: Path,
    p_dot: np.ndarray,
    start_dot: np.ndarray,
    wandering: PiecewiseParameters | None = None,
) -> np.ndarray:
    """Derivatives of the records, (runs, steps, columns, record), along directions of parameters and start.

    p_dot: (columns, active), the same for all runs. start_dot: (runs, columns, state), zero where
    a table drives the state. Of `wandering`, the last columns are its values, knot after knot: p_dot and start_dot hold
    those of the first knot, whose directions are those of the others.
    """
    groups, steps, row, width = path.rows.shape
    columns = len(p_dot)
    numbers, length = _numbers(p, groups, width), np.full(width, float(h))
    directions = np.repeat(p_dot[:, :, None], width, axis=2)
    state_dot = in_lanes(start_dot.reshape(path.runs, -1), width)
    found = np.zeros((groups * width, steps, columns, row - code.taped))
    pieces = [(0, 0, steps)] if wandering is None else wandering.knots(steps)
    for knot, first, count in pieces:
        used = columns
        if wandering is not None:
            _move(numbers, p, wandering, knot)
            used = _turn(directions, wandering, knot)
        for group in range(groups):
            given = numbers[group].ctypes.data, length.ctypes.data, directions.ctypes.data
            part = np.empty((count, used, row - code.taped, width))
            _pushed(code, given, path.rows[group, first:], used, state_dot[group], part)
            found[group * width : (group + 1) * width, first : first + count, :used] = np.moveaxis(part, -1, 0)
    return found[: path.runs]


def _pushed(
    code: Driven, given: tuple[int, int, int], rows: np.ndarray, columns: int, along: np.ndarray, out: np.ndarray
) -> None:
    """The first `columns` directions, pushed through as many steps as `out` has, (steps, columns, record, lanes)."""
    done, clock, (numbers, length, directions) = 0, Clock(code.pace), given
    while done < len(out):
        count = min(code.pace.steps, len(out) - done)
        code.tangent(
            numbers, length, rows[done:].ctypes.data, count, directions, columns, along.ctypes.data,
            out[done:].ctypes.data,
        )  # fmt: skip
        done += count
        clock.lap(count)


def _numbers(p: np.ndarray, groups: int, width: int) -> np.ndarray:
    """The same parameters for all: (groups, parameters, lanes)."""
    return np.broadcast_to(p[None, :, None], (groups, len(p), width)).copy()


def _move(numbers: np.ndarray, p: np.ndarray, wandering: PiecewiseParameters, knot: int) -> None:
    """Give the piecewise parameters their values of a knot."""
    values = in_lanes(wandering.values[:, knot], numbers.shape[2])
    numbers[:, wandering.places] = p[wandering.places][:, None] + values


def _turn(directions: np.ndarray, wandering: PiecewiseParameters, knot: int) -> int:
    """Let the columns of this knot alone move parameters; how many columns are in use until it ends."""
    each = len(directions) - wandering.values.shape[1] * wandering.components
    old = each + (knot - 1) * wandering.components
    if knot:
        new = slice(old + wandering.components, old + 2 * wandering.components)
        directions[new] = directions[old : old + wandering.components]
        directions[old : old + wandering.components] = 0.0
    return each + (knot + 1) * wandering.components
