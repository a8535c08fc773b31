"""Animations of vehicles: a GIF of track and depth, or a page with a scene in space."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.markers import MarkerStyle
from matplotlib.transforms import Affine2D

from coadjoint import checks
from coadjoint.disk import atomic_file, write_text
from coadjoint.errors import ArgumentError
from coadjoint.extending import player_page as page
from coadjoint.extending import scene_of_runs as scene
from coadjoint.plotting.entries import Entry
from coadjoint.plotting.style import COLOURS, canvas, style
from coadjoint.texts import Table
from coadjoint_vehicles.figures.navigation import draw_depth, draw_track
from coadjoint_vehicles.logs.records import VehicleRecords

FRAMES, PER_SECOND = 150, 15
"""Of a GIF: ten seconds."""
_DOTS = 100
_MOST = 8
"""The most vehicles in a GIF."""


def animation(runs: Sequence[Entry], path: str | os.PathLike[str], frames: int = FRAMES) -> Path:
    """Write an animation in the format of the name's ending, .gif or .html; raises ArgumentError."""
    target = Path(path)
    if target.suffix.lower() not in (".gif", ".html"):
        raise ArgumentError(f"An animation's file must end in .gif or .html, but is {target.name}.")
    checks.whole(frames, "frames", 2, 1000)
    if target.suffix.lower() == ".html":
        return write_text(target, page(scene(runs)))
    shown = list(runs[:_MOST])
    for run in shown:
        if len(run.time) < 2:
            raise ArgumentError(f"The run of {run.label} has one saved node, so there is nothing to animate.")
    return _gif(shown, target, frames)


def _gif(runs: Sequence[Entry], target: Path, frames: int) -> Path:
    """Frames drawn over one background, in its colours."""
    from PIL import Image

    with style():
        figure, moving = _stage(runs)
        drawing = figure.canvas
        figure.set_layout_engine("none")
        background = drawing.copy_from_bbox(figure.bbox)  # pyright: ignore[reportAttributeAccessIssue]
        pictures, palette = [], None
        for t in np.linspace(min(run.time[0] for run in runs), max(run.time[-1] for run in runs), frames):
            drawing.restore_region(background)  # pyright: ignore[reportAttributeAccessIssue]
            for vehicle in moving:
                vehicle.draw(t)
            picture = Image.fromarray(np.asarray(drawing.buffer_rgba())).convert("RGB")  # pyright: ignore[reportAttributeAccessIssue]
            palette = palette or picture.quantize(64, dither=Image.Dither.NONE)
            pictures.append(picture.quantize(palette=palette, dither=Image.Dither.NONE))
    pause = [1000 // PER_SECOND] * (frames - 1) + [1500]
    with atomic_file(target) as temporary:
        pictures[0].save(temporary, format="GIF", save_all=True, append_images=pictures[1:], duration=pause, loop=0)
    return target


def _stage(runs: Sequence[Entry]) -> tuple[Figure, list[_Vehicle]]:
    """The fixed artists, drawn, and the moving vehicles."""
    figure = canvas(7.2, 3.4)
    figure.set_dpi(_DOTS)
    above, side = figure.subplots(1, 2)
    draw_track(above, runs)
    draw_depth(side, runs)
    side.set_xlabel("time $t$ (s)")
    for axes in (above, side):
        for line in axes.get_lines():
            line.set_alpha(0.35)
    figure.suptitle(" ", fontsize=9)  # space for the text of each frame
    figure.draw_without_rendering()
    figure.canvas.draw()
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
