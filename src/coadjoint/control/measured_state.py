"""Measured states as numbers of a transcription's first node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from coadjoint.control.transcription import Transcription
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.state import State


class MeasuredState:
    """x of a state, (nx,): what of its numbers the steps, costs and constraints depend on."""

    def __init__(self, transcription: Transcription):
        self._transcription, self._beginning = transcription, transcription.beginning
        self._begin: Callable[..., Any] | None = None
        begun = transcription.beginning.state
        self._size = transcription.graph.numbers(begun).shape
        self._structure = jax.tree_util.tree_structure(begun.internal)

    def __call__(self, state: Any, parameters: Any, velocities: bool) -> np.ndarray:
        """x; velocities: whether the momenta are those of the model, whose parameters are given, for ξ and ν.

        Raises ArgumentError for what is no state of this system, and for numbers that are not finite.
        """
        self._require(state)
        if state.from_velocities or velocities:
            state = self._with_momenta(state.replace(from_velocities=True), parameters)
        found = self._transcription.graph.numbers(state)
        if found.shape != self._size:
            raise ArgumentError("Argument `state` has other shapes than the states of the problem's system.")
        x = found[self._transcription.live]
        if not np.all(np.isfinite(x)):
            raise ArgumentError("Argument `state` must have finite numbers.")
        return x

    def _require(self, state: Any) -> None:
        system = self._transcription.problem.system
        if not isinstance(state, State):
            raise ArgumentError(
                f"Argument `state` must be a co.State of the problem's system, but is {type(state).__name__}."
            )
        if state.places != system.places:
            raise ArgumentError("Argument `state` belongs to a system with another group or other spaces.")
        if np.ndim(state.t):
            raise ArgumentError("Argument `state` must be of one member, but has many: give each its own controller.")
        if jax.tree_util.tree_structure(state.internal) != self._structure:
            raise ArgumentError(
                "Argument `state` has another internal state than the problem's system: its actuators, controller or "
                "water differ."
            )

    def _with_momenta(self, state: State, parameters: Any) -> State:
        system, method, h, begun = self._beginning
        plain = dict.fromkeys(("internal_mean", "internal_end", "internal_due"), None)
        state = state.replace(inputs=begun.inputs, memory=None, ledger=None, **plain)
        if self._begin is None:

            def begin(parameters: Any, state: State) -> State:
                return method.begin(replace_parameters(system, parameters), state, h)

            self._begin = tabulate(begin, parameters, state)
        return self._begin(parameters, state)
