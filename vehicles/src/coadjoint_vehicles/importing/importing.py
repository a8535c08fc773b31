"""From a file of another simulator to a vehicle file, with a report of the losses."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from coadjoint import checks
from coadjoint.disk import require_file, require_folder
from coadjoint.errors import ArgumentError, FileError, prefixed
from coadjoint.models.descriptions.elements import Element, read_elements
from coadjoint.models.quantities import not_negative
from coadjoint_vehicles.files.file import vehicle_from_text
from coadjoint_vehicles.files.writing import vehicle_to_toml
from coadjoint_vehicles.importing.draft import Draft, untouched
from coadjoint_vehicles.importing.flying import doubts, flies
from coadjoint_vehicles.importing.gazebo import read_gazebo
from coadjoint_vehicles.importing.report import Report
from coadjoint_vehicles.importing.urdf_gazebo import as_sdf, has_systems
from coadjoint_vehicles.importing.uuv import read_uuv
from coadjoint_vehicles.importing.workspace import workspace_of
from coadjoint_vehicles.importing.xacro import Xacro
from coadjoint_vehicles.model.vehicle import Vehicle

UNSAID = (
    "uncertainties of the numbers",
    'a controller: give one under [controller], such as kind = "manoeuvre" of a vehicle with thrusters',
)
MISSING = 3
"""How many missing files an error names."""
GRAVITY = 9.8
"""m/s², of worlds of Gazebo that give none."""


@dataclass(frozen=True)
class Imported:
    """vehicle: as the library reads it. text: its vehicle file. report: imported values, differences, omissions."""

    vehicle: Vehicle
    text: str
    report: Report


def import_vehicle(
    path: str | os.PathLike[str],
    *,
    folder: str | os.PathLike[str] | None = None,
    arguments: Mapping[str, str] | None = None,
    gravity: float | None = None,
    forward: Literal["x", "-x"] = "x",
    world: str | os.PathLike[str] | None = None,
) -> Imported:
    """The vehicle of a file of another simulator: SDF of Gazebo, URDF or xacro with its systems or of uuv_simulator.

        found = import_vehicle("rexrov_default.xacro", folder="uuv_descriptions")
        print(found.report)

    path: the file. folder: files that it includes must lie below it, $(find NAME) is the folder itself, if it has this
    name, or the nearest NAME below it; by default the repository or the `src` that holds the package of the file, else
    the folder of the file. arguments: values of <xacro:arg>, by names that the files have. gravity: g, m/s², by default
    9.8 if no file states it. forward: the axis of the model that its bow points along. world: a file of Gazebo whose
    world gives gravity, density and current. Raises FileError, with file and line, for unreadable or impossible values,
    and ArgumentError. The import runs no code of the files and opens no address.
    """
    source = Path(path)
    require_file(source)
    below = workspace_of(source) if folder is None else Path(folder)
    require_folder(below)
    xacro = Xacro(below, {key: str(value) for key, value in (arguments or {}).items()})
    root = xacro.read(source)
    with lacking(xacro):
        checks.all_known(arguments or {}, sorted(xacro.asked), "argument of xacro", source.name)
    draft = Draft(_name(root.attributes.get("name"), source), f"{source.name}, a file of another simulator")
    checks.choice(forward, "forward", ("x", "-x"))
    if forward == "-x":
        draft.flip = np.array([-1.0, 1.0, -1.0])
    around = None if world is None else _world(Path(world), draft)
    with lacking(xacro):
        root = _read(root, around, below, draft, source)
    _gravity(draft, gravity)
    untouched(root, draft)
    return _finished(draft, xacro)


@contextmanager
def lacking(xacro: Xacro) -> Iterator[None]:
    """Errors within name the missing files and macros too."""
    try:
        yield
    except (ArgumentError, FileError) as error:
        if not xacro.missing:
            raise
        raise type(error)(f"{error} {report_missing(xacro.missing)}") from None


def _read(root: Element, world: Element | None, below: Path, draft: Draft, source: Path) -> Element:
    """Read a description into a draft; its root, whose elements know whether they were read."""
    if root.tag == "robot" and has_systems(root):
        root = as_sdf(root)
        read_gazebo(root, world, below, draft, "URDF with systems of Gazebo")
    elif root.tag == "robot":
        read_uuv(root, draft)
    elif root.tag == "sdf":
        read_gazebo(root, world, below, draft, "SDF of Gazebo")
    else:
        raise FileError(f"{source.name}: the root is {root.label}, but SDF begins with <sdf> and URDF with <robot>.")
    return root


def _world(path: Path, draft: Draft) -> Element:
    """The <world> of a file of Gazebo; raises FileError."""
    require_file(path)
    root = read_elements(path, path.name)
    world = root.first("world") if root.tag == "sdf" else None
    if world is None:
        raise FileError(f"{path.name}: holds no <world>, which --world needs.")
    draft.report.files.append(path.name)
    return world


def _finished(draft: Draft, xacro: Xacro) -> Imported:
    """The vehicle, written and read again, and its report."""
    report = draft.report
    report.files += dict.fromkeys(xacro.files)
    report.unsaid += UNSAID
    for sentence in (*xacro.missing, *xacro.unseen):
        place, _, said = sentence.partition(": ")
        draft.left(place, "included or called files", said)
    draft.source = f"{report.format}: {', '.join(report.files)}"
    text = vehicle_to_toml(draft.vehicle())
    with prefixed(f"{draft.source}: no vehicle can be made of it"):
        vehicle = vehicle_from_text(text, draft.name)
    report.missing = report_missing(xacro.missing)
    begun = replace(vehicle, volume=vehicle.volume + sum(report.starts.values()))
    first = [sentence for sentence in (report.missing, report.held) if sentence]
    report.flies, report.doubts = flies(vehicle), [*first, *doubts(vehicle), *begun.warnings]
    return Imported(vehicle, text, report)


def report_missing(missing: Sequence[str]) -> str:
    """A sentence on the files and macros that a description names and the folder lacks; "" where there are none."""
    if not missing:
        return ""
    said = " ".join(missing[:MISSING]) + (f" And {len(missing) - MISSING} more." if len(missing) > MISSING else "")
    count = "One included file or macro is" if len(missing) == 1 else f"{len(missing)} included files or macros are"
    return (
        f"{count} missing, and the vehicle lacks what they hold. Missing: {said} Give the folder that holds all "
        "packages by --folder."
    )


def _gravity(draft: Draft, given: object) -> None:
    if "gravity" in draft.body and given is None:
        return
    value = GRAVITY if given is None else float(not_negative(given, "gravity"))
    note = "given" if given is not None else "that of worlds of Gazebo which give none"
    draft.body["gravity"] = draft.given("body.gravity", value, "m/s^2", note)


def _name(given: str | None, source: Path) -> str:
    return (given or "").strip() or source.stem
