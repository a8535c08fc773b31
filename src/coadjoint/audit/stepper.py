"""The steps of a method on a system, one kernel for every step size, and the motion that they approach."""

from __future__ import annotations

from functools import lru_cache

import jax
import numpy as np

from coadjoint.arrays import Scalar
from coadjoint.audit.systems import AuditSystem
from coadjoint.errors import StepError
from coadjoint.kernels.chunk import Chunk
from coadjoint.kernels.run import backend as kernels
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.identity import version
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods import Galerkin, LeftRight, Method, Suzuki4
from coadjoint.methods.program import Constants, StepProgram

REFERENCE_STEP = 0.01
"""Of the reference, in s: its own error is then at round-off, and finer steps would only add to that."""

REFERENCE_TOLERANCE = 1e-12
"""Of the motions that problems give themselves."""


class AuditStepper:
    """A method on a system, from a start; raises StepError at a step that fails."""

    def __init__(self, method: Method, system: System, start: State):
        self.method, self.system, self.start = method, system, start
        self.program = StepProgram(replace_parameters(system, None), method, version=version(system, start))
        self.constants = Constants(system.parameters, None)

    def begin(self, h: float) -> State:
        """The start with the momenta and the memory that the method begins with."""
        return self.method.begin(self.system, self.start, h)

    def run(self, state: State, h: Scalar, records: int, every: int = 1) -> Chunk:
        """records·every steps, each every-th of them recorded."""
        backend = kernels.choose(self.program, self.constants, state, False, "auto")
        chunk = kernels.run(backend, self.program, self.constants, state, h, records, every, monitors=False)
        if chunk.code:
            what = chunk.code.name.lower().replace("_", " ")
            raise StepError(f"step {chunk.steps} of {h:.3g} s failed: {what}")
        return chunk

    def end(self, h: float, steps: int) -> State:
        """The state after `steps` steps from the start."""
        return self.run(self.begin(h), h, 1, steps).final


def coordinates(state: State) -> np.ndarray:
    """g, n, a, μ, π as one array, (size,); all are of order one in the systems of the audit."""
    parts = [*jax.tree.leaves(state.g), state.n, state.a, state.mu, state.pi]
    return np.concatenate([np.ravel(part) for part in parts])


def distance(one: State, other: State) -> float:
    """|one − other| relative to |other|, Euclidean."""
    return float(np.linalg.norm(coordinates(one) - coordinates(other)) / np.linalg.norm(coordinates(other)))


@lru_cache(maxsize=64)
def exact(problem: AuditSystem, time: float) -> State:
    """The motion at a time, by steps of REFERENCE_STEP of a method of high order, or the problem's own."""
    return problem.exact(time) if problem.exact is not None else _fine(problem, time, REFERENCE_STEP)


@lru_cache(maxsize=64)
def uncertainty(problem: AuditSystem) -> float:
    """How far `exact` may be off: its distance from the same with other steps; of a problem's own, its tolerance."""
    if problem.exact is not None:
        return REFERENCE_TOLERANCE
    time = float(problem.start.t) + problem.duration
    return distance(_fine(problem, time, 0.7 * REFERENCE_STEP), exact(problem, time))


def _fine(problem: AuditSystem, time: float, h: float) -> State:
    """By Galerkin's method of order 6, or by a composition of order 4 with steps a tenth as long."""
    stepper = _reference(problem)
    span = time - float(problem.start.t)
    steps = int(np.ceil(span / (h if stepper.method.order == 6 else h / 10)))
    return stepper.end(span / steps, steps)


@lru_cache(maxsize=64)
def _reference(problem: AuditSystem) -> AuditStepper:
    """Galerkin's, save on a curved Q and on SE(3), where its kernel takes long to make."""
    small = problem.system.additional.flat and problem.system.group.dim <= 3
    return AuditStepper(Galerkin(degree=3) if small else Suzuki4(LeftRight()), problem.system, problem.start)
