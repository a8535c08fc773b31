"""The three problems: the paper's vehicle, the fast heavy top, an ellipsoid in an ideal fluid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

import coadjoint as co
from benchmarks.bodies import Body
from coadjoint.kernels.chunk import Chunk
from coadjoint.kernels.run import native
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.models import catalogue

NODES = 20
"""Where solutions are compared: at so many equal parts of the duration, and the start."""


@dataclass(frozen=True)
class Problem:
    """A system, where it starts, the same body for other programs, a coarse step and a duration, s."""

    title: str
    system: co.System
    start: co.State
    body: Body
    coarse: float
    duration: float
    place: Callable[[np.ndarray], np.ndarray]
    """What the position error is about, from rows y."""

    @property
    def times(self) -> np.ndarray:
        return np.linspace(0.0, self.duration, NODES + 1)

    @cached_property
    def y0(self) -> np.ndarray:
        s = self.start
        return np.concatenate([s.g.ravel(), s.q, s.xi, s.nu])

    def rows(self, state: co.State) -> np.ndarray:
        """Rows y of states, ω and ν from the momenta."""
        lead = np.shape(state.t)
        spaces = (state.n, state.pi) if state.n.shape[-1] else (np.zeros((*lead, 3)),) * 2
        q = np.einsum("...ij,...j->...i", state.g, spaces[0])
        omega, nu = state.mu / np.array(self.body.inertia), spaces[1] / np.array(self.body.mass)
        return np.concatenate([state.g.reshape(*lead, 9), q, omega, nu], axis=-1)

    def path(self, chunk: Chunk) -> np.ndarray:
        """Rows y at the nodes of a run that kept NODES records."""
        return np.concatenate([self.rows(chunk.records), self.rows(chunk.final)[None]])

    def errors(self, found: np.ndarray, exact: np.ndarray) -> dict[str, float]:
        """Over the nodes, the largest relative energy error, distance, m, and relative Kelvin–Noether error."""
        energy, (momentum, scale) = self.body.energy(found), self.body.momentum(found)
        distance = np.linalg.norm(self.place(found) - self.place(exact), axis=-1)
        return {
            "energy": float(np.max(np.abs(energy / energy[0] - 1))),
            "position": float(np.max(distance)),
            "momentum": float(np.max(np.abs(momentum - momentum[0])) / np.max(scale)),
        }


@dataclass(frozen=True)
class Ready:
    """A method on a problem, ready for a kernel."""

    program: StepProgram
    constants: Constants
    state: co.State
    h: float

    def run(self, records: int, save_every: int) -> Chunk:
        """Natively, monitors off."""
        return native.run(self.program, self.constants, self.state, self.h, records, save_every, monitors=False)


def ready(problem: Problem, method: co.methods.Method, h: float) -> Ready:
    """What a kernel needs to run `method` on `problem`."""
    state = method.begin(problem.system, problem.start, h)
    program = StepProgram(replace_parameters(problem.system, None), method)
    return Ready(program, Constants(problem.system.parameters, {}), state, h)


def _position(y: np.ndarray) -> np.ndarray:
    return y[..., 9:12]


@cache
def vehicle() -> Problem:
    """Tables 1 and 2 of the paper."""
    entry = catalogue["underwater_vehicle"]
    system = entry.make()
    p: Any = system.parameters
    moment = tuple(-p.buoyancy * np.asarray(p.center_of_buoyancy))
    mass = tuple(p.mass + np.diag(p.added_mass))
    body = Body(mass, tuple(np.diag(p.inertia)), float(p.mass * p.gravity - p.buoyancy), moment)
    return Problem("the paper's vehicle", system, entry.start(system), body, 0.5, 100.0, _position)


@cache
def heavy_top() -> Problem:
    """The fast heavy top of Brüls, Cardona and Arnold (2012); its mass moves with the frame only."""
    entry = catalogue["heavy_top"]
    system = entry.make()
    p: Any = system.parameters
    r = np.asarray(p.center_of_mass)
    body = Body((1.0, 1.0, 1.0), tuple(np.diag(p.inertia)), 0.0, tuple(-p.mass * p.gravity * r))
    start = entry.start(system)

    def place(y: np.ndarray) -> np.ndarray:
        return y[..., :9].reshape(*y.shape[:-1], 3, 3) @ r

    return _Top("the fast heavy top", system, start, body, 2e-3, 2.0, place)


class _Top(Problem):
    @cached_property
    def y0(self) -> np.ndarray:
        return np.concatenate([self.start.g.ravel(), np.zeros(3), self.start.xi, np.zeros(3)])


@cache
def ellipsoid() -> Problem:
    """A neutrally buoyant ellipsoid in an ideal fluid: Kirchhoff's equations."""
    entry = catalogue["kirchhoff_ellipsoid"]
    system = entry.make()
    p: Any = system.parameters
    added = np.diag(p.added_mass)
    body = Body(tuple(p.mass + added[:3]), tuple(np.diag(p.inertia) + added[3:]), 0.0, (0.0, 0.0, 0.0))
    return Problem("a body in an ideal fluid", system, entry.start(system), body, 0.2, 20.0, _position)
