"""What rooms above add to the scenes: declared by names, so that nothing is imported before it is used."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from coadjoint.extensions import Registry, import_string


@dataclass(frozen=True)
class Staged:
    """A scene by a function of its owner.

    make: "module:function", (runs, hull) → a Scene, with another shape of the hull where one is given.
    fits: "module:function", a dataset → whether it has what is shown. down: whether the third axis points down there.
    """

    make: str
    fits: str
    down: bool = False


SCENES: Registry[Staged] = Registry("SCENES")
"""By what they show."""


def points_down(dataset: Any) -> bool:
    """Whether the third axis of space is known to point down in a dataset, as in those of vehicles."""
    return any(staged.down and import_string(staged.fits)(dataset) for staged in SCENES.values())
