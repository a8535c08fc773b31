"""Steps between saved records: where the motion changes most from one record to the next, it is run again."""

from __future__ import annotations

from typing import Any

import numpy as np

from coadjoint.kernels.run.probe import Probe
from coadjoint.mechanics.state import State
from coadjoint.simulation.accuracy.sample import CHANGING, Kept
from coadjoint.simulation.plan import Plan

SHARE = 0.05
"""How many of a run's steps are run again at most, as a share of them."""


def with_steps_between(kept: Kept, largest: list[int], plan: Plan, state: State, members: Any = None) -> Kept:
    """The kept records, and from the stretches that start at the steps `largest` those after which a step changes most.

    state: one, for its layout. members: of an ensemble, those that were kept. By XLA, where
    each length of a stretch would be compiled, and where every step is saved, the kept records alone.
    """
    left = int(SHARE * plan.steps)
    if plan.save_every == 1 or plan.backend != "native" or min(left, len(largest)) < 1:
        return kept
    probe = Probe("native", plan.program, plan.constants, state, plan.watches, plan.axes, plan.members or 1)
    places: Any = probe.layout.unpack(np.arange(probe.layout.size))
    found = dict(zip(kept.steps.tolist(), kept.rows, strict=True))
    for step in largest:
        length = min(plan.save_every, plan.steps - step, left)
        if length < 2:
            continue
        left -= length
        rows = found[step]
        records = probe.records(np.atleast_2d(rows), plan.h, length, members)
        change = np.nan_to_num(np.abs(np.diff(records, axis=1)).max(axis=0))
        for field in CHANGING:
            numbers = np.ravel(getattr(places, field))
            if numbers.size:
                place = int(change[:, numbers].max(axis=1).argmax())
                found[step + place] = records[:, place].reshape(rows.shape)
    steps = np.array(sorted(found))
    return Kept(steps, np.stack([found[step] for step in steps.tolist()]))
