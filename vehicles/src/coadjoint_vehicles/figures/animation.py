"""The stage of a film of vehicles: track and depth, over which they move."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.markers import MarkerStyle
from matplotlib.transforms import Affine2D

from coadjoint.plotting.entries import Entry
from coadjoint.plotting.style import COLOURS, canvas
from coadjoint.texts import Table
from coadjoint_vehicles.figures.navigation import draw_depth, draw_track
from coadjoint_vehicles.logs.records import VehicleRecords

_MOST = 8
"""The most vehicles in a film."""


def stage(runs: Sequence[Entry]) -> tuple[Figure, list[_Vehicle]]:
    """The figure with the fixed artists, and the moving vehicles."""
    runs = runs[:_MOST]
    figure = canvas(7.2, 3.4)
    above, side = figure.subplots(1, 2)
    draw_track(above, runs)
    draw_depth(side, runs)
    side.set_xlabel("time $t$ (s)")
    for axes in (above, side):
        for line in axes.get_lines():
            line.set_alpha(0.35)
    figure.suptitle(" ", fontsize=9)  # space for the text of each frame
    return figure, [_Vehicle(figure, run, number) for number, run in enumerate(runs)]


class _Vehicle:
    """A vehicle in both panels: an arrow along its heading and along its pitch, with its path so far."""

    def __init__(self, figure: Figure, run: Entry, number: int):
        self.figure, self.log, self.time, self.number = figure, VehicleRecords(run.dataset), run.time, number
        self.panels = figure.axes[:2]
        self.label = run.label if number else ""
        look: Table = {"color": COLOURS[run.place % len(COLOURS)]}
        self.paths = [axes.add_line(Line2D([], [], animated=True, **look)) for axes in self.panels]
        self.arrows = [axes.add_line(Line2D([], [], animated=True, markersize=13, **look)) for axes in self.panels]
        self.text = figure.text(0.5, 0.985, "", ha="center", va="top", fontsize=9, animated=True)
        self.kept = run.thin(self.log.position)

    def draw(self, t: float) -> None:
        """Draw the vehicle where it is at time t; after its end where it ended."""
        log, k = self.log, int(np.clip(np.searchsorted(self.time, t), 0, len(self.time) - 1))
        so_far = np.append(self.kept[self.kept < k], k)
        north, east, depth = log.position[so_far].T
        _, pitch, heading = log.attitude[k]
        for path, x, y in zip(self.paths, (east, self.time[so_far]), (north, depth), strict=True):
            path.set_data(x, y)
        for arrow, x, y, turn in zip(
            self.arrows, (east, self.time[so_far]), (north, depth), (-heading, pitch - np.pi / 2), strict=True
        ):
            arrow.set_data(x[-1:], y[-1:])
            arrow.set_marker(
                MarkerStyle([(0, 1.3), (-0.5, -0.9), (0, -0.55), (0.5, -0.9)], transform=Affine2D().rotate(turn))
            )
        for axes, path, arrow in zip(self.panels, self.paths, self.arrows, strict=True):
            axes.draw_artist(path)
            axes.draw_artist(arrow)
        if self.number == 0:
            speed = float(np.linalg.norm(log.velocity[k]))
            self.text.set_text(
                f"t = {t:6.1f} s   depth {depth[-1]:6.2f} m   {speed:4.2f} m/s over ground   "
                f"heading {np.degrees(heading) % 360:5.1f}°   pitch {np.degrees(pitch):5.1f}°"
            )
            self.figure.draw_artist(self.text)
