"""The sections of a mission file, as data."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from coadjoint.arrays import PyTree
from coadjoint.checks import whole
from coadjoint.errors import ArgumentError
from coadjoint.extending import Runnable, initial_values
from coadjoint.runs.sections import MethodSection, OutputSection, RunSection
from coadjoint.sections import key, written
from coadjoint.texts import Table
from coadjoint.units import ANGLE, ANGULAR_VELOCITY, LENGTH, SPEED, TIME
from coadjoint_vehicles.missions.faults import FaultSection
from coadjoint_vehicles.missions.lost_sensors import LostSensor
from coadjoint_vehicles.missions.mission_section import MissionSection
from coadjoint_vehicles.missions.perturb import PerturbSection
from coadjoint_vehicles.missions.sensors import SensorsSection

if TYPE_CHECKING:
    from coadjoint_vehicles.model.vehicle import Vehicle

AXES = ("NED/FRD", "ENU/FLU")


@dataclass(frozen=True)
class VehicleSection:
    """The vehicle: `name`, a shipped vehicle, or `file`, a vehicle file next to the mission file."""

    name: str = key("vehicle that ships with the library", default="")
    file: str = key("vehicle file next to the mission file", default="")

    def __post_init__(self) -> None:
        if bool(self.name) == bool(self.file):
            raise ArgumentError("Section [vehicle] needs either `name`, a vehicle that is shipped, or `file`.")

    def load(self, located: Callable[[str], Path]) -> tuple[Vehicle, list[str]]:
        """The vehicle, and the doubtful values of a user's own file; located: where `file` is."""
        from coadjoint_vehicles.files.registry import load_vehicle

        if not self.file:
            return load_vehicle(self.name), []
        path = located(self.file)
        with warnings.catch_warnings():  # they belong to the run
            warnings.simplefilter("ignore", UserWarning)
            vehicle = load_vehicle(path)
        return vehicle, [f"{path.name}: {sentence}" for sentence in vehicle.warnings]


@dataclass(frozen=True)
class InitialSection:
    """Where the vehicle starts, as `Craft.start` takes it, with yaw or heading, pitch and roll one by one."""

    position: PyTree = key("position of O", LENGTH, default=None)
    speed: Any = key("speed ahead, through the water", SPEED, default=None)
    velocity: Any = key("velocity in body axes, through the water", SPEED, default=None)
    euler_zyx: Any = key("yaw, pitch, roll", ANGLE, default=None)
    yaw: Any = key("yaw", ANGLE, default=None)
    heading: Any = key("heading: yaw in NED/FRD", ANGLE, default=None)
    pitch: Any = key("pitch", ANGLE, default=None)
    roll: Any = key("roll", ANGLE, default=None)
    angular_velocity: Any = key("angular velocity in body axes", ANGULAR_VELOCITY, default=None)
    actuators: Any = key("where actuators start, a table by part", default=None)
    axes: str = key("axes of the start, where they are not those of the file", words=("", *AXES), default="")
    t: Any = key("time at the start", TIME, default=None)

    def arguments(self, axes: str) -> Table:
        """The keywords of `Craft.start`; axes: those of the file. Raises ArgumentError."""
        given = {**written(self), "axes": self.axes or axes}
        if "heading" in given:
            if given["axes"] != "NED/FRD":
                raise ArgumentError(
                    f"[initial] heading belongs to NED/FRD: give `yaw`, from east to the left, in {given['axes']}."
                )
            if "yaw" in given:
                raise ArgumentError("[initial] gives both `heading` and `yaw`: leave one out.")
            given["yaw"] = given.pop("heading")
        return initial_values(given, START)


START = ("position", "speed", "velocity", "euler_zyx", "angular_velocity", "actuators", "axes", "t")
"""The keywords of `Craft.start`."""


@dataclass(frozen=True)
class MissionRunSection(RunSection):
    """The grid, and the number of `members` of the mission, each with individual parameters from [perturb]."""

    members: int = key(
        "how many swim, each with its own parameters; more than one need `[perturb]`", check=whole, default=1
    )


@dataclass(frozen=True)
class MissionOutputSection(OutputSection):
    """Where results go, whether logs as `csv` and `mcap` are among them, and an `animation`: none, "gif" or "html".

    figures: by default only `mission`, which holds the others at small size.
    """

    figures: bool | list[str] = key("figures: all, none, or a list of names", factory=partial(list, ("mission",)))
    csv: bool = key("whether `trajectory.csv`, of several members `members.csv`, is written", default=True)
    mcap: bool = key("whether `trajectory.mcap` is written, messages of ROS 2, of one run", default=False)
    ALWAYS: ClassVar = ("mission",)
    animation: str = key("animation", words=("", "gif", "html"), default="")


@dataclass(frozen=True, kw_only=True)
class MissionSections(Runnable):
    """The sections of a mission file. `parameters`, `water` and `controller` are tables as in the file.

    axes: those of [initial], [mission] and [water], "NED/FRD" or "ENU/FLU", the key above all sections.
    """

    vehicle: VehicleSection
    run: MissionRunSection
    output: MissionOutputSection = field(default_factory=MissionOutputSection)
    mission: MissionSection = field(default_factory=MissionSection)
    initial: InitialSection = field(default_factory=InitialSection)
    perturb: PerturbSection = field(default_factory=PerturbSection)
    faults: tuple[FaultSection, ...] = ()
    lost_sensors: tuple[LostSensor, ...] = ()
    sensors: SensorsSection | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    water: Mapping[str, Any] = field(default_factory=dict)
    controller: Mapping[str, Any] = field(default_factory=dict)
    axes: str = "NED/FRD"
    path: Path = Path("mission.toml")
    WORD: ClassVar = "mission file"
    SECTIONS: ClassVar = {
        "vehicle": VehicleSection,
        "initial": InitialSection,
        "method": MethodSection,
        "run": MissionRunSection,
        "output": MissionOutputSection,
        "perturb": PerturbSection,
    }
    FREE: ClassVar = ("parameters", "water", "controller", "mission", "faults", "sensors")
