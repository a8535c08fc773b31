"""Inputs of a run: what drives the system, checked, with what is held over its first step."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from coadjoint.errors import ArgumentError, shown
from coadjoint.kernels.trace.evaluate import evaluate, traced
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.members import Each, member_of
from coadjoint.mechanics.signals import Held, Linear, Signal
from coadjoint.mechanics.start import with_own_momenta
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.trace_checks import in_words, require_float64


def with_inputs(system: System, start: State, inputs: Any, by_velocities: bool = False) -> tuple[System, State]:
    """The system driven by `inputs`, and the start with what is held over its first step.

    Its momenta stay those that it shows, with its own inputs, whatever drives the run; `by_velocities` ξ₀, ν₀ stay.
    Of an ensemble what is held is that of its first member: every member takes its own when it starts.
    Raises ArgumentError and LagrangianError for what cannot be an input.
    """
    if isinstance(inputs, Each):
        raise ArgumentError("Argument `inputs` must be the same for all members: let it depend on their parameters.")
    own, system = system, system.driven(inputs)
    if system.inputs is None:
        return system, start
    if not (system.forces or system.internal or system.quantities or system.takes("inputs")):
        raise ArgumentError(
            "Nothing takes these inputs: this system has no forces and no rule, and its functions do not take `inputs`."
        )
    for source in system.inputs.sources:
        if isinstance(source, Signal):
            _check_signal(source, start)
    if not by_velocities:
        start = with_own_momenta(own, start)
    many = np.ndim(start.t) > 0
    first = jax.tree.map(lambda leaf: leaf[0], start) if many else start
    held = held_at(replace_parameters(system, member_of(system.parameters, 0)), first) if system.inputs.holds else None
    if many:
        held = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (len(start.t), *np.shape(leaf))), held)
    return system, start.replace(inputs=held)


def held_at(system: System, state: State) -> Any:
    """What is held over the step that starts at a state."""

    def first(state):
        return inputs_held(system, state)

    require_float64(first, "The function `inputs`", (state,))
    with in_words("The function `inputs`"):
        found = evaluate(first, state)
        return found if traced(found) else jax.tree.map(lambda leaf: np.asarray(leaf, dtype=float), found)


def inputs_held(system: System, s: State) -> Any:
    """The held inputs as a function of the state, for tracing."""
    assert system.inputs is not None
    return system.inputs.held(system.motion_at(s), s.inputs)


def _check_signal(source: Signal, start: State) -> None:
    """Raise unless a signal is finite and float64 at the start."""
    if traced(getattr(source, "values", None), getattr(source, "times", None)):
        raise ArgumentError(
            "Argument `inputs` cannot hold numbers that are being differentiated or mapped: make them parameters, and "
            "use co.Linear(times, p.values) inside the forces."
        )
    if isinstance(source, (Held, Linear)) and all(np.all(np.isfinite(x)) for x in (source.times, source.values)):
        return
    t = np.float64(0.0) if traced(start.t) else np.ravel(start.t)[0]
    require_float64(getattr(source, "function", source), "The signal", (t,))
    with in_words("The signal"):
        value = evaluate(source, t)
    if not np.all(np.isfinite(value)):
        raise ArgumentError(f"A signal must be finite at the start, t = {t:g} s, but is {shown(value)}.")
