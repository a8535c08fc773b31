"""Runs a program as machine code that was traced and compiled for it."""

from __future__ import annotations

import ctypes
import math
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from coadjoint.arrays import PyTree, Scalar
from coadjoint.kernels.chunk import Chunk
from coadjoint.kernels.emit import link_loops
from coadjoint.kernels.emit.link_check import require_links
from coadjoint.kernels.emit.link_plan import plan_links
from coadjoint.kernels.emit.plan import StepPlan, plan, specialised
from coadjoint.kernels.emit.stepping import NAME, assemble
from coadjoint.kernels.packing import Layout, layout, pack
from coadjoint.kernels.program import Code, LinkedStage, Program
from coadjoint.kernels.run import disk_cache, plans
from coadjoint.kernels.run.interruptible import Clock, Cut, PieceLength
from coadjoint.kernels.run.machine import Machine, kept_machine, lanes, machine
from coadjoint.kernels.untraceable import NotLinked
from coadjoint.log import phase

KEPT = 128
"""How many kernels stay in memory."""

_SIGNATURE = [*[ctypes.c_void_p] * 3, *[ctypes.c_int64] * 2, *[ctypes.c_void_p] * 4]


class Variant(NamedTuple):
    """The variant of a program that a kernel runs.

    parameters, state: their layouts. pattern: that of `specialised`. monitors: whether it observes. width: of its
    lanes. course: whether the unknowns of every substep, with the state after it, follow
    each record. substeps: whether a record is those of all substeps, of loops over links.
    """

    parameters: Layout
    state: Layout
    pattern: tuple[int, ...]
    monitors: bool
    width: int
    course: bool = False
    substeps: bool = False


class Kernel(NamedTuple):
    """Machine code for a program at given shapes; `machine` keeps the code alive that `function` points to.

    course: how many numbers follow each record. workspace: how many it needs in addition to its arguments.
    """

    machine: Machine
    function: Any
    record: Layout
    monitor_shapes: dict[str, tuple[int, ...]]
    certificates: tuple[str, ...]
    pace: PieceLength
    course: int = 0
    workspace: int = 0

    @property
    def looped(self) -> bool:
        """Whether it loops over links, and observes nothing."""
        return self.workspace > 0

    @property
    def row(self) -> int:
        """How many numbers a record is, with those behind it."""
        return self.record.size + self.course

    @property
    def monitor_size(self) -> int:
        """How many numbers the monitors of one record are."""
        return sum(map(math.prod, self.monitor_shapes.values()))


class LaneArrays(NamedTuple):
    """The output of the machine code, with a last axis of SIMD lanes everywhere."""

    state: np.ndarray
    records: np.ndarray
    monitors: np.ndarray
    extrema: np.ndarray
    status: np.ndarray


_kernels: OrderedDict[tuple, Kernel] = OrderedDict()
_lock = threading.Lock()


def compile(program: Program, parameters: PyTree, state: PyTree, monitors: bool = True, width: int = 1) -> Kernel:
    """The kernel for a program at the shapes of `parameters` and `state` and the zeros and ones of `parameters`.

    Raises Untraceable, naming the primitive, if the program is outside the tracer's language.
    """
    (shape_p, values), (shape_s, _) = pack(parameters), pack(state)
    return kernel_for(program, parameters, state, Variant(shape_p, shape_s, specialised(values), monitors, width))


def kernel_for(program: Program, parameters: PyTree, state: PyTree, variant: Variant) -> Kernel:
    """The kernel of a variant, made at its first use; one of loops over links observes nothing (`run.observed`)."""
    key = program, variant
    with _lock:
        known = _kernels.get(key)
        if known is not None:
            _kernels.move_to_end(key)
            return known
    made = _made(program, parameters, state, variant)
    with _lock:
        _kernels[key] = made
        while len(_kernels) > KEPT:
            _kernels.popitem(last=False)
    return made


def _made(program: Program, parameters: PyTree, state: PyTree, variant: Variant) -> Kernel:
    stage = linked(program, state) if variant.width == 1 and not variant.course else None
    if stage is not None:
        try:
            if variant.monitors:  # `run.observed` does so, from the records of all substeps
                return kernel_for(program, parameters, state, _of_substeps(program, variant))
            return _kept(program, parameters, state, variant, stage)
        except NotLinked:
            if not written(program):
                raise
    return _kept(program, parameters, state, variant, None)


def _of_substeps(program: Program, variant: Variant) -> Variant:
    """That of loops over links whose records are observed."""
    return variant._replace(monitors=False, substeps=len(program.substeps) > 1)


