"""A step of a method on a system as a function of rows of numbers, with its equations and its derivatives."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from itertools import repeat
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.groups.group import Array
from coadjoint.kernels import packing
from coadjoint.kernels.emit.plan import plan, specialised
from coadjoint.kernels.emit.stepping import assemble
from coadjoint.kernels.lanes import in_lanes, of_lanes
from coadjoint.kernels.newton.coupled import Factors
from coadjoint.kernels.packing import Layout, flattened, pack
from coadjoint.kernels.run import ensemble, native, xla
from coadjoint.kernels.run.backend import Backend, fall_back
from coadjoint.kernels.run.function import RowFunction
from coadjoint.kernels.untraceable import Untraceable
from coadjoint.mechanics.state import State
from coadjoint.methods.program import Constants, StepProgram


class StepsTaken(NamedTuple):
    """The results of steps from rows.

    after, record: the states after the steps, and the records of the first ones, (rows, size). code: how they ended,
    (rows,), 0 where all went well. course: of the first steps, for each substep z and the state after it, (rows,
    substeps, m + size); (rows, 0) of a model without.
    """

    after: np.ndarray
    record: np.ndarray
    code: np.ndarray
    course: np.ndarray


class StepModel:
    """A method on a system as a function of rows of numbers, x⁺ = Φ(x, p, h).

    A row x holds the numbers of a state end to end, and p those of the constants. Each substep, of which there is one
    but in compositions, solves r(x, z, p, h) = 0 for the unknowns z of its stages, and x⁺ = A(x, z, p, h). By the
    implicit function theorem

        ∂x⁺/∂x = ∂A/∂x − ∂A/∂z (∂r/∂z)⁻¹ ∂r/∂x,

    and the derivative of a step is the product of those of its substeps.

    Arguments:
        program, constants, state: the step, its constants, and a state that the method has begun, of one member.
        backend: "native" (where no code is compiled beyond that of a run with the same `monitors` and `axes`), "xla",
            or "auto", native where the step can be traced.
        monitors: whether the steps observe, as those of a run do.
        axes, count: where the constants have members, as in `run_ensemble`, and how many there are.
        course: whether steps return z and the states between substeps.
        free: the places of numbers of p that are not compiled in as 0 or 1.
    """

    def __init__(
        self, program: StepProgram, constants: Constants, state: State, *, backend: Backend = "auto",
        monitors: bool = False, axes: PyTree = None, count: int = 1, course: bool = False, free: Sequence[int] = (),
    ):  # fmt: skip
        self.program, self.constants, self.monitors, self.axes, self.count = program, constants, monitors, axes, count
        # Factors that a step carries over are not part of records; here every row begins with none.
        self._stage = program.stages[0]
        self._carried = jax.tree.map(np.zeros_like, self._stage.carried(state))
        self._bears = isinstance(self._carried, Factors)
        self.layout: Layout = pack(self._bare(state))[0]
        if axes is None:
            self._shape, numbers = pack(constants)
            self.p = numbers[None]
        else:
            self._shape, self.p = ensemble.members_of(constants, axes)
        self._begun, self._course, self._free = state, course, frozenset(int(place) for place in free)
        self._kernels: dict[int, native.Kernel] = {}
        self.backend: Backend = backend
        if backend != "xla":
            self._compile(backend)

    def _compile(self, backend: Backend) -> None:
        """Have the machine code that a single row needs, or fall back to XLA."""
        try:
            self.kernel(1 if self._alone else ensemble.lanes())
            self.backend = "native"
        except Untraceable as reason:
            fall_back(reason, backend)
            self.backend = "xla"

    @property
    def _alone(self) -> bool:
        """Whether machine code takes the steps of a single row at a time: of a run, and of loops over links."""
        return self.axes is None or not native.written(self.program)

    # States and rows.

    def _bare(self, state: State) -> State:
        return self._stage.carry(state, None) if self._bears else state

    def _full_state(self, row: np.ndarray) -> State:
        state = self.layout.unpack(row)
        return self._stage.carry(state, self._carried) if self._bears else state

    def pack(self, states: State) -> np.ndarray:
        """States with a first axis as rows (rows, size)."""
        return packing.rows(self._bare(states))

    def unpack(self, rows: np.ndarray) -> State:
        """The states of rows (…, size)."""
        return self.layout.unpack(rows)

    # Steps.

    def kernel(self, width: int) -> native.Kernel:
        """The machine code for lanes of that width; raises Untraceable where the step cannot be traced."""
        if width not in self._kernels:
            variant = native.Variant(self._shape, self.layout, self._kinds(), self.monitors, width, self._course)
            constants = self._shape.unpack(self.p[0])
            self._kernels[width] = native.kernel_for(self.program, constants, self._begun, variant)
        return self._kernels[width]

    def _kinds(self) -> tuple[int, ...]:
        """Which constants are compiled in, as `specialised` says it."""
        same = self.p[0] if self.axes is None else np.where(np.all(self.p == self.p[:1], axis=0), self.p[0], np.nan)
        return tuple(2 if place in self._free else kind for place, kind in enumerate(specialised(same)))

    def assembly(self) -> str:
        """The LLVM assembly of the kernel of one lane, traced now: kernels keep their machine code alone."""
        planned = plan(self.program, self._shape.unpack(self.p[0]), self._begun, self._kinds(), self.monitors)
        return assemble(planned.with_course() if self._course else planned)

    def step(
        self, rows: np.ndarray, h: np.ndarray, steps: int = 1, members: Sequence[int] | None = None,
        p: np.ndarray | None = None,
    ) -> StepsTaken:  # fmt: skip
        """`steps` steps of size h (rows,) from every row.

        members: (rows,), of which member the constants of each row are. p: those of each row, (rows, numbers), in
        place of them.
        """
        if p is not None and self.axes is not None:
            raise ValueError("Rows of a model with members have the constants of their members.")
        if self.backend == "xla":
            return self._by_xla(rows, h, steps, members, p)
        after, records, status = self._native(rows, h, 1, steps, self._own(rows, members) if p is None else p)
        record, course = np.split(records[:, 0], [self.size], axis=1)
        parts = len(self.program.substeps) if self._course else 1
        return StepsTaken(after, record, status[:, 1], course.reshape(len(rows), parts, -1) if self._course else course)

    def __call__(
        self, rows: np.ndarray, h: np.ndarray, steps: int = 1, members: Sequence[int] | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """`after`, `record` and `code` of steps."""
        return self.step(rows, h, steps, members)[:3]

    def records(self, rows: np.ndarray, h: float, steps: int, members: Sequence[int] | None = None) -> np.ndarray:
        """The records of `steps` steps from every row, (rows, steps, size); NaN from a step that fails on. Native."""
        if self.backend == "xla":
            raise ValueError("Records of all steps are made by native code only.")
        _, records, status = self._native(rows, np.full(len(rows), h), steps, 1, self._own(rows, members))
        records[np.arange(steps) >= status[:, :1]] = np.nan
        return records

    def _whose(self, rows: np.ndarray, members: Sequence[int] | None) -> np.ndarray:
        """The member of every row, 0 where the constants have none."""
        return np.minimum(np.zeros(len(rows), int) if members is None else np.asarray(members), len(self.p) - 1)

    def _own(self, rows: np.ndarray, members: Sequence[int] | None) -> np.ndarray:
        """The constants of every row, (rows, numbers), or (1, numbers) where all have the same."""
        return self.p if len(self.p) == 1 else self.p[self._whose(rows, members)]

    def _native(
        self, rows: np.ndarray, h: np.ndarray, kept: int, every: int, p: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The states after kept·every steps (rows, size), each `every`-th record with its unknowns (rows, kept, …), and
        status (rows, 4)."""
        alone = self._alone and (not self._course or len(rows) == 1)
        width = 1 if alone else ensemble.lanes()
        kernel, count = self.kernel(width), -(-len(rows) // width)
        s, step = in_lanes(rows, width), in_lanes(h[:, None], width)
        given = np.ascontiguousarray(p.T)[None] if len(p) == 1 and width == 1 else in_lanes(p, width, count)
        records = np.empty((count, kept, kernel.row, width))
        spare = np.zeros((kept, max(kernel.monitor_size, 1), width))
        extrema = np.zeros((kernel.monitor_size + len(kernel.certificates), 2, width))
        status = np.zeros((count, 4, width), np.int64)
        p_i, h_i, s_i, records_i, status_i = (_addresses(a, count) for a in (given, step, s, records, status))
        ignored = spare.ctypes.data, extrema.ctypes.data
        for p_at, h_at, s_at, records_at, status_at in zip(p_i, h_i, s_i, records_i, status_i, strict=True):
            kernel.function(p_at, h_at, s_at, kept, every, records_at, *ignored, status_at)
        found = of_lanes(records, len(rows))
        # Loops over links that are observed record all substeps, the first one first.
        found = found[..., : self.size] if kernel.looped else found
        return of_lanes(s, len(rows)), found, of_lanes(status, len(rows))

    def _by_xla(
        self, rows: np.ndarray, h: np.ndarray, steps: int, members: Sequence[int] | None, p: np.ndarray | None
    ) -> StepsTaken:
        if self._course:
            return self._by_xla_with_course(rows, h, steps, self._own(rows, members) if p is None else p)
        if self.axes is not None:
            return self._by_xla_of_members(rows, h, steps, self._whose(rows, members))
        after, records, codes = np.array(rows), np.array(rows), np.zeros(len(rows), int)
        for i, row in enumerate(rows):
            # The constants as they are: a run has compiled its loop for their types.
            constants = self.constants if p is None else self._shape.unpack(p[i])
            found = xla.run(self.program, constants, self._full_state(row), float(h[i]), 1, steps, self.monitors)
            codes[i], after[i] = int(found.code), pack(self._bare(found.final))[1]
            if found.steps:
                records[i] = pack(jax.tree.map(lambda leaf: leaf[0], found.records))[1]
        return StepsTaken(after, records, codes, np.zeros((len(rows), 0)))

    def _by_xla_of_members(self, rows: np.ndarray, h: np.ndarray, steps: int, whose: np.ndarray) -> StepsTaken:
        """As many rows together as a run has members, with their constants; the last row fills up."""
        parts, order = [], []
        for size in np.unique(h):
            of_this = np.flatnonzero(h == size)
            for start in range(0, len(of_this), self.count):
                group = of_this[start : start + self.count]
                filled = np.resize(group, self.count) if len(group) < self.count else group
                found = self._by_xla_of_group(rows[filled], float(size), steps, whose[filled])
                parts.append(StepsTaken(*(x[: len(group)] for x in found)))
                order.append(group)
        back = np.argsort(np.concatenate(order))
        return StepsTaken(*(np.concatenate(part)[back] for part in zip(*parts, strict=True)))

    def _by_xla_of_group(self, rows: np.ndarray, h: float, steps: int, whose: np.ndarray) -> StepsTaken:
        flags = jax.tree_util.tree_broadcast(self.axes, self.constants)
        theirs = jax.tree.map(lambda leaf, own: np.asarray(leaf)[whose] if own else leaf, self.constants, flags)
        states, axes = self.layout.unpack(rows), (self.axes, True)
        found = xla.run_ensemble(self.program, theirs, states, h, 1, steps, self.monitors, axes=axes)
        kept = jax.tree.map(lambda leaf: leaf[:, 0], found.records)
        after, records = packing.rows(found.final), packing.rows(kept)
        return StepsTaken(after, records, np.asarray(found.code), np.zeros((len(rows), 0)))

    def _by_xla_with_course(self, rows: np.ndarray, h: np.ndarray, steps: int, p: np.ndarray) -> StepsTaken:
        p, after, code = np.broadcast_to(p, (len(rows), p.shape[1])), rows, np.zeros(len(rows), int)
        first: list[np.ndarray] = []
        with jax.enable_x64(True):
            for _ in range(steps):
                after, *taken, now = map(np.array, self._step_with_course(p, after, np.asarray(h, float)))
                first, code = first or taken, np.where(code, code, now)
        return StepsTaken(after, first[0], code, first[1])

    @cached_property
    def _step_with_course(self) -> Callable[..., tuple[Array, ...]]:
        def row(state: State) -> Array:
            return flattened(self._bare(state))

        @jax.jit
        @jax.vmap
        def step(p: Array, x: Array, h: Array) -> tuple[Array, ...]:
            state = self.layout.views(x)
            state = self._stage.carry(state, self._carried) if self._bears else state
            result = xla.step(self.program, self._shape.views(p), state, h, False)
            unknowns, states = result.course
            course = jnp.concatenate([unknowns, jax.vmap(row)(states)], axis=1)
            return row(result.after), flattened(result.record), course, result.code

        return step

    # Derivatives.

    @property
    def size(self) -> int:
        """How many numbers a state has."""
        return self.layout.size

    def tangent(self, rows: np.ndarray, h: np.ndarray) -> np.ndarray:
        """∂x⁺/∂x of the steps of h (rows,) from every row, (rows, size, size).

        Of a model with `course` and without members; the ledger and the remainder of t are left out.
        """
        m, course = self.program.unknowns, self.step(rows, h).course
        p, slopes, begin = np.repeat(self.p, len(rows), axis=0), np.eye(self.size), rows
        for number, part in enumerate(self.program.substeps):
            z, first = course[:, number, :m], np.full(len(rows), float(number == 0))
            given = np.column_stack([p, part * h, h, first])
            _, J = self._substep(np.concatenate([z, begin], axis=1), given)
            slopes, begin = implicit_slopes(J, m) @ slopes, course[:, number, m:]
        return slopes

    def substep_assembly(self) -> str | None:
        """The LLVM assembly of (z, x), (p, length, h, first) ↦ (r, x⁺) with its slopes, None where XLA has them."""
        return None if self._substep.native is None else self._substep.native.assembly()

    @cached_property
    def _substep(self) -> RowFunction:
        """(z, x), (p, length, h, first) ↦ (r, x⁺) of a substep."""
        m, count = self.program.unknowns, self.p.shape[1]

        def equations(x: Array, y: Array) -> Array:
            constants, state, (length, h, first) = self._shape.views(y[:count]), self.layout.views(x[m:]), y[count:]
            prepared = self.program.prepare_if(constants, state, h, first)
            residual, after = self.program.substep(constants, prepared, length, x[:m])
            return jnp.concatenate([residual, flattened(after)])

        first = np.concatenate([np.zeros(m), pack(self._bare(self._begun))[1]])
        return RowFunction(equations, first, np.concatenate([self.p[0], np.ones(3)]))


def _addresses(array: np.ndarray, count: int) -> Iterable[int]:
    """Where each of `count` groups of an array begins; the first one for all, if there is no other, or no number."""
    begin = array.ctypes.data
    if len(array) == 1 or not array.size:
        return repeat(begin, count)
    return range(begin, begin + array.nbytes, array.strides[0])


def implicit_slopes(J: np.ndarray, m: int) -> np.ndarray:
    """∂y/∂x of y(z, x) with r(z, x) = 0, from the Jacobian J of (r, y) by (z, x), (rows, …, …), with m unknowns z."""
    return J[:, m:, m:] - J[:, m:, :m] @ np.linalg.solve(J[:, :m, :m], J[:, :m, m:])
