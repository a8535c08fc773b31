"""Single steps of a program from many states, of any size, by the machine code that a run has compiled already."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import numpy as np

from coadjoint.kernels import packing
from coadjoint.kernels.emit.plan import specialised
from coadjoint.kernels.lanes import in_lanes, of_lanes
from coadjoint.kernels.newton.coupled import Factors
from coadjoint.kernels.packing import Layout, pack
from coadjoint.kernels.program import Program
from coadjoint.kernels.run import ensemble, native, xla
from coadjoint.kernels.run.backend import Backend
from coadjoint.kernels.run.native import Kernel


class Probed(NamedTuple):
    """The results of steps, a row of numbers a state; `record` is of the first step, `code` 0 where all went well."""

    after: np.ndarray
    record: np.ndarray
    code: np.ndarray


class Probe:
    """Steps of `program` from rows of packed states (rows, size); `layout` packs and unpacks them.

    parameters: those of the run; of `count` members with `axes`, as in `run_ensemble`, and `members` (rows,) gives the
    member whose parameters a row has. state: of one member. Nothing is compiled beyond the code of the run.
    """

    def __init__(
        self, backend: Backend, program: Program, parameters: Any, state: Any, monitors: bool, axes: Any = None,
        count: int = 1,
    ):  # fmt: skip
        self.backend, self.program, self.monitors = backend, program, monitors
        self.parameters, self.axes, self.count = parameters, axes, count
        # Factors that a step carries over are not part of records; here every row begins with none.
        self._stage = program.stages[0]
        self._carried = jax.tree.map(np.zeros_like, self._stage.carried(state))
        self._bears = isinstance(self._carried, Factors)
        self.layout: Layout = pack(self._bare(state))[0]
        if axes is None:
            self._shape, numbers = pack(parameters)
            self._p = numbers[None]
        else:
            self._shape, self._p = ensemble.members_of(parameters, axes)
        self._kernel = self._compiled(state) if backend == "native" else None

    def _bare(self, state: Any) -> Any:
        return self._stage.carry(state, None) if self._bears else state

    def _full_state(self, row: np.ndarray) -> Any:
        state = self.layout.unpack(row)
        return self._stage.carry(state, self._carried) if self._bears else state

    def _compiled(self, state: Any) -> Kernel:
        """The machine code of the run."""
        p = self._p
        if self.axes is None:
            key = (self._shape, self.layout, specialised(p[0]), self.monitors, 1)
        else:
            same = np.where(np.all(p == p[:1], axis=0), p[0], np.nan)
            key = (self._shape, self.layout, specialised(same), self.monitors, ensemble.lanes())
        return native.kernel_for(self.program, self._shape.unpack(p[0]), state, key)

    def __call__(self, rows: np.ndarray, h: np.ndarray, steps: int = 1, members: Sequence[int] | None = None) -> Probed:
        """`steps` steps of size h (rows,) from every row."""
        whose = np.zeros(len(rows), int) if members is None else np.asarray(members)
        whose = np.minimum(whose, len(self._p) - 1)
        if self._kernel is None:
            return self._xla(rows, h, steps, whose)
        after, records, status = self._native(self._kernel, rows, h, 1, steps, whose)
        return Probed(after, records[:, 0], status[:, 1])

    def records(self, rows: np.ndarray, h: float, steps: int, members: Sequence[int] | None = None) -> np.ndarray:
        """The records of `steps` steps from every row, (rows, steps, size); NaN from a step that fails on. Native."""
        if self._kernel is None:
            raise ValueError("Records of all steps are made by native code only.")
        whose = np.zeros(len(rows), int) if members is None else np.asarray(members)
        whose = np.minimum(whose, len(self._p) - 1)
        _, records, status = self._native(self._kernel, rows, np.full(len(rows), h), steps, 1, whose)
        records[np.arange(steps) >= status[:, :1]] = np.nan
        return records

    def _native(
        self, kernel: Kernel, rows: np.ndarray, h: np.ndarray, kept: int, every: int, whose: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The states after kept·every steps (rows, size), each `every`-th record (rows, kept, size), and status (rows,
        4)."""
        width = 1 if self.axes is None else ensemble.lanes()
        count = -(-len(rows) // width)
        s, step = in_lanes(rows, width), in_lanes(h[:, None], width)
        alone = len(self._p) == 1 and width == 1
        p = np.ascontiguousarray(self._p[:1].T)[None] if alone else in_lanes(self._p[whose], width)
        records = np.empty((count, kept, kernel.record.size, width))
        spare = np.zeros((kept, max(kernel.monitor_size, 1), width))
        extrema = np.zeros((kernel.monitor_size + len(kernel.certificates), 2, width))
        status = np.zeros((count, 4, width), np.int64)
        places = [(a.ctypes.data, a.strides[0] if len(a) > 1 else 0) for a in (p, step, s, records, status)]
        beside = spare.ctypes.data, extrema.ctypes.data
        for i in range(count):
            p_i, h_i, s_i, records_i, status_i = (start + i * stride for start, stride in places)
            kernel.function(p_i, h_i, s_i, kept, every, records_i, *beside, status_i)
        return of_lanes(s, len(rows)), of_lanes(records, len(rows)), of_lanes(status, len(rows))

    def _xla(self, rows: np.ndarray, h: np.ndarray, steps: int, whose: np.ndarray) -> Probed:
        """Row by row; of an ensemble many together."""
        if self.axes is not None:
            return self._xla_members(rows, h, steps, whose)
        after, records, codes = np.array(rows), np.array(rows), np.zeros(len(rows), int)
        for i, row in enumerate(rows):
            state = self._full_state(row)
            found = xla.run(self.program, self.parameters, state, float(h[i]), 1, steps, self.monitors)
            codes[i], after[i] = int(found.code), pack(self._bare(found.final))[1]
            if found.steps:
                records[i] = pack(jax.tree.map(lambda leaf: leaf[0], found.records))[1]
        return Probed(after, records, codes)

    def _xla_members(self, rows: np.ndarray, h: np.ndarray, steps: int, whose: np.ndarray) -> Probed:
        """As many rows together as the run has members, with their parameters; the last row fills up."""
        parts, order = [], []
        for size in np.unique(h):
            of_this = np.flatnonzero(h == size)
            for start in range(0, len(of_this), self.count):
                group = of_this[start : start + self.count]
                filled = np.resize(group, self.count) if len(group) < self.count else group
                found = self._xla_group(rows[filled], float(size), steps, whose[filled])
                parts.append(Probed(*(x[: len(group)] for x in found)))
                order.append(group)
        back = np.argsort(np.concatenate(order))
        return Probed(*(np.concatenate(part)[back] for part in zip(*parts, strict=True)))

    def _xla_group(self, rows: np.ndarray, h: float, steps: int, whose: np.ndarray) -> Probed:
        flags = jax.tree_util.tree_broadcast(self.axes, self.parameters)
        theirs = jax.tree.map(lambda leaf, own: np.asarray(leaf)[whose] if own else leaf, self.parameters, flags)
        states = self.layout.unpack(rows)
        found = xla.run_ensemble(self.program, theirs, states, h, 1, steps, self.monitors, axes=(self.axes, True))
        kept = jax.tree.map(lambda leaf: leaf[:, 0], found.records)
        return Probed(packing.rows(found.final), packing.rows(kept), np.asarray(found.code))