def _kept(program: Program, parameters: PyTree, state: PyTree, variant: Variant, stage: LinkedStage | None) -> Kernel:
    """The kernel from the disk cache, or planned and stored there."""
    shape, (_, _, *given) = variant.state if stage is None else _links_layout(program, variant), variant
    name = plans.name(program, parameters, state, "kernel", *given, *(() if stage is None else ("links",)))
    found = disk_cache.find(name)
    if found is not None and "unlike" in found:
        raise NotLinked(found["unlike"])
    code = None if found is None else kept_machine(found["code"])
    if found is not None and code is not None:
        monitored = {one: tuple(shape) for one, shape in found["monitors"]}
        more = found["course"], found.get("workspace", 0)
        return _kernel(code, shape, monitored, tuple(found["certificates"]), *more)
    phase("Compiling a step.")
    if stage is None:
        planned = plan(program, parameters, state, variant.pattern, variant.monitors)
        made = load(planned.with_course() if variant.course else planned, variant.width)
    else:
        try:
            made = _load_links(program, stage, parameters, state, variant)
        except NotLinked as reason:
            disk_cache.keep(name, {"unlike": reason.reason})
            raise
    if made.record == shape:
        shapes, names = list(made.monitor_shapes.items()), list(made.certificates)
        kept = {"code": made.machine.name, "monitors": shapes, "certificates": names, "course": made.course}
        disk_cache.keep(name, kept | {"workspace": made.workspace})
    return made


def written(program: Program) -> bool:
    """Whether native code can write out the equations of all stages."""
    return all(stage.structure.native for stage in program.stages)


def linked(program: Program, state: PyTree) -> LinkedStage | None:
    """The stage that loops over links may run; None for a system without, or with too few of them to gain by it."""
    stage = program.linked(state)
    return stage if stage is not None and (stage.structure.looped or not written(program)) else None


def loops(program: Program, parameters: PyTree, state: PyTree) -> bool:
    """Whether the kernel of a single run loops over links, and leaves observing to `run.observed`."""
    return linked(program, state) is not None and compile(program, parameters, state).looped


def _load_links(program: Program, stage: LinkedStage, parameters: PyTree, state: PyTree, variant: Variant) -> Kernel:
    """The kernel of loops over links; raises NotLinked where these are not all alike."""
    planned = plan_links(stage, parameters, state, variant.pattern)
    require_links(planned, stage, parameters, state)
    code = machine(link_loops.assemble(planned, lanes(), program.substeps, variant.substeps))
    return _kernel(code, _links_layout(program, variant), {}, (), 0, link_loops.workspace(planned))


def _links_layout(program: Program, variant: Variant) -> Layout:
    """The layout of a record of loops over links."""
    parts = len(program.substeps) if variant.substeps else 1
    return variant.state if parts == 1 else layout(np.zeros(parts * variant.state.size))


def load(planned: StepPlan, width: int) -> Kernel:
    """The kernel of a plan; `record` is a layout of the plan's record, or a row of numbers if that was replaced."""
    code, names = machine(assemble(planned, width)), tuple(planned.certificates)
    return _kernel(code, _record_layout(planned), planned.monitor_shapes, names, planned.course)


def _kernel(
    code: Machine,
    record: Layout,
    monitors: dict[str, tuple[int, ...]],
    certificates: tuple[str, ...],
    course: int,
    workspace: int = 0,
) -> Kernel:
    function = code.function(NAME, *_SIGNATURE, *[ctypes.c_void_p] * (workspace > 0))
    called = _with_workspace(function, workspace) if workspace else function
    return Kernel(code, called, record, monitors, certificates, PieceLength(), course, workspace)


def _with_workspace(function: Callable[..., None], size: int) -> Callable[..., None]:
    """A function that each call gives so many numbers to work with."""

    def call(*arguments: Any) -> None:
        room = np.empty(size)
        function(*arguments, room.ctypes.data)

    return call


def _record_layout(planned: StepPlan) -> Layout:
    shaped = layout(planned.record_tree)
    return shaped if shaped.size == len(planned.record) else layout(np.zeros(len(planned.record)))


def run(
    program: Program, parameters: PyTree, state: PyTree, h: Scalar, records: int, save_every: int,
    monitors: bool = True, *, substeps: bool = False, pattern: tuple[int, ...] | None = None,
) -> Chunk:  # fmt: skip
    """records·save_every steps of `program` from `state`, keeping every save_every-th record.

    substeps: as in `Variant`; then records are rows. pattern: that of `specialised`, by default of these parameters.
    Raises Untraceable, naming the primitive, if the program is outside the tracer's language.
    """
    (shape_p, p), (shape_s, s) = pack(parameters), pack(state)
    variant = Variant(shape_p, shape_s, specialised(p) if pattern is None else pattern, monitors, 1)
    kernel = kernel_for(program, parameters, state, _of_substeps(program, variant) if substeps else variant)
    try:
        result = launch(kernel, p[:, None], np.array([float(h)]), s[:, None], records, save_every)
    except Cut as cut:
        raise Cut(chunk(kernel, cut.result, shape_s, records, save_every)) from None
    found = chunk(kernel, result, shape_s, records, save_every)
    return replace(found, records=result.records[: found.steps, :, 0]) if substeps else found


