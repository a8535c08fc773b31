"""Mission files: a vehicle, its water, its controller and its mission as TOML, the second kind of run file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from coadjoint.checks import choice
from coadjoint.errors import ArgumentError
from coadjoint.labelled import of_run
from coadjoint.sections import read
from coadjoint.texts import Table
from coadjoint_vehicles.files.kinds import kinds
from coadjoint_vehicles.missions.faults import FaultSection, read_fault
from coadjoint_vehicles.missions.lost_sensors import LostSensor, is_of_sensor, read_lost_sensor
from coadjoint_vehicles.missions.mission_section import MissionSection
from coadjoint_vehicles.missions.perturb import PerturbSection
from coadjoint_vehicles.missions.sections import AXES, MissionSections
from coadjoint_vehicles.missions.sensors import SensorsSection

if TYPE_CHECKING:
    from coadjoint.extending import Setup
    from coadjoint.mechanics.members import Each
    from coadjoint.simulation import Run


@dataclass(frozen=True, kw_only=True)
class MissionFile(MissionSections):
    """A mission file as a run: from its sections to results."""

    @property
    def names(self) -> list[str]:
        tables = [self.water, *(inner for inner in self.water.values() if isinstance(inner, dict))]
        names = [self.vehicle.file, self.mission.file, *(table.get("file", "") for table in tables)]
        return list(dict.fromkeys(name for name in names if isinstance(name, str) and name))

    def with_seeds(self, seeds: Each) -> Self:
        return replace(self, perturb=PerturbSection(seed=seeds))

    def set_up(self) -> Setup:
        from coadjoint_vehicles.logs.bags.optional import library
        from coadjoint_vehicles.missions.craft import set_up

        if self.output.mcap:
            library("mcap.writer", "[output] mcap = true")
        return set_up(self)

    def warnings(self, run: Run) -> list[str]:
        from coadjoint_vehicles.missions.electric import beyond_sheet
        from coadjoint_vehicles.missions.results import astray, left_water, tilted

        steered = getattr(run.system.internal, "controller", None)
        said = [fault.sentence(of_run(run)) for fault in (*self.faults, *self.lost_sensors)]
        found = [
            *left_water(of_run(run)),
            *tilted(of_run(run), steered),
            *beyond_sheet(of_run(run)),
            *astray(of_run(run)),
        ]
        return [*found, *(sentence for sentence in said if sentence is not None)]

    def observe(self, run: Run) -> None:
        from coadjoint_vehicles.missions.craft import bottom_of_sensors
        from coadjoint_vehicles.missions.sensors import observe

        if self.sensors is not None and not run.position.failed:
            vehicle, _ = self.vehicle.load(self.located)
            observe(self.sensors, vehicle, bottom_of_sensors(self), self.lost_sensors, run)

    def results(self, folder: Path, run: Run) -> tuple[Table, list[str]]:
        from coadjoint_vehicles.missions.results import figures, members, results

        if self.run.members > 1:
            summary = members(self.output, folder, run)
        else:
            summary = results(self.output, folder, run, self.mission.reached)
        return summary, figures(self.output, folder, of_run(run))


def from_table(table: Mapping[str, Any], path: Path, text: str) -> MissionFile:
    """The mission in a table of sections; raises ArgumentError."""
    axes = choice(table.get("axes", AXES[0]), "axes of a mission file", AXES)
    if "pilot" in table:
        raise ArgumentError("A mission file has no section [pilot]: it is called [controller].")
    made = MissionFile.sections({name: given for name, given in table.items() if name != "axes"}, path)
    if made["run"].members > 1 and not table.get("perturb"):
        raise ArgumentError("[run] members > 1 needs a section [perturb], which says in what the members differ.")
    if made["run"].members > 1 and made["output"].mcap:
        raise ArgumentError("[output] mcap is the log of one run, but [run] members are several: leave it out.")
    if table.get("perturb") and made["run"].members == 1:
        raise ArgumentError("Section [perturb] needs [run] members, how many swim, 2 or more.")
    made["mission"] = read(MissionSection, "mission", made["mission"], axes=axes)
    made["sensors"] = read(SensorsSection, "sensors", made["sensors"]) if "sensors" in table else None
    if made["sensors"] is not None and made["run"].members > 1:
        raise ArgumentError(
            f"Section [sensors] reads a single vehicle, but [run] members are {made['run'].members}: leave one of them "
            "out."
        )
    given = made["faults"].items()
    made["faults"] = tuple(read_fault(name, one) for name, one in given if not is_of_sensor(one))
    made["lost_sensors"] = tuple(read_lost_sensor(name, one) for name, one in given if is_of_sensor(one))
    for lost in made["lost_sensors"]:
        if made["sensors"] is None:
            raise ArgumentError(
                f"[faults.{lost.name}] is of a sensor, but the mission reads none: give it a section [sensors]."
            )
    return MissionFile(path=path, text=text, axes=axes, **made)


def declared() -> dict[str, type]:
    """The sections of mission files, whose fields are their keys; those of [controller] are those of its kind."""
    others = {
        "mission": MissionSection,
        "sensors": SensorsSection,
        "faults": FaultSection,
        "faults of sensors": LostSensor,
    }
    return {
        **MissionFile.SECTIONS,
        **others,
        **{f"controller, {kind}": made for kind, made in kinds("controllers").items()},
    }
