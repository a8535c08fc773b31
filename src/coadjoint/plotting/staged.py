"""Which scene a dataset has: of who owns what it shows, such as a vehicle, or else of its bodies alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from coadjoint.errors import ArgumentError
from coadjoint.extensions import Registry, located
from coadjoint.plotting.entries import Entry
from coadjoint.plotting.scene import Scene

MOST = 20
"""The most members in a scene."""


@dataclass(frozen=True)
class Staged:
    """A scene by a function of its owner.

    make: "module:function", the runs → a Scene. fits: "module:function", a dataset → whether it has what is shown.
    """

    make: str
    fits: str


SCENES: Registry[Staged] = Registry("SCENES")
"""By what they show."""


def scene(runs: Sequence[Entry]) -> Scene:
    """The scene of runs, of the first `MOST` of them; raises ArgumentError where nothing of them moves in space."""
    shown = list(runs[:MOST])
    for run in shown:
        if len(run.time) < 2:
            raise ArgumentError(f"The run of {run.label} has one saved node, so there is nothing to animate.")
    for staged in SCENES.values():
        if all(located(staged.fits)(run.dataset) for run in shown):
            return located(staged.make)(shown)
    raise ArgumentError("not yet")
