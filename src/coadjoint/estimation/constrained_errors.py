"""Errors of the states of a system with constraints: those within the tangent space of the constraints."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array
from coadjoint.estimation.augmented_state import DriftingParameters
from coadjoint.estimation.invariant_errors import InvariantErrors
from coadjoint.kernels.packing import flattened
from coadjoint.kernels.run.function import RowFunction
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.projection import onto
from coadjoint.mechanics.reactions import Independent, closing, kicked
from coadjoint.mechanics.state import State
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.methods.rattle import kept
from coadjoint.simulation.unread_inputs import unread

NEWTON = 5
"""Newton's iterations that put a corrected state back onto its constraints."""


class ConstrainedErrors(InvariantErrors):
    """Invariant errors of a system that may have constraints, φ = 0 and A·(ξ, ν) = b.

    `retract` moves a row by e and then onto the constraints, so that errors that leave them count by their projection
    Πe alone, where Π is the derivative of e ↦ differ(x, retract(x, e)) at e = 0. A filter that linearises it has the
    covariance ΠPΠᵀ, whatever P is.
    """

    _begun: State
    _drifts: DriftingParameters
    _program: StepProgram
    _constants: Constants

    @property
    def constrained(self) -> bool:
        """Whether the system has constraints."""
        return bool(self._system.constraints)

    def retract(self, row: Array, e: Array) -> Array:
        moved = super().retract(row, e)
        return self._onto(moved, 1) if self.constrained else moved

    @cached_property
    def moving(self) -> RowFunction:
        """(), (x, e) ↦ retract(x, e), on the constraints to round-off."""
        if not self.constrained:
            return super().moving
        size = len(self._first)

        def moved(x: Array, y: Array) -> Array:
            return self._onto(super(ConstrainedErrors, self).retract(y[:size], y[size:]), NEWTON)

        return RowFunction(moved, np.zeros(0), np.concatenate([self._first, np.zeros(self.width)]))

    @cached_property
    def carrying(self) -> RowFunction:
        """As of `Process`, with states on the constraints to round-off: T leads into their tangent space at x⁺."""
        if not self.constrained:
            return super().carrying
        size = len(self._first)

        def carried(e: Array, y: Array) -> Array:
            return self.differ(y[size:], self._onto(super(ConstrainedErrors, self).retract(y[:size], e), NEWTON))

        return RowFunction(carried, np.zeros(self.width), np.concatenate([self._first, self._first]))

    def _onto(self, row: Array, iterations: int) -> Array:
        """The row of the state on the constraints near that of a row."""
        state, theta = self._unpacked(row)
        system = replace_parameters(self._system, self._drifts.replaced(theta).system)
        return jnp.concatenate([flattened(onto(system, state, self._independent, iterations)), theta])

    @property
    def _independent(self) -> Independent:
        memory = kept(self._begun)
        return None if memory is None else memory.independent

    @cached_property
    def projector(self) -> RowFunction | None:  # pyright: ignore[reportIncompatibleVariableOverride]
        """(e, x) ↦ differ(x, retract(x, e)) of a system with constraints."""
        if not self.constrained:
            return None
        return RowFunction(lambda e, x: self.differ(x, self.retract(x, e)), np.zeros(self.width), self._first)

    def unread(self, names: Sequence[str]) -> list[str]:
        return unread(self._program, self._constants, self._begun, names)

    @cached_property
    def shaking(self) -> RowFunction:  # pyright: ignore[reportIncompatibleVariableOverride]
        """See `Process`."""

        def shaken(w: Array, row: Array) -> Array:
            state, theta = self._unpacked(row)
            there = self.shaken(self._drifts.replaced(theta), state, w)
            return self.differ(row, jnp.concatenate([flattened(there), theta]))

        return RowFunction(shaken, np.zeros(len(self.densities)), self._first)

    def shaken(self, constants: Constants, state: State, w: Array) -> State:
        """The state after an impulse w of noise, and after that with which the constraints answer, traced."""
        d = self._system.group.dim
        state = state.replace(mu=state.mu + w[:d], pi=state.pi + w[d:])
        if not self.constrained:
            return state
        system = replace_parameters(self._system, constants.system)
        return kicked(system, state, closing(system, state, self._independent))
