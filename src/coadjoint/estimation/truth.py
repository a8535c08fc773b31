"""The true motion beside a filter: the states that a run, or rows of states, have at its nodes."""

from __future__ import annotations

from typing import Any

import numpy as np

from coadjoint.errors import ArgumentError, shown
from coadjoint.estimation.timetable import SAME
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.simulation.run import Run


def states_at(truth: Any, times: np.ndarray, system: System) -> State | None:
    """The states of `truth`, a run of `co.simulate` or states with an axis of nodes, at `times`, (K,) s; None where it
    is neither.

    Raises ArgumentError where they are not of the places of `system`, or not of these times.
    """
    if isinstance(truth, Run):
        begin, end = truth.records.t[[0, -1]]
        if times[0] < begin - SAME or times[-1] > end + SAME:
            raise ArgumentError(
                f"Argument `truth` is a run from {begin:g} s to {end:g} s, but the filter has nodes from "
                f"{times[0]:g} s to {times[-1]:g} s: end both alike."
            )
        truth = truth.at(times)
    if not isinstance(truth, State):
        return None
    if truth.places != system.places or np.shape(truth.t) != np.shape(times):
        raise ArgumentError(
            f"Argument `truth` must be {len(times)} states of the system of the filter, one for each node, but is "
            f"{shown(truth)}."
        )
    if not np.max(np.abs(truth.t - times)) < SAME:
        raise ArgumentError("Argument `truth` has states of other times than the nodes: give the run itself.")
    return truth
