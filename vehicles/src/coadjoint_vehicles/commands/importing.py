"""`coadjoint import FILE`: a vehicle of another simulator as a vehicle file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import tyro

from coadjoint.cli import terminal
from coadjoint.errors import ArgumentError


@dataclass(frozen=True)
class Import:
    """Read a vehicle of another simulator into a vehicle file, and report the losses.

    `coadjoint import rexrov_default.xacro --folder uuv_descriptions --out rexrov.toml`.
    """

    BEGINS: ClassVar[str] = "Reading {file}."

    file: tyro.conf.Positional[Path]
    """SDF of Gazebo, URDF or xacro of uuv_simulator."""
    out: Annotated[Path | None, tyro.conf.arg(metavar="FILE.toml")] = None
    """The vehicle file to write; without it, only the report is printed."""
    folder: Path | None = None
    """Files that it includes must lie below it; by default the folder of the file."""
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE")] = ()
    """Arguments of xacro, as in `--set namespace=rexrov`."""
    gravity: float | None = None
    """m/s²; by default that of the file, or 9.8."""
    forward: Literal["x", "-x"] = "x"
    """The axis of the model that its bow points along; some models of Gazebo face -x."""
    json: bool = False
    """Print the report as JSON, and nothing else."""

    def __call__(self) -> int:
        from coadjoint.disk import write_text
        from coadjoint.extending import to_json
        from coadjoint_vehicles.importing import import_vehicle

        if self.out is not None and (self.out.suffix != ".toml" or self.out.exists()):
            raise ArgumentError(f"Argument --out must be a new file .toml, but is {self.out}.")
        found = import_vehicle(
            self.file,
            folder=self.folder,
            arguments=dict(map(_pair, self.set)),
            gravity=self.gravity,
            forward=self.forward,
        )
        if self.out is not None:
            write_text(self.out, found.text)
        if self.json:
            terminal.text(to_json(found.report.summary()))
            return 0
        terminal.line(str(found.report))
        for sentence in found.vehicle.warnings:
            terminal.line(f"\nWarning: {sentence}")
        if self.out is not None:
            terminal.line(f"\nWritten: {self.out}. `coadjoint vehicles show {self.out}` shows it.")
        return 0


def _pair(given: str) -> tuple[str, str]:
    name, sign, value = given.partition("=")
    if not (name and sign):
        raise ArgumentError(f"Argument --set must be NAME=VALUE, but is {given!r}.")
    return name, value
