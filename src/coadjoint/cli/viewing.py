"""`coadjoint view DIR`: a page that shows runs move in space, written and opened."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import tyro

from coadjoint.cli import terminal
from coadjoint.cli.metavars import called


@dataclass(frozen=True)
class View:
    """Show runs move in space: one self-contained page for the browser, which needs no network."""

    BEGINS: ClassVar[str] = "Reading the runs."

    sources: Annotated[tyro.conf.Positional[tuple[Path, ...]], called("DIR|FILE …")]
    """Folders that `run` or co.simulate(store=…) wrote, or files of runs; several come into one scene."""
    out: Annotated[Path | None, called("FILE")] = None
    """The page to write, by default `view.html` next to the first run."""
    mesh: Annotated[Path | None, called("FILE")] = None
    """The hull's surface, a file of STL, OBJ or glTF, instead of the one in the vehicle file."""
    mesh_unit: Literal["m", "cm", "mm", "in"] = "m"
    """The unit of the mesh's numbers."""
    mesh_axes: Literal["FRD", "FLU", "YUP"] = "FRD"
    """The axes of the mesh: forward, starboard, down; forward, port, up; or glTF's port, up, forward."""
    size: Annotated[tuple[float, float, float] | None, called("LENGTH WIDTH HEIGHT")] = None
    """The sides of the body, m, for runs without a vehicle."""
    round: bool = False
    """The body is an ellipsoid with these sides, not a box."""
    z_down: bool = False
    """The third axis of space points down, for runs without a vehicle."""
    no_open: bool = False
    """Write the page, and do not open it."""
    json: bool = False
    """Print the file's name as JSON, and nothing else; nothing is opened."""

    def __call__(self) -> int:
        from coadjoint.cli.results_folder import recordings, streams
        from coadjoint.disk import write_text
        from coadjoint.errors import ArgumentError
        from coadjoint.plotting.entries import entries
        from coadjoint.plotting.player import page
        from coadjoint.plotting.scene_of_runs import scene
        from coadjoint.report.folder import make

        if not self.sources:
            raise ArgumentError("Which run? Give the folder that `coadjoint run` wrote, as in `coadjoint view dive`.")
        found = {source: recordings(source) for source in self.sources}
        labels = [name if len(self.sources) == 1 else source.stem for source, runs in found.items() for name in runs]
        runs = [run for held in found.values() for run in held.values()]
        shown = scene(entries(runs, labels if len(runs) > 1 else None), z_down=self.z_down, hull=self._hull())
        first = self.sources[0]
        target = self.out or (first if first.is_dir() and not streams(first) else first.parent) / "view.html"
        make(target.parent)
        write_text(target, page(shown))
        if self.json:
            terminal.json(str(target), indent=None)
        else:
            terminal.line(f"Written: {target}.")
        if not self.no_open and not self.json and not opened(target):
            terminal.line(f"No browser was found on this machine: open {target} in one; it needs no network.")
        return 0

    def _hull(self) -> Any:
        """The shape that is given for the hull or the body, if any."""
        from coadjoint.errors import ArgumentError
        from coadjoint.plotting import bodies

        if self.mesh is not None and self.size is not None:
            raise ArgumentError("The body is given either by a mesh or by `--size`: leave one of them out.")
        if self.mesh is not None:
            return bodies.mesh(self.mesh, self.mesh_unit, axes=self.mesh_axes)
        if self.size is None:
            return None
        return bodies.ellipsoid([side / 2 for side in self.size]) if self.round else bodies.box(self.size)


def opened(file: Path) -> bool:
    """Show a file in the browser of the desktop, and whether there is one."""
    import webbrowser

    screen = sys.platform != "linux" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"))
    try:
        return screen and webbrowser.open(file.resolve().as_uri())
    except webbrowser.Error:
        return False
