"""Figures that packages above add to `run.plot`, each declared by who owns what it draws."""

from __future__ import annotations

from dataclasses import dataclass

from coadjoint.extensions import Registry


@dataclass(frozen=True)
class Added:
    """A figure of `run.plot` by a function of its owner.

    draw: "module:function", (runs, **options) → Figure; of a `film`, (runs, path, **options) → the path written.
    fits: "module:function", a dataset → whether it has what is drawn. doc: what it shows, for help. rank: its place in
    a report, the smallest first; the library's own have 10 and more. caption: what it shows, for readers of a report,
    by default `doc`.
    """

    draw: str
    fits: str
    doc: str
    film: bool = False
    rank: int = 5
    caption: str = ""


ADDED: Registry[Added] = Registry("FIGURES")
"""By the names that `run.plot` has them under."""
