"""A standard manoeuvre in figures: one function for all of them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from coadjoint.arrays import PyTree
from coadjoint_vehicles.trials import merits
from coadjoint_vehicles.trials.merits import Merit
from coadjoint_vehicles.trials.track import Track

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from coadjoint.plotting.entries import Entry

RESPONSE = ("K", "T")


@dataclass(frozen=True, eq=False)
class TrialResult:
    """The figures of merit of a manoeuvre by name, `result["advance"]`; print it for the table."""

    track: Track
    merits: dict[str, Merit]

    def __getitem__(self, name: str) -> float:
        return self.merits[name].value

    @property
    def rows(self) -> list[tuple[str, str, str, str, str]]:
        """The table: figure, value, unit, the same in lengths of the vehicle or with L/U, meaning."""
        return [
            (name.replace("_", " "), f"{one.value:.4g}", one.unit, self._without_unit(name, one), one.meaning)
            for name, one in self.merits.items()
        ]

    @property
    def values(self) -> dict[str, float]:
        """The values by name."""
        return {name: one.value for name, one in self.merits.items()}

    @property
    def line(self) -> str:
        """The manoeuvre and its figures in a line."""
        said = [
            f"{name} {value} {unit if unit != '1' else ''}".rstrip() + (f" ({short})" if short else "")
            for name, value, unit, short, _ in self.rows
        ]
        return f"{self.track.manoeuvre.replace('_', ' ')}: {', '.join(said)}."

    def _without_unit(self, name: str, one: Merit) -> str:
        """A distance in lengths L; K L/U and T U/L with the speed U at the first execute."""
        length, speed = self.track.length, float(self.track.speed[self.track.first])
        if length is None:
            return ""
        if one.unit == "m":
            return f"{one.value / length:.3g} L"
        if name in RESPONSE and speed > 0:
            factor = length / speed if name == "K" else speed / length
            return f"{one.value * factor:.3g} {'U/L' if name == 'K' else 'L/U'}"
        return ""

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure:
        """The track, the course of the manoeuvre and the table on a page; written to `path` in its format."""
        from coadjoint.plotting.style import save, style
        from coadjoint_vehicles.trials.page import page

        with style():
            figure = page(self.track, self.merits, self.rows)
        if path is not None:
            save(figure, path)
        return figure

    def __str__(self) -> str:
        rows = [("figure", "value", "unit", "", ""), *self.rows]
        widths = [max(len(row[i]) for row in rows) for i in range(4)]
        title = f"{self.track.manoeuvre.replace('_', ' ').capitalize()}\n"
        return title + "\n".join(
            "  ".join([*(text.ljust(width) for text, width in zip(row, widths, strict=False)), row[4]]).rstrip()
            for row in rows
        )


def analyse(recorded: PyTree) -> TrialResult:
    """The figures of merit of a standard manoeuvre: a run or dataset of a mission with `trial`, or a `Track`.

    Turning circle: advance, transfer, tactical diameter, steady radius. Zigzag: overshoots, initial turning, period.
    Spiral: rates by order and their loop. Stop: track reach, head reach, stopping time. Pull-out: residual rate. Of all
    but spiral and stop K and T of Nomoto. What a track is too short for is left out. Positions are over ground: a
    current shifts them. Raises ArgumentError for other runs.
    Source: IMO resolution MSC.137(76) (2002), section 4; ITTC 7.5-04-02-01.
    """
    track = recorded if isinstance(recorded, Track) else Track.of(getattr(recorded, "dataset", recorded))
    return TrialResult(track, getattr(merits, track.manoeuvre)(track))


def trial(runs: Sequence[Entry]) -> Figure:
    """The page of a run of a mission with the controller `trial`, or of several of them together."""
    from coadjoint_vehicles.trials.page import TrialCurve, page_of_several

    found = [analyse(run.dataset) for run in runs]
    if len(found) == 1:
        return found[0].plot()
    return page_of_several(
        [TrialCurve(run.label, one.track, one.merits, run.look) for run, one in zip(runs, found, strict=True)]
    )
