"""The modes of a steady motion under the steps of a method: which of them a step size damps or excites."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from coadjoint.errors import ArgumentError, StepError
from coadjoint.kernels.run import backend as kernels
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.identity import version
from coadjoint.mechanics.state import State
from coadjoint.methods import Method, Midpoint
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.models.quantities import positive
from coadjoint.stability.spectrum import Linearisation, linearised
from coadjoint.stability.steady import SteadyMotion

DIFFERENCE = 1e-5
"""By how much x is changed for central differences; velocities and angles are of order one in x."""


@dataclass(frozen=True)
class StepModes:
    """The modes of a steady motion under the steps of a method.

    `multipliers`: eigenvalues m of the derivative of one step, a row with each λ of `eigenvalues`. `effective`:
    λ_h = log(m)/h, on the branch of λ.

    dt: h, s. eigenvalues, multipliers, effective: shape (modes,), complex, 1/s but for the multipliers.
    """

    dt: float
    eigenvalues: np.ndarray
    multipliers: np.ndarray
    effective: np.ndarray

    @property
    def excitation(self) -> float:
        """The largest Re λ_h − Re λ, 1/s: over 0 where steps excite a mode."""
        return float(np.max(np.real(self.effective - self.eigenvalues), initial=-np.inf))

    @property
    def damping(self) -> float:
        """The largest Re λ − Re λ_h, 1/s: over 0 where steps damp a mode."""
        return float(np.max(np.real(self.eigenvalues - self.effective), initial=-np.inf))


def step_modes(
    motion: SteadyMotion, dt: float, method: Method | None = None, linear: Linearisation | None = None
) -> StepModes:
    """The derivative of one step of a method at its own steady motion near the given one, and its eigenvalues.

    motion: of co.stability.steady_motion. dt: h, s. method: by default co.Midpoint(). linear: its linearisation, by
    default made here. Symplectic methods neither damp nor excite modes of conservative
    systems where they are stable: |m| = 1. Derivatives are central differences, right to about 1e-9.
    Raises ArgumentError where the steps have no steady motion near and for a motion that goes along symmetries, and
    StepError where a step fails.
    """
    h, method = float(positive(dt, "dt")), method or Midpoint()
    if motion.reduced.symmetries:
        raise ArgumentError("Modes under steps are those of motions that are steady by themselves, without symmetries.")
    linear = linear or linearised(motion)
    step = _Step(motion, method, h, linear)
    x = np.zeros(len(linear.matrix))
    for _ in range(6):
        before, after = step(x)
        slopes = _slopes(step, x)
        change = np.linalg.lstsq(slopes[1] - slopes[0], before - after, rcond=1e-7)[0]
        x = x + change
        if np.max(np.abs(change), initial=0.0) < 1e-10:
            break
    else:
        raise ArgumentError(
            f"The steps of {h:g} s have no steady motion near that of the equations: take smaller ones."
        )
    before, after = _slopes(step, x)
    found = np.linalg.eigvals(after @ np.linalg.inv(before)).astype(complex)
    expected = np.exp(linear.eigenvalues * h)
    rows, columns = linear_sum_assignment(np.abs(expected[:, None] - found[None, :]))
    eigenvalues, multipliers = linear.eigenvalues[rows].astype(complex), found[columns]
    effective = eigenvalues + np.log(multipliers / expected[rows]) / h
    return StepModes(h, eigenvalues, multipliers, effective)


class _Step:
    """x of the chart ↦ δy, in coordinates, before a step and after it."""

    def __init__(self, motion: SteadyMotion, method: Method, h: float, linear: Linearisation):
        system, reduced = motion.system, motion.reduced
        self.h, self.linear, self.y = h, linear, _phase(motion.state)
        self.program = StepProgram(replace_parameters(system, None), method, version=version(system, motion.state))
        self.constants = Constants(system.parameters, None)
        self.start = method.begin(system, motion.state, h)
        self.moved = tabulate(
            lambda z, s: reduced.with_momenta(reduced.moved(s, z)), np.zeros(len(linear.charts)), self.start
        )
        self.backend: kernels.Backend = kernels.choose(self.program, self.constants, self.start, False, "auto")

    def __call__(self, x: np.ndarray) -> np.ndarray:
        state = self.moved(self.linear.charts @ x, self.start)
        chunk = kernels.run(self.backend, self.program, self.constants, state, self.h, 1, 1, monitors=False)
        if chunk.code:
            what = chunk.code.name.lower().replace("_", " ")
            raise StepError(f"A step of {self.h:.3g} s from near the steady motion failed: {what}.")
        return np.stack([self.linear.rows @ (_phase(s) - self.y) for s in (state, chunk.final)])


def _phase(state: State) -> np.ndarray:
    return np.concatenate([state.mu, state.n, state.pi, state.a])


def _slopes(step: _Step, x: np.ndarray) -> np.ndarray:
    """The derivatives of both by x."""
    unit = DIFFERENCE * np.eye(len(x))
    return np.stack([(step(x + e) - step(x - e)) / (2 * DIFFERENCE) for e in unit], axis=2)
