"""What rooms above add to the scenes: declared by names, so that nothing is imported before it is used."""

from __future__ import annotations

from dataclasses import dataclass

from coadjoint.extensions import Registry


@dataclass(frozen=True)
class Staged:
    """A scene by a function of its owner.

    make: "module:function", (runs, hull) → a Scene, with another shape of the hull where one is given.
    fits: "module:function", a dataset → whether it has what is shown.
    """

    make: str
    fits: str


SCENES: Registry[Staged] = Registry("SCENES")
"""By what they show."""
