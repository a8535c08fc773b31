"""The error of a whole trajectory: a run of dt against one of dt/2."""

from __future__ import annotations

from dataclasses import replace

import jax
import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.kernels.packing import layout
from coadjoint.mechanics.state import State
from coadjoint.simulation.accuracy.metric import differences, relative, sizes_of
from coadjoint.simulation.accuracy.ruler import packed, ruler_of
from coadjoint.simulation.result import Result

HOLDS = 0.1
"""Up to which error, relative to how far the run goes, a trajectory holds."""


def require_full(many: bool, variable: bool, stored: bool, watched: bool) -> None:
    """Raise ArgumentError for runs whose nodes another run of half the step does not share."""
    for wrong, what in ((many, "an ensemble"), (variable, "a method with steps of its own"), (stored, "`store`")):
        if wrong:
            raise ArgumentError(f'accuracy="full" compares two runs in memory, so it does not go with {what}.')
    if watched:
        raise ArgumentError('accuracy="full" compares whole runs: leave out `until` and `events`.')


def with_trajectory_error(run: Result, finer: Result) -> None:
    """Put the error of the trajectory of `run` into its accuracy, by `finer`, the same run of half the step."""
    if run.accuracy is None:
        return
    errors, times = trajectory_errors(run, finer.records), np.asarray(run.records.t)
    late = np.flatnonzero(errors > HOLDS)
    holds = float(times[max(late[0] - 1, 0)]) if len(late) else None
    run.accuracy = replace(run.accuracy, trajectory=float(errors.max()), holds=holds)


def trajectory_errors(run: Result, others: State, ratio: float = 2.0) -> np.ndarray:
    """The error at every node, from the difference to records of steps h/ratio: divided by 1 − ratio^{−p}.

    Relative to how far each part of the state is from its start at most, momenta to their own size.
    """
    count = min(len(run.records.t), len(others.t))
    ours, theirs = (jax.tree.map(lambda leaf: leaf[:count], records) for records in (run.records, others))
    begun = jax.tree.map(lambda leaf: np.broadcast_to(leaf[:1], leaf.shape), ours)
    ruler = ruler_of(layout(jax.tree.map(lambda leaf: leaf[0], ours)), ours.places)
    found = differences(ruler, *(packed(states) for states in (begun, theirs, ours)))
    first = run.method.start == "velocity" or run.system.takes("internal")
    return relative(found, sizes_of(found))[0] / (1 - ratio ** -(1 if first else run.method.order))
