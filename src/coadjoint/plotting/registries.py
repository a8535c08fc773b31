"""Registries of figures and scenes that packages above add to, by name: nothing is imported before it is used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from coadjoint.extensions import Registry, import_string

if TYPE_CHECKING:
    from coadjoint.labelled import AnyDataset


@dataclass(frozen=True)
class AddedFigure:
    """A figure of `run.plot` by a function of its owner.

    draw: "module:function", (runs, **options) → Figure; of a `film`, (runs, path, **options) → the path written.
    fits: "module:function", a dataset → whether it has the variables of the figure. doc: its description, for help.
    rank: its place in a report, the smallest first; the library's own have 10 and more. caption: its description for
    readers of a report, by default `doc`.
    """

    draw: str
    fits: str
    doc: str
    film: bool = False
    rank: int = 5
    caption: str = ""


ADDED: Registry[AddedFigure] = Registry("FIGURES")
"""By the names that `run.plot` has them under."""


@dataclass(frozen=True)
class AddedScene:
    """A scene by a function of its owner.

    make: "module:function", (runs, hull) → a Scene, with another shape of the hull where one is given.
    fits: "module:function", a dataset → whether it has the variables of the scene. down: whether the third axis points
    down there. stage: "module:function", runs → the figure of a film, which stands still, and what is drawn over it: a
    list of objects with `draw(t)`; without it the film of any system.
    """

    make: str
    fits: str
    down: bool = False
    stage: str = ""


SCENES: Registry[AddedScene] = Registry("SCENES")
"""Scenes by their subject."""


def points_down(dataset: AnyDataset) -> bool:
    """Whether the third axis of space is known to point down in a dataset, as in those of vehicles."""
    return any(staged.down and import_string(staged.fits)(dataset) for staged in SCENES.values())
