"""`coadjoint import FILE`: a vehicle of another simulator as a vehicle file."""

from __future__ import annotations

from dataclasses import dataclass
from os.path import relpath
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import tyro

from coadjoint.cli import terminal
from coadjoint.cli.metavars import called
from coadjoint.errors import ArgumentError

if TYPE_CHECKING:
    from coadjoint_vehicles.importing.importing import Imported


@dataclass(frozen=True)
class Import:
    """Read a vehicle of another simulator into a vehicle file, and report the losses.

    `coadjoint import model.sdf --out rov.toml --mission dive.toml`, and `coadjoint run dive.toml` flies it.
    """

    BEGINS: ClassVar[str] = "Reading {file}."

    file: Annotated[tyro.conf.Positional[Path], called("FILE")]
    """SDF of Gazebo, URDF or xacro with its systems or of uuv_simulator."""
    out: Annotated[Path | None, called("FILE.toml")] = None
    """The vehicle file to write; without it, only the report is printed."""
    folder: Annotated[Path | None, called("DIR")] = None
    """Files that it includes must lie below it; by default the repository of its package, else its own folder."""
    set: Annotated[tuple[str, ...], called("NAME=VALUE …")] = ()
    """Arguments of xacro, as in `--set namespace=rexrov`."""
    gravity: Annotated[float | None, called("M_S2")] = None
    """m/s²; by default that of the file, or 9.8."""
    world: Annotated[Path | None, called("FILE")] = None
    """A file of Gazebo whose world gives gravity, density and current."""
    mission: Annotated[Path | None, called("FILE.toml")] = None
    """Write a mission of a minute as well, which `coadjoint run` flies; with --out."""
    forward: Literal["x", "-x"] = "x"
    """The axis of the model that its bow points along; some models of Gazebo face -x."""
    json: bool = False
    """Print the report as JSON, and nothing else."""

    def __call__(self) -> int:
        from coadjoint.disk import write_text
        from coadjoint.extending import to_json
        from coadjoint_vehicles.importing import import_vehicle

        for name, path in (("out", self.out), ("mission", self.mission)):
            if path is not None and (path.suffix != ".toml" or path.exists()):
                raise ArgumentError(f"Argument --{name} must be a new file .toml, but is {path}.")
        if self.mission is not None and self.out is None:
            raise ArgumentError("Argument --mission needs --out, the vehicle file that the mission names.")
        found = import_vehicle(
            self.file,
            folder=self.folder,
            arguments=dict(map(_pair, self.set)),
            gravity=self.gravity,
            forward=self.forward,
            world=self.world,
        )
        mission = None if self.mission is None else self._mission(found)
        if self.out is not None:
            write_text(self.out, found.text)
        if self.mission is not None and mission is not None:
            write_text(self.mission, mission)
        if self.json:
            terminal.text(to_json(found.report.summary()))
            return 0
        terminal.line(str(found.report))
        if self.out is not None:
            terminal.line(f"\nWritten: {self.out}. `coadjoint vehicles show {self.out}` shows it.")
        if self.mission is not None:
            terminal.line(f"Written: {self.mission}. `coadjoint run {self.mission}` flies it.")
        return 0

    def _mission(self, found: Imported) -> str:
        from coadjoint_vehicles.importing.flying import SPEEDS, first_mission, fitting

        assert self.mission is not None and self.out is not None
        if not SPEEDS.keys() & set(fitting(found.vehicle)):
            if not self.json:
                terminal.line(f"{found.report}\n")
            has = found.report.flies.partition(";")[0]
            raise ArgumentError(
                f"No mission can be written for {found.vehicle.name}, which has {has}: none of the controllers "
                f"{', '.join(SPEEDS)} fits. {found.report.missing or 'Leave out --mission.'}"
            )
        return first_mission(found.vehicle, relpath(self.out, self.mission.parent), found.report)


def _pair(given: str) -> tuple[str, str]:
    from coadjoint import checks

    name, sign, value = given.partition("=")
    checks.expect(name and sign, given, "Argument --set", "NAME=VALUE")
    return name, value
