"""Mission files: a vehicle, its water, its controller and its mission as TOML, the second kind of run file."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from coadjoint.errors import ArgumentError
from coadjoint.runs.runnable import Runnable
from coadjoint.runs.sections import MethodSection, OutputSection, RunSection

if TYPE_CHECKING:
    from coadjoint.runs.setup import Setup
    from coadjoint.simulation.run import Run


@dataclass(frozen=True)
class VehicleSection:
    """What swims: `name`, a vehicle that is shipped, or `file`, a vehicle file beside the mission file."""

    name: str = ""
    file: str = ""

    def __post_init__(self):
        if bool(self.name) == bool(self.file):
            raise ArgumentError("Section [vehicle] needs either `name`, a vehicle that is shipped, or `file`.")


@dataclass(frozen=True)
class MissionRunSection(RunSection):
    """The grid, and how many `members` swim the mission, each with parameters of its own from [perturb]."""

    members: int = 1

    def __post_init__(self):
        super().__post_init__()
        if self.members < 1:
            raise ArgumentError(f"[run] members must be at least 1, but is {self.members}.")


@dataclass(frozen=True)
class MissionOutputSection(OutputSection):
    """Where results go, whether logs as `csv` and `mcap` are among them, and an `animation`: none, "gif" or "html".

    figures: by default `mission` alone, which holds the others in small.
    """

    figures: bool | list[str] = field(default_factory=lambda: ["mission"])
    csv: bool = True
    mcap: bool = False
    ALWAYS: ClassVar = ("mission",)
    animation: str = ""

    def __post_init__(self):
        super().__post_init__()
        if self.animation not in ("", "gif", "html"):
            raise ArgumentError(f'[output] animation must be "gif" or "html", but is {self.animation!r}.')


@dataclass(frozen=True, kw_only=True)
class MissionFile(Runnable):
    """A mission: the sections of its file. `parameters` … `perturb` are tables as they stand there.

    axes: those of [initial], [mission] and [water], "NED/FRD" or "ENU/FLU", the key above all sections.
    """

    vehicle: VehicleSection
    run: MissionRunSection
    output: MissionOutputSection = field(default_factory=MissionOutputSection)
    parameters: dict[str, Any] = field(default_factory=dict)
    water: dict[str, Any] = field(default_factory=dict)
    controller: dict[str, Any] = field(default_factory=dict)
    mission: dict[str, Any] = field(default_factory=dict)
    initial: dict[str, Any] = field(default_factory=dict)
    perturb: dict[str, Any] = field(default_factory=dict)
    faults: dict[str, Any] = field(default_factory=dict)
    sensors: dict[str, Any] = field(default_factory=dict)
    axes: str = "NED/FRD"
    path: Path = Path("mission.toml")
    WORD: ClassVar = "mission file"
    SECTIONS: ClassVar = {
        "vehicle": VehicleSection,
        "method": MethodSection,
        "run": MissionRunSection,
        "output": MissionOutputSection,
    }
    FREE: ClassVar = ("parameters", "water", "controller", "mission", "initial", "perturb", "faults", "sensors")

    @property
    def names(self) -> list[str]:
        tables = [self.water, *(inner for inner in self.water.values() if isinstance(inner, dict))]
        names = [self.vehicle.file, self.mission.get("file", ""), *(table.get("file", "") for table in tables)]
        return list(dict.fromkeys(name for name in names if isinstance(name, str) and name))

    def set_up(self) -> Setup:
        from coadjoint.vehicles.logs.bags.optional import library
        from coadjoint.vehicles.missions.craft import set_up

        if self.output.mcap:
            library("mcap.writer", "[output] mcap = true")
        return set_up(self)

    def warnings(self, run: Run) -> list[str]:
        from coadjoint.vehicles.missions.faults import sentences
        from coadjoint.vehicles.missions.results import left_water

        return [*left_water(run.dataset), *sentences(self, run.dataset)]

    def observe(self, run: Run) -> None:
        from coadjoint.vehicles.missions.sensors import observe

        observe(self, run)

    def results(self, folder: Path, run: Run) -> tuple[dict[str, Any], list[str]]:
        from coadjoint.vehicles.missions.results import figures, members, results

        summary = members(self, folder, run) if self.run.members > 1 else results(self, folder, run)
        return summary, figures(self, folder, run.dataset)


def from_table(table: dict[str, Any], path: Path, text: str) -> MissionFile:
    """The mission in a table of sections; raises ArgumentError."""
    axes = _axes(table.get("axes", "NED/FRD"))
    if "pilot" in table:
        raise ArgumentError("A mission file has no section [pilot]: it is called [controller].")
    made = MissionFile.sections({name: given for name, given in table.items() if name != "axes"}, path)
    if made["run"].members > 1 and not made["perturb"]:
        raise ArgumentError("[run] members > 1 needs a section [perturb], which says in what the members differ.")
    if made["run"].members > 1 and made["output"].mcap:
        raise ArgumentError("[output] mcap is the log of one run, but [run] members are several: leave it out.")
    if made["perturb"] and made["run"].members == 1:
        raise ArgumentError("Section [perturb] needs [run] members, how many swim, 2 or more.")
    if "sensors" in table and not table["sensors"]:
        made["sensors"] = {"seed": 0}  # an empty section asks for all sensors
    return MissionFile(path=path, text=text, axes=axes, **made)


def _axes(given: Any) -> str:
    if given not in ("NED/FRD", "ENU/FLU"):
        raise ArgumentError(f'axes of a mission file must be "NED/FRD" or "ENU/FLU", but is {given!r}.')
    return given
