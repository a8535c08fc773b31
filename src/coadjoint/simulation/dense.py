"""The motion between saved nodes."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.kernels.run import backend as kernels
from coadjoint.mechanics.state import State
from coadjoint.simulation.driver import Plan
from coadjoint.simulation.events import as_held, holding, part_of_step, sound
from coadjoint.spaces.numbers import float64

SLACK = 1e-9
"""The part of a step that is round-off of the time."""


def at_times(plan: Plan, records: State, times: Any) -> State:
    """Records at `times` (k,) of a run, by steps of the method itself from the saved node before each.

    From a node the run's own steps are taken again, and then one of the part that is left: Φ_{θh} ∘ Φ_h ∘ … ∘ Φ_h. So
    the state is on the group, its momenta are as exact as at the nodes, and the order is that of the method.
    Raises ArgumentError for times outside the run, and for a method that chooses its own step sizes.
    """
    if any(stage.tolerant for stage in plan.program.stages):
        raise ArgumentError("A method that chooses its own step sizes has no dense output: save every step instead.")
    wanted = np.atleast_1d(float64(times, "Argument `times`"))
    nodes, forward = np.asarray(records.t), 1.0 if plan.h > 0 else -1.0
    slack = SLACK * abs(plan.h)
    inside = (forward * (wanted - nodes[0]) >= -slack) & (forward * (wanted - nodes[-1]) <= slack)
    if wanted.ndim != 1 or not wanted.size or not np.all(inside):
        raise ArgumentError(
            f"Argument `times` must be one time, or a row of times, between {nodes[0]:g} and {nodes[-1]:g} s, the "
            f"first and the last that the run saved, but is {times!r}."
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
    # Between nodes an internal state goes on along the course of the step: its rule is not applied there.
    opening = holding(plan) if between and plan.program.skeleton.internal is not None else plan
    return _row(sound(part_of_step(opening, state, 1.0)).records, 0)
