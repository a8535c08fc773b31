"""Pictures in a row: as GIF, as MP4 by ffmpeg, as a page, or in the cell of a notebook."""

from __future__ import annotations

import os
import shutil
import subprocess
from base64 import b64encode
from collections.abc import Callable, Iterator, Sequence
from html import escape
from io import BytesIO
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from matplotlib.figure import Figure

from coadjoint import checks
from coadjoint.disk import atomic_file, write_text
from coadjoint.errors import ArgumentError, FileError
from coadjoint.extensions import import_string
from coadjoint.plotting.entries import Entry
from coadjoint.plotting.player import Player, page
from coadjoint.plotting.registries import SCENES
from coadjoint.plotting.scene_of_runs import scene
from coadjoint.plotting.stage import stage
from coadjoint.plotting.style import style

FRAMES, PER_SECOND = 150, 15
"""Of a film: ten seconds."""
DOTS = 100
"""In an inch of its pictures."""
ENDINGS = (".gif", ".mp4", ".html")

Target = str | os.PathLike[str]


class Actor(Protocol):
    """Artists that move over a background."""

    def draw(self, t: float) -> None:
        """Draw them as they are at time t, s."""
        ...


def film(runs: Sequence[Entry], path: Target, frames: int = FRAMES) -> Path:
    """Write a film of runs in the format of the name's ending; a page shows bodies in space if they move there.

    Raises ArgumentError for other names, and for runs of one node.
    """
    target = ending(path)
    require_nodes(runs, frames)
    if target.suffix.lower() == ".html":
        try:
            return write_text(target, page(scene(runs)))
        except ArgumentError:  # nothing of them moves in space
            pass
    return write(pictures(runs, frames), target, runs[0].label)


def ending(path: Target) -> Path:
    """The path of a film; raises ArgumentError for another ending, and for .mp4 without ffmpeg."""
    target = Path(path)
    if target.suffix.lower() not in ENDINGS:
        raise ArgumentError(f"An animation's file must end in .gif, .mp4 or .html, but is {target.name}.")
    if target.suffix.lower() == ".mp4" and shutil.which("ffmpeg") is None:
        raise ArgumentError(
            f"The animation {target.name} needs the program ffmpeg, which is not on the PATH: install it, or choose a "
            "name that ends in .gif or .html."
        )
    return target


def require_nodes(runs: Sequence[Entry], frames: int) -> None:
    """Raise ArgumentError for runs of one node and for a number of frames that is none."""
    checks.whole(frames, "frames", 2, 1000)
    for run in runs:
        if len(run.time) < 2:
            raise ArgumentError(f"The run of {run.label} has one saved node, so there is nothing to animate.")


def pictures(runs: Sequence[Entry], frames: int) -> Iterator[np.ndarray]:
    """Frames drawn over one background, in its colours, (height, width, 3) each; by the owner of the scene."""
    owners = [one for one in SCENES.values() if one.stage and all(import_string(one.fits)(r.dataset) for r in runs)]
    made: Callable[..., Any] = import_string(owners[0].stage) if owners else stage
    with style():
        figure, actors = made(runs)
        yield from _drawn(figure, actors, runs, frames)


def _drawn(figure: Figure, actors: Sequence[Actor], runs: Sequence[Entry], frames: int) -> Iterator[np.ndarray]:
    drawing: Any = figure.canvas
    figure.set_dpi(DOTS)
    figure.draw_without_rendering()
    drawing.draw()
    figure.set_layout_engine("none")
    background = drawing.copy_from_bbox(figure.bbox)
    for t in np.linspace(min(run.time[0] for run in runs), max(run.time[-1] for run in runs), frames):
        drawing.restore_region(background)
        for actor in actors:
            actor.draw(t)
        yield np.array(drawing.buffer_rgba())[:, :, :3]


def write(frames: Iterator[np.ndarray], target: Path, title: str) -> Path:
    """Write pictures as a film in the format of the name's ending."""
    if target.suffix.lower() == ".mp4":
        return _mp4(frames, target)
    data = gif(frames)
    if target.suffix.lower() == ".html":
        body = f"<h1>{escape(title)}</h1>{image(data, title)}"
        head = f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title></head>'
        return write_text(target, f"{head}<body>{body}</body></html>\n")
    with atomic_file(target) as temporary:
        temporary.write_bytes(data)
    return target


def gif(frames: Iterator[np.ndarray]) -> bytes:
    """Pictures as a GIF in the colours of the middle one; the last one stays a while."""
    from PIL import Image

    shown = [Image.fromarray(frame) for frame in frames]
    palette = shown[len(shown) // 2].quantize(128, dither=Image.Dither.NONE)
    shown = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in shown]
    pause, held = [1000 // PER_SECOND] * (len(shown) - 1) + [1500], BytesIO()
    shown[0].save(held, format="GIF", save_all=True, append_images=shown[1:], duration=pause, loop=0)
    return held.getvalue()


def _mp4(frames: Iterator[np.ndarray], target: Path) -> Path:
    """Pictures as H.264, by the program ffmpeg, which reads them one after the other."""
    first = next(frames)
    height, width = (2 * (size // 2) for size in first.shape[:2])  # which H.264 needs
    command = ["ffmpeg", "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}"]
    command += ["-r", str(PER_SECOND), "-i", "-", "-an", "-pix_fmt", "yuv420p", "-f", "mp4"]
    with atomic_file(target) as temporary:
        with subprocess.Popen([*command, str(temporary)], stdin=subprocess.PIPE, stderr=subprocess.PIPE) as program:
            assert program.stdin is not None
            try:
                for frame in (first, *frames):
                    program.stdin.write(np.ascontiguousarray(frame[:height, :width]).tobytes())
            except BrokenPipeError:
                pass  # its message says why
            _, said = program.communicate()
        if program.returncode:
            lines = said.decode(errors="replace").strip().splitlines() or ["without a message"]
            raise FileError(f"ffmpeg could not write {target}: {lines[-1]}.")
    return target


def image(data: bytes, title: str) -> str:
    """A GIF inside HTML."""
    return f'<img alt="{escape(title)}" src="data:image/gif;base64,{b64encode(data).decode()}">'


class Film:
    """A film of runs: notebooks show it, `save(path)` writes it as .gif, .mp4 or .html."""

    def __init__(self, runs: Sequence[Entry], frames: int = FRAMES):
        require_nodes(runs, frames)
        self.runs, self.frames = tuple(runs), frames

    def save(self, path: Target) -> Path:
        """Write the film in the format of the name's ending; raises ArgumentError for another ending."""
        return film(self.runs, path, self.frames)

    def _repr_html_(self) -> str:
        try:
            return Player(scene(self.runs))._repr_html_()
        except ArgumentError:  # nothing of them moves in space
            return image(gif(pictures(self.runs, self.frames)), self.runs[0].label)

    def __repr__(self) -> str:
        return f"<Film of {', '.join(run.label for run in self.runs)}: save('FILE.gif'), .mp4 or .html writes it>"
