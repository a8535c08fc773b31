"""Steps of a system from rows of numbers: machine code in lanes, XLA where it cannot be compiled."""

from __future__ import annotations

import math
from typing import Any

import jax
import numpy as np

from coadjoint.kernels.emit.plan import specialised
from coadjoint.kernels.lanes import in_lanes, of_lanes
from coadjoint.kernels.packing import flattened, pack
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import native, xla
from coadjoint.kernels.run.backend import fall_back
from coadjoint.kernels.run.ensemble import lanes
from coadjoint.kernels.untraceable import Untraceable
from coadjoint.mechanics.state import State
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.simulation.steppers.beginning import shapes_of


class ModelSteps:
    """(rows, h) ↦ the states after a step of h, with parameters in the rows after the state.

    places: their places among the constants; further entries have no effect.
    """

    def __init__(self, program: StepProgram, constants: Constants, begun: State, places: np.ndarray):
        self._program, self._constants, self._begun, self._places = program, constants, begun, places
        (self._shape_p, self.parameters), (self._shape_s, s) = pack(constants), pack(begun)
        self._size = len(s)
        self._pattern = tuple(2 if i in set(places) else kind for i, kind in enumerate(specialised(self.parameters)))
        starts, start = {}, 0
        for name, shape in shapes_of(begun).items():
            starts[name] = range(start, start + math.prod(shape))
            start += math.prod(shape)
        self.of_unknowns = np.array([*starts.get("xi", ()), *starts.get("nu", ())], int)
        self._kernels: dict[int, native.Kernel] = {}
        self._by_xla: Any = None
        try:
            self.native: native.Kernel | None = self._kernel(1)
        except Untraceable as reason:
            fall_back(reason, "auto")
            self.native, self._by_xla = None, self._compiled()

    def unknowns(self, after: np.ndarray) -> np.ndarray:
        """z of the step that led to rows, (members, unknowns)."""
        return after[:, self.of_unknowns]

    def __call__(self, rows: np.ndarray, h: float) -> tuple[np.ndarray, str]:
        """The states after the step, (members, size of a state), and a description of a failure, or ""."""
        if self._by_xla is not None:
            return self._run_by_xla(rows, h)
        width = 1 if len(rows) == 1 else lanes()
        table = in_lanes(rows, width)
        state, groups = np.ascontiguousarray(table[:, : self._size]), len(table)
        p = np.repeat(self.parameters[:, None], width, axis=1)
        length, status = np.full(width, float(h)), np.zeros((groups, 4, width), np.int64)
        kernel, nothing = self._kernel(width), np.zeros(1)
        records = np.empty((kernel.record.size, width))
        given = [a.ctypes.data for a in (p, length, records, nothing)]
        here, status_at = state.ctypes.data, status.ctypes.data
        for i in range(groups):
            if len(self._places):
                p[self._places] = table[i, self._size : self._size + len(self._places)]
            kernel.function(
                given[0], given[1], here + i * state.strides[0], 1, 1, given[2], given[3], given[3],
                status_at + i * status.strides[0],
            )  # fmt: skip
        worst = int(np.max(status[:, 1]))
        return of_lanes(state, len(rows)), Code(worst).name.lower().replace("_", " ") if worst else ""

    def _kernel(self, width: int) -> native.Kernel:
        if width not in self._kernels:
            key = (self._shape_p, self._shape_s, self._pattern, False, width)
            self._kernels[width] = native.kernel_for(self._program, self._constants, self._begun, key)
        return self._kernels[width]

    def _compiled(self) -> Any:
        @jax.jit
        @jax.vmap
        def step(p, s, h):
            result = xla.step(self._program, self._shape_p.views(p), self._shape_s.views(s), h, False)
            return flattened(result.after), result.code

        return step

    def _run_by_xla(self, rows: np.ndarray, h: float) -> tuple[np.ndarray, str]:
        p = np.repeat(self.parameters[None], len(rows), axis=0)
        p[:, self._places] = rows[:, self._size : self._size + len(self._places)]
        with jax.enable_x64(True):
            after, code = self._by_xla(p, rows[:, : self._size], np.full(len(rows), float(h)))
        worst = int(np.max(np.asarray(code)))
        return np.array(after), Code(worst).name.lower().replace("_", " ") if worst else ""
