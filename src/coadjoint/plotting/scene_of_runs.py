"""The scene of runs: that of the package that owns the dataset, such as vehicles, or else one of its bodies."""

from __future__ import annotations

from collections.abc import Sequence

from coadjoint.errors import ArgumentError, warn
from coadjoint.extensions import import_string
from coadjoint.plotting import bodies
from coadjoint.plotting.bodies import Solid
from coadjoint.plotting.decimation import some
from coadjoint.plotting.entries import Entry
from coadjoint.plotting.registries import SCENES
from coadjoint.plotting.scene import Scene, Shape

MOST = 20
"""The most members in a scene."""


def scene(
    runs: Sequence[Entry], solids: Sequence[Solid] | None = None, z_down: bool = False, hull: Shape | None = None
) -> Scene:
    """The scene of runs; of more than `MOST` a random choice is shown, with a warning.

    Raises ArgumentError if nothing in them moves in space.

    solids: the bodies, unless the owner of the scene knows them. z_down: whether z points down, if the datasets do not
    say. hull: the shape of a vehicle's hull, or of the first body, instead of the known one.
    """
    shown = [runs[place] for place in some(len(runs), MOST)]
    if len(shown) < len(runs):
        sentence = f"The scene shows {len(shown)} of {len(runs):,} members, chosen at random."
        warn(sentence, stacklevel=2)
    for run in shown:
        if len(run.time) < 2:
            raise ArgumentError(f"The run of {run.label} has one saved node, so there is nothing to animate.")
    if solids is not None:
        return bodies.scene(shown, solids, z_down)
    for staged in SCENES.values():
        if all(import_string(staged.fits)(run.dataset) for run in shown):
            return import_string(staged.make)(shown, hull)
    return bodies.scene(shown, None if hull is None else [Solid([hull])], z_down)
