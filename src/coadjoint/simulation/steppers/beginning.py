"""Where a stepper may stand: states that a method begins, and rows of numbers from states and back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.kernels.packing import Layout, layout
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.start import with_own_momenta
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.methods.program import Constants
from coadjoint.methods.step import in_records
from coadjoint.simulation.steppers.trees import rows_of, spread


class Beginning:
    """States of `members` (None: of a single one) that `method` begins with steps of h, as rows (members, size).

    like: a state that was begun, and constants, of one member: their layouts. by_xla: whether XLA takes the steps.
    """

    def __init__(
        self,
        skeleton: System,
        method: Method,
        h: float,
        members: int | None,
        like: State,
        constants: Constants,
        by_xla: bool = False,
    ):
        self.skeleton, self.method, self.h, self.members, self.by_xla = skeleton, method, h, members, by_xla
        self.state, self.constants, self.held = layout(like), layout(constants), like.inputs
        self._tabulated: dict[Layout, Callable[..., Any]] = {}

    def rows(self, state: Any, parameters: np.ndarray) -> np.ndarray:
        """States of all members from one, or from all, that system.state(…), a stepper or a run has given.

        Raises ArgumentError for a state of another system.
        """
        if state.places != self.skeleton.places:
            raise ArgumentError("Argument `state` belongs to a system with another group or other spaces.")
        count, many = (1 if self.members is None else self.members), np.ndim(state.t) > 0
        if many and (self.members is None or len(state.t) != count):
            raise ArgumentError(f"Argument `state` must be of {count} members, but is of {len(state.t)}.")
        whole = state if many else spread(state, (count,))
        if state.from_velocities:
            # What is held at the start is that of the stepper.
            held = None if self.held is None else spread(self.held, (count,))
            return self.begun(whole, parameters, held)
        whole = evaluate(jax.vmap(self.carrying), whole.replace(ledger=None))
        self._require_like(whole)
        return rows_of(whole, count)

    def begun(self, starts: State, parameters: np.ndarray, held: Any) -> np.ndarray:
        """The states (members, size) that the method begins at starts with an axis of members, under held inputs."""
        count = len(starts.t)
        constants = self.constants.unpack(np.broadcast_to(parameters, (count, parameters.shape[1])))

        def begin(constants: Constants, state: State, held: Any) -> State:
            system = replace_parameters(self.skeleton, constants.system)
            if self.method.start != "velocity":
                state = with_own_momenta(system.driven(None), state)
            return self.carrying(self.method.begin(system, state.replace(inputs=held), self.h))

        given = constants, starts, held
        form = layout(given)
        if form not in self._tabulated:
            self._tabulated[form] = tabulate(jax.vmap(begin), *given)
        states = self._tabulated[form](*given)
        self._require_like(states)
        return rows_of(states, count)

    def carrying(self, state: State) -> State:
        """A state with what steps by XLA carry over, or without it: runs and other steppers have it or not."""
        return self.method.begin_by_xla(self.skeleton, state) if self.by_xla else in_records(state)

    def _require_like(self, states: State) -> None:
        single = jax.tree.map(lambda leaf: leaf[0], states)
        if layout(single) != self.state:
            raise ArgumentError(
                "Argument `state` must hold what the states of this stepper hold: make it by system.state(…) with all "
                "that its start has, or take it from `stepper.state`."
            )
