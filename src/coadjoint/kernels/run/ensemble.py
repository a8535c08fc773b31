"""Runs many members of one program together: a trajectory in each SIMD lane, groups of lanes on threads."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Event

import jax
import numpy as np

from coadjoint.arrays import PyTree, Scalar
from coadjoint.kernels.chunk import EnsembleChunk
from coadjoint.kernels.emit.plan import specialised
from coadjoint.kernels.lanes import in_lanes, of_lanes
from coadjoint.kernels.packing import Layout, pack
from coadjoint.kernels.program import Program
from coadjoint.kernels.run import native
from coadjoint.kernels.run.machine import lanes
from coadjoint.kernels.run.native import Kernel, LaneArrays, Variant

_MOST: ContextVar[int | None] = ContextVar("most cores", default=None)


@contextmanager
def at_most(threads: int) -> Iterator[None]:
    """Inside this context ensembles run on at most so many threads; no result depends on it."""
    token = _MOST.set(threads)
    try:
        yield
    finally:
        _MOST.reset(token)


def cores() -> int:
    """The number of cores that this process may use, or the limit of `at_most`."""
    return min(_available(), _MOST.get() or _available())


def _available() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_ensemble(
    program: Program,
    parameters: PyTree,
    state: PyTree,
    h: Scalar,
    records: int,
    save_every: int,
    monitors: bool = True,
    *,
    axes: tuple[PyTree, PyTree],
    threads: int | None = None,
) -> EnsembleChunk:
    """records·save_every steps of every member, keeping every save_every-th record.

    `axes` = (of parameters, of state): PyTrees of bools, or prefixes of such, True where a leaf has a leading axis of
    members. `h` is a number or one for each member. `threads` is by default the number of usable cores.
    Raises Untraceable, naming the primitive, if the program is outside the tracer's language; ValueError if the
    members cannot be counted.
    """
    kernel, shape_s, p, s = _kernel_for(program, parameters, state, monitors, axes)
    steps = np.asarray(h, np.float64).reshape(-1)
    count = _count(len(p), len(s), len(steps))
    width = lanes()
    inputs = tuple(in_lanes(x, width, -(-count // width)) for x in (p, steps[:, None], s))
    result = _empty(kernel, inputs[2], records)
    _launch(kernel, inputs, result, records, save_every, threads or cores())
    return _gathered(kernel, shape_s, result, count, save_every)


def compile(program: Program, parameters: PyTree, state: PyTree, monitors: bool, axes: tuple[PyTree, PyTree]) -> Kernel:
    """The kernel with which `run_ensemble` runs these members; raises the same errors."""
    return _kernel_for(program, parameters, state, monitors, axes)[0]


def _kernel_for(
    program: Program, parameters: PyTree, state: PyTree, monitors: bool, axes: tuple[PyTree, PyTree]
) -> tuple[Kernel, Layout, np.ndarray, np.ndarray]:
    """The kernel, the layout of a state, and the numbers of parameters and states as `members_of` gives them."""
    shape_p, p = members_of(parameters, axes[0])
    shape_s, s = members_of(state, axes[1])
    pattern = specialised(np.where(np.all(p == p[:1], axis=0), p[0], np.nan))
    variant = Variant(shape_p, shape_s, pattern, monitors, lanes())
    return native.kernel_for(program, shape_p.unpack(p[0]), shape_s.unpack(s[0]), variant), shape_s, p, s


def _empty(kernel: Kernel, state: np.ndarray, records: int) -> LaneArrays:
    """Arrays for the output of the machine code, with a first axis of groups and a last one of lanes."""
    groups, _, lanes = state.shape
    watched = kernel.monitor_size + len(kernel.certificates)
    limits = np.array([np.inf, -np.inf])[None, None, :, None]
    return LaneArrays(
        state=state,
        records=np.empty((groups, records, kernel.record.size, lanes)),
        monitors=np.empty((groups, records, kernel.monitor_size, lanes)),
        extrema=np.tile(limits, (groups, watched, 1, lanes)),
        status=np.zeros((groups, 4, lanes), np.int64),
    )


def _launch(kernel: Kernel, inputs: tuple, result: LaneArrays, records: int, save_every: int, threads: int) -> None:
    """Run all groups, a share of them at a time on each thread; the machine releases the interpreter's lock."""
    before = [(array.ctypes.data, array.strides[0]) for array in inputs]
    outputs = (result.records, result.monitors, result.extrema, result.status)
    after = [(array.ctypes.data, array.strides[0]) for array in outputs]
    groups = len(result.status)
    share, stop = max(1, groups // (4 * threads)), Event()

    def run(first: int) -> None:
        for group in range(first, min(first + share, groups)):
            if stop.is_set():
                return
            pointers = [start + group * stride for start, stride in before]
            written = [start + group * stride for start, stride in after]
            kernel.function(*pointers, records, save_every, *written)

    with ThreadPoolExecutor(threads) as pool:
        try:
            list(pool.map(run, range(0, groups, share)))
        finally:
            # After an interrupt, threads end with the group that they are at.
            stop.set()


def members_of(tree: PyTree, axes: PyTree) -> tuple[Layout, np.ndarray]:
    """The layout of one member, and the numbers of all: (members, size), or (1, size) where all share them."""
    flags = jax.tree_util.tree_leaves(jax.tree_util.tree_broadcast(axes, tree))
    leaves, structure = jax.tree_util.tree_flatten(tree)
    counts = {np.shape(leaf)[0] for leaf, flag in zip(leaves, flags, strict=True) if flag}
    if len(counts) > 1:
        raise ValueError(f"The leading axes must all count the same members, but have lengths {sorted(counts)}.")
    count = counts.pop() if counts else 1
    spread = [
        np.asarray(leaf) if flag else np.broadcast_to(leaf, (count, *np.shape(leaf)))
        for leaf, flag in zip(leaves, flags, strict=True)
    ]
    pack(spread)  # raises for leaves other than real numbers
    rows = [np.asarray(leaf, np.float64).reshape(count, -1) for leaf in spread]
    layout = Layout(structure, tuple(leaf.shape[1:] for leaf in spread))
    return layout, np.concatenate(rows, axis=1) if rows else np.zeros((count, 0))


def _count(*lengths: int) -> int:
    """The number of members from the lengths of arrays that hold one row or one for each."""
    count = max(lengths)
    if any(length not in (1, count) for length in lengths):
        raise ValueError(f"Parameters, state and h must have the same members, but count {sorted(set(lengths))}.")
    return count


def _gathered(kernel: Kernel, state: Layout, result: LaneArrays, count: int, save_every: int) -> EnsembleChunk:
    """Lanes of all groups as members."""
    state_rows, records, monitors, limits, status = (of_lanes(array, count) for array in result)
    steps, code, iterations, iterations_max = status.T.copy()
    rows = np.minimum(-(-steps // save_every), records.shape[1])
    absent = np.arange(records.shape[1]) >= rows[:, None]
    records[absent] = monitors[absent] = np.nan
    extrema = native.named_extrema(kernel, np.moveaxis(limits, 0, -1))
    return EnsembleChunk(
        records=kernel.record.unpack(records),
        final=state.unpack(state_rows),
        steps=steps,
        rows=rows,
        code=code,
        iterations=iterations,
        iterations_max=iterations_max,
        monitors=native.named_monitors(kernel, monitors),
        extrema={name: (np.moveaxis(x, -1, 0), np.moveaxis(y, -1, 0)) for name, (x, y) in extrema.items()},
    )