def chunk(kernel: Kernel, result: PyTree, state: Layout, records: int, save_every: int) -> Chunk:
    """A single run that the machine wrote."""
    steps, code, iterations, iterations_max = result.status[:, 0].tolist()
    valid = min(-(-steps // save_every), records)
    return Chunk(
        records=kernel.record.views(result.records[:valid, :, 0]),
        final=state.unpack(result.state[:, 0]),
        steps=steps,
        code=Code(code),
        iterations=iterations,
        iterations_max=iterations_max,
        monitors=named_monitors(kernel, result.monitors[:valid, :, 0]),
        extrema=named_extrema(kernel, result.extrema[:, :, 0]),
    )


def launch(
    kernel: Kernel,
    p: np.ndarray,
    h: np.ndarray,
    s: np.ndarray,
    records: int,
    save_every: int,
    rows: np.ndarray | None = None,
) -> LaneArrays:
    """Call the machine on parameters (size, lanes), h (lanes,) and state (size, lanes), in pieces of about 0.1 s.

    rows: where the records go, (records, size, lanes), by default to new memory.

    Raises Cut with the steps that were done where Python is interrupted meanwhile.
    """
    lanes, seen = h.shape[0], kernel.monitor_size
    extrema = np.empty((seen + len(kernel.certificates), 2, lanes))
    if len(extrema):
        extrema[:, 0], extrema[:, 1] = np.inf, -np.inf
    result = LaneArrays(
        np.array(s, np.float64, order="C"),
        np.empty((records, kernel.record.size, lanes)) if rows is None else rows,
        np.empty((records, seen, lanes)),
        extrema,
        np.zeros((4, lanes), np.int64),
    )
    inputs = np.ascontiguousarray(p, np.float64), np.ascontiguousarray(h, np.float64)
    if records * save_every <= kernel.pace.steps:
        _call(kernel, inputs, result, records, save_every)
        return result
    done, clock = 0, Clock(kernel.pace)
    try:
        while done < records * save_every and not np.all(result.status[1]):
            steps, ahead = _piece(kernel, inputs, result, done, save_every)
            # The steps before an interrupt are taken over completely or not at all.
            result, done = ahead, done + steps
            clock.lap(steps)
    except KeyboardInterrupt:
        raise Cut(result) from None
    return result


def _piece(kernel: Kernel, inputs: tuple, result: LaneArrays, done: int, save_every: int) -> tuple[int, LaneArrays]:
    """Some steps after those that are done: whole blocks of save_every, or a part of one; how many, and the result."""
    row, phase = divmod(done, save_every)
    wished, room = kernel.pace.steps, len(result.records) - row
    blocks, length = min(wished // save_every, room), save_every
    if phase or not blocks:
        blocks, length = 1, min(wished, save_every - phase)
    here = slice(row, row + blocks)
    kept = (np.empty((1, *a.shape[1:])) if phase else a[here] for a in (result.records, result.monitors))
    records, monitors = kept
    part = LaneArrays(result.state.copy(), records, monitors, result.extrema, np.zeros_like(result.status))
    _call(kernel, inputs, part, blocks, length)
    before, now = result.status, part.status
    # A lane that has failed tries its bad step again at each piece, and fails again.
    code, most = np.where(before[1] == 0, now[1], before[1]), np.maximum(before[3], now[3])
    status = np.stack([before[0] + now[0], code, before[2] + now[2], most])
    return blocks * length, result._replace(state=part.state, status=status)


def _call(kernel: Kernel, inputs: tuple, result: LaneArrays, records: int, save_every: int) -> None:
    p, h, s, rows, seen, extrema, status = map(_address, (*inputs, *result))
    kernel.function(p, h, s, records, save_every, rows, seen, extrema, status)


def _address(array: np.ndarray) -> int:
    """The address of contiguous numbers, at a fifth of the cost of `array.ctypes.data`."""
    if not array.size or not array.flags.writeable:
        return array.ctypes.data
    return ctypes.addressof(ctypes.c_char.from_buffer(array.data))


def named_monitors(kernel: Kernel, rows: np.ndarray) -> dict[str, np.ndarray]:
    """Monitors by their names from rows (*lead, size), as views."""
    found, start = {}, 0
    for name, shape in kernel.monitor_shapes.items():
        end = start + math.prod(shape)
        found[name] = rows[..., start:end].reshape((*rows.shape[:-1], *shape))
        start = end
    return found


def named_extrema(kernel: Kernel, extrema: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """(minimum, maximum) over the steps by names, from (watched, 2, *lanes)."""
    found, start = {}, 0
    shapes = {**kernel.monitor_shapes, **dict.fromkeys(kernel.certificates, ())}
    for name, shape in shapes.items():
        end = start + math.prod(shape)
        low, high = (extrema[start:end, side].reshape((*shape, *extrema.shape[2:])) for side in (0, 1))
        found[name] = low.copy(), high.copy()
        start = end
    return found
