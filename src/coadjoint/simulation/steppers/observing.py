"""What a stepper observes: functions of the state by their names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.internal_state import at_node
from coadjoint.mechanics.quantities import Quantities, quantities_from, value
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.trace_checks import require_float64
from coadjoint.methods.program import Constants

Observe = Mapping[str, Callable[..., Any]]


class Watch(NamedTuple):
    """(parameters, state) → what each function observes, as arrays in their order; for tracing, hashable.

    The state that functions see has the velocities of its momenta.
    """

    skeleton: System
    functions: Quantities

    def __call__(self, constants: Constants, state: State) -> tuple[Any, ...]:
        system = replace_parameters(self.skeleton, constants.system)
        node = at_node(system, state)
        return tuple(jnp.asarray(value(system, function, node), dtype=float) for _, function in self.functions)


def watch(system: System, observe: Observe | None, state: State) -> tuple[Watch, dict[str, tuple[int, ...]]]:
    """The observations of a system, with the shapes that they have; raises ArgumentError and LagrangianError."""
    if observe is not None and not isinstance(observe, Mapping):
        raise ArgumentError(
            f"Argument `observe` must be a dictionary of names and functions of the state, but is {observe!r}."
        )
    functions = quantities_from(observe)
    for name, function in functions:
        what = f"The observation `{name}`"
        require_float64(partial(value, system, function), what, (state,))
        found = evaluate(partial(value, system, function), state)
        if not isinstance(found, (np.ndarray, np.generic, float, int)):
            raise LagrangianError(f"{what} must be a number or an array, but is a {type(found).__name__}.")
        if not np.all(np.isfinite(found)):
            raise LagrangianError(f"{what} must be finite at the start, but is not: look for a division by zero.")
    made = Watch(replace_parameters(system, None), functions)
    seen = evaluate(made, Constants(system.parameters, None), state)
    return made, {name: np.shape(part) for (name, _), part in zip(functions, seen, strict=True)}
