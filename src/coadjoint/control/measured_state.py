"""Measured states as numbers of a transcription's first node."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.control.functions import of_columns
from coadjoint.control.linearised import Tables
from coadjoint.control.stage import FiniteGraph, numbers_of
from coadjoint.control.transcription import Transcription
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.tracer import Tracer
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.state import State
from coadjoint.simulation.arguments import require_places

GIVEN = ("t", "g", "n", "a", "xi", "nu", "mu", "pi", "internal")
"""The parts of a measured state from which a step begins."""

SHAPES = "Argument `{}` has other shapes than the states of the problem's system."


class MeasuredState:
    """x of a state, (nx,): its numbers on which the steps, costs and constraints depend."""

    def __init__(self, transcription: Transcription, name: str = "state"):
        self._transcription, self._beginning, self._name = transcription, transcription.beginning, name
        self._begin: Any = None
        self._parameters: object = None
        self._column = np.zeros(0)
        begun = transcription.beginning.state
        self._size = transcription.graph.numbers(begun).shape
        self._structure = jax.tree_util.tree_structure(begun.internal)

    def __call__(self, state: PyTree, parameters: PyTree, velocities: bool) -> np.ndarray:
        """x; velocities: whether the momenta are those of the model, whose parameters are given, for ξ and ν.

        Raises ArgumentError unless it is a state of this system, and for numbers that are not finite.
        """
        self._require(state)
        if state.from_velocities or velocities:
            found = self._with_momenta(state, parameters)
        else:
            found = self._transcription.graph.numbers(state)
        if found.shape != self._size:
            raise ArgumentError(SHAPES.format(self._name))
        x = found[self._transcription.live]
        if not np.all(np.isfinite(x)):
            raise ArgumentError(f"Argument `{self._name}` must have finite numbers.")
        return x

    def _require(self, state: State) -> None:
        system, name = self._transcription.problem.system, self._name
        checks.instance(state, name, State, "a co.State of the problem's system")
        require_places(state, system.places, name)
        if np.ndim(state.t):
            each = "each its own controller" if name == "state" else "them to `solve_each`"
            raise ArgumentError(f"Argument `{name}` must be of one member, but has many: give {each}.")
        if jax.tree_util.tree_structure(state.internal) != self._structure:
            raise ArgumentError(
                f"Argument `{name}` has another internal state than the problem's system: its actuators, controller or "
                "water differ."
            )

    def _with_momenta(self, state: State, parameters: PyTree) -> np.ndarray:
        """The numbers of the state as the method starts it from ξ and ν, with the model's momenta for them."""
        if self._begin is None:
            begun = self._beginning.state
            given = {part: getattr(begun, part) for part in GIVEN}
            self._begin, self._given_size = Tables(self._begun(parameters, given), 1), numbers_of(given).size
        if parameters is not self._parameters:
            self._parameters, self._column = parameters, numbers_of(parameters)
        column = numbers_of({part: getattr(state, part) for part in GIVEN})
        if column.size != self._given_size:
            raise ArgumentError(SHAPES.format(self._name))
        return self._begin(self._column, column)[0].ravel()

    def _begun(self, parameters: PyTree, given: dict[str, object]) -> Any:
        """(numbers of the parameters, given numbers of a state) → numbers of the state that begins a step."""
        system, method, h, begun = self._beginning
        plain = dict.fromkeys(("internal_mean", "internal_end", "internal_due"), None)
        template = begun.replace(memory=None, ledger=None, from_velocities=True, **plain)

        def begin(parameters: PyTree, given: dict[str, object]) -> list[PyTree]:
            there = method.begin(replace_parameters(system, parameters), template.replace(**given), h)
            return [jnp.ravel(jnp.asarray(leaf)) for leaf in self._transcription.graph.leaves(there)]

        trees = {"p": parameters, "given": given}
        return of_columns(Tracer(FiniteGraph()), "The momenta of a state", begin, trees)
