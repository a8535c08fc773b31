"""The motion within a step, and between saved nodes, by parts of the method's own steps."""

from __future__ import annotations

from dataclasses import replace

import jax
import numpy as np

from coadjoint import checks
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError, StepError
from coadjoint.kernels.chunk import Chunk
from coadjoint.kernels.run import backend as kernels
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.internal_state import later_in, part_of
from coadjoint.mechanics.state import State
from coadjoint.methods.program import EVENTS
from coadjoint.methods.renewal import ALL_HELD
from coadjoint.simulation.plan import Plan


def not_finite(plan: Plan, state: State) -> str | None:
    """The message that names an event without a finite value at a state; None if all values are finite."""
    for name, event in plan.events:
        if not np.isfinite(evaluate(event.function, state)):
            return f"the function `{name}` is not finite there: give one that is, wherever the motion goes."
    return None


def part_of_step(plan: Plan, state: State, fraction: float, monitors: bool = False) -> Chunk:
    """A step of fraction·h from a state, by the method itself.

    The internal state follows its course over the full step.
    """
    watches = monitors and plan.watches
    if fraction != 1.0 and state.internal_due is not None:
        if np.any(state.internal_due):
            whole = kernels.run(plan.backend, plan.program, plan.constants, state, plan.h, 1, 1, watches)
            if whole.code:
                return whole
            state = taking_course(state, jax.tree.map(lambda leaf: leaf[0], whole.records)).replace(internal_due=0.0)
        state = part_of(state, fraction)
    return kernels.run(plan.backend, plan.program, plan.constants, state, fraction * plan.h, 1, 1, watches)


def sound(chunk: Chunk) -> Chunk:
    """The chunk itself; raises StepError if its step failed."""
    if chunk.code:
        what = chunk.code.name.lower().replace("_", " ")
        raise StepError(f"A step to a time between two nodes failed ({what}): take a smaller dt.")
    return chunk


def as_held(plan: Plan) -> Plan:
    """The plan of steps that take the inputs in the state: a record holds those of its step, and its velocities."""
    inputs = plan.program.skeleton.inputs
    return plan if inputs is None or not inputs.holds else holding(plan)


def holding(plan: Plan) -> Plan:
    """The plan of steps that take inputs and internal state as they are, by the same program."""
    held = None if plan.constants.renewal is None else ALL_HELD
    return replace(plan, constants=replace(plan.constants, renewal=held))


def taking_course(state: State, of: State) -> State:
    """The state with the internal state of another one, at t and over the step from there."""
    return state.with_course(of.internal, of.internal_mean, of.internal_end, state.internal_due)


class DenseStep:
    """The records within a step from a record: Φ_{θh}, with the unknowns of the full step that starts there.

    They come from the method's own step of length θh: momenta are as exact as at the nodes, the state is on the group,
    and all values are continuous with both nodes. Inputs are held over the step; an internal state follows its course.
    Raises StepError if such a step cannot be solved.
    """

    def __init__(self, plan: Plan, record: State):
        self.record, self.held = record, as_held(plan)
        self.opening = plan if plan.program.skeleton.internal is None else holding(plan)

    def __call__(self, fraction: float) -> tuple[State, np.ndarray]:
        """The record after a part of the step, and the values of all events at it."""
        state = self.record
        if fraction:
            state = sound(part_of_step(self.held, state, fraction, monitors=True)).final
            state = taking_course(state, later_in(self.record, fraction))
        chunk = sound(part_of_step(self.opening if fraction else self.held, state, 1.0, monitors=True))
        return jax.tree.map(lambda leaf: leaf[0], chunk.records), chunk.monitors[EVENTS][0]


SLACK = 1e-9
"""The part of a step that is round-off of the time."""


def at_times(plan: Plan, records: State, times: object) -> State:
    """Records at `times` (k,) of a run, by steps of the method itself from the saved node before each.

    From a node the steps of the run are repeated, followed by one step of the remaining part: Φ_{θh} ∘ Φ_h ∘ … ∘ Φ_h.
    Thus the state is on the group, its momenta are as exact as at the nodes, and the order is that of the method.
    Raises ArgumentError for times outside the run, and for a method that chooses its own step sizes.
    """
    if any(stage.tolerant for stage in plan.program.stages):
        raise ArgumentError("A method that chooses its own step sizes has no dense output: save every step instead.")
    wanted = np.atleast_1d(float64(times, "Argument `times`"))
    nodes, forward = np.asarray(records.t), 1.0 if plan.h > 0 else -1.0
    slack = SLACK * abs(plan.h)
    inside = (forward * (wanted - nodes[0]) >= -slack) & (forward * (wanted - nodes[-1]) <= slack)
    checks.expect(
        wanted.ndim == 1 and wanted.size and np.all(inside),
        times,
        "times",
        f"one time, or a row of times, between {nodes[0]:g} and {nodes[-1]:g} s, the first and the last that the run "
        "saved",
    )
    before = np.clip(np.searchsorted(forward * nodes, forward * wanted, side="right") - 1, 0, len(nodes) - 1)
    rows = [_record(plan, _row(records, i), t) for i, t in zip(before, wanted, strict=True)]
    return jax.tree.map(lambda *leaves: np.stack(leaves), *rows)


def _row(records: State, index: int) -> State:
    return jax.tree.map(lambda leaf: np.asarray(leaf)[index], records)


def _record(plan: Plan, record: State, time: float) -> State:
    """The record at a time, from the record of a node before it."""
    steps = (time - float(record.t)) / plan.h
    if steps < SLACK:
        return record
    first = min(steps, 1.0) if abs(steps - 1.0) > SLACK else 1.0
    state = sound(part_of_step(as_held(plan), record, first)).final
    whole = max(int(np.floor(steps + SLACK)) - 1, 0)
    if whole:
        state = sound(kernels.run(plan.backend, plan.program, plan.constants, state, plan.h, 1, whole, False)).final
    if (rest := (time - float(state.t)) / plan.h) > SLACK:
        state = sound(part_of_step(plan, state, rest)).final
    between = abs(steps - round(steps)) > SLACK
    # Between nodes an internal state follows the course of the step: its rule is not applied there.
    opening = holding(plan) if between and plan.program.skeleton.internal is not None else plan
    return _row(sound(part_of_step(opening, state, 1.0)).records, 0)
