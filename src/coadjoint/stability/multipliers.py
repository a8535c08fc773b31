"""The modes of a steady motion under the steps of a method: which of them a step size damps or excites."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import numpy as np
from scipy.optimize import linear_sum_assignment

from coadjoint.errors import ArgumentError, StepError
from coadjoint.groups.group import Array
from coadjoint.kernels.packing import flattened
from coadjoint.kernels.program import Code
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.identity import version
from coadjoint.mechanics.state import State
from coadjoint.methods import Method, Midpoint
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.methods.step_model import StepModel
from coadjoint.models.quantities import positive
from coadjoint.stability.spectrum import Linearisation, linearised
from coadjoint.stability.steady import SteadyMotion


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
    systems where they are stable: |m| = 1. Derivatives are exact to round-off.
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
        (before, after), (begins, ends) = step(x)
        change = np.linalg.lstsq(ends - begins, before - after, rcond=1e-7)[0]
        x = x + change
        if np.max(np.abs(change), initial=0.0) < 1e-10:
            break
    else:
        raise ArgumentError(
            f"The steps of {h:g} s have no steady motion near that of the equations: take smaller ones."
        )
    _, (begins, ends) = step(x)
    found = np.linalg.eigvals(ends @ np.linalg.inv(begins)).astype(complex)
    expected = np.exp(linear.eigenvalues * h)
    rows, columns = linear_sum_assignment(np.abs(expected[:, None] - found[None, :]))
    eigenvalues, multipliers = linear.eigenvalues[rows].astype(complex), found[columns]
    effective = eigenvalues + np.log(multipliers / expected[rows]) / h
    return StepModes(h, eigenvalues, multipliers, effective)


class _Step:
    """x of the chart ↦ δy, in coordinates, before a step and after it, (2, dim), and both derivatives by x."""

    def __init__(self, motion: SteadyMotion, method: Method, h: float, linear: Linearisation):
        system, reduced = motion.system, motion.reduced
        self.h, self.linear = h, linear
        program = StepProgram(replace_parameters(system, None), method, version=version(system, motion.state))
        begun = method.begin(system, motion.state, h)
        self.model = StepModel(program, Constants(system.parameters, None), begun, course=True)
        places = self.model.layout.places
        self.phase = np.concatenate([places.mu, places.n, places.pi, places.a]).astype(int)
        self.y = self.model.pack(jax.tree.map(lambda leaf: np.asarray(leaf)[None], motion.state))[0, self.phase]

        def row(x: Array, start: State) -> Array:
            return flattened(reduced.with_momenta(reduced.moved(start, linear.charts @ x)))

        given = np.zeros(len(linear.matrix)), begun
        self.row = tabulate(lambda x, start: (row(x, start), jax.jacfwd(row)(x, start)), *given)
        self.start = begun

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found, slopes = self.row(x, self.start)
        rows, h = np.asarray(found)[None], np.full(1, self.h)
        taken = self.model.step(rows, h)
        if taken.code[0]:
            what = Code(int(taken.code[0])).name.lower().replace("_", " ")
            raise StepError(f"A step of {self.h:.3g} s from near the steady motion failed: {what}.")
        ends = np.stack([slopes, self.model.tangent(rows, h)[0] @ slopes])[:, self.phase]
        values = np.concatenate([rows, taken.after])[:, self.phase] - self.y
        return values @ self.linear.rows.T, self.linear.rows @ ends
