"""The command `coadjoint identify`: parameters of a vehicle from a logged trajectory."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import tyro

from coadjoint.cli import terminal
from coadjoint.cli.metavars import called
from coadjoint.disk import require_home
from coadjoint.errors import ArgumentError

if TYPE_CHECKING:
    from coadjoint.identification import Identification


@dataclass(frozen=True)
class Identify:
    """Find parameters of a vehicle from a log: `coadjoint identify remus_100 log.csv --parameters hull added_mass`."""

    BEGINS: ClassVar[str] = "Reading the logs."

    vehicle: Annotated[tyro.conf.Positional[str], called("VEHICLE")]
    """A vehicle that is shipped, or a TOML file of your own."""
    logs: Annotated[tyro.conf.Positional[tuple[Path, ...]], called("LOG …")]
    """CSV files with columns such as time_s, roll_deg, u_m_s, command_rudder_deg, or bags of ROS or of ArduPilot;
    several are fitted together."""
    parameters: Annotated[tuple[str, ...], called("NAME …")]
    """The unknowns: parameters, entries such as `added_mass[0,0]`, parts for all their parameters, or "a = b"."""
    axes: Annotated[Literal["NED/FRD", "ENU/FLU"] | None, called("{NED/FRD,ENU/FLU}")] = None
    """Axes of the log; by default NED/FRD of CSV files, and ENU/FLU of bags."""
    topics: Annotated[tuple[str, ...], called("TOPIC …")] = ()
    """Take only these topics of a bag."""
    sensors: Annotated[Path | None, called("FILE")] = None
    """A TOML file that declares the meaning of fields of topics of a bag."""
    jumps: Literal["refuse", "split"] = "refuse"
    """Where the clock jumps: an error, or a new stretch of the log."""
    unsorted: Literal["refuse", "sort"] = "refuse"
    """Rows that are out of order: an error, or sorted."""
    partial: bool = False
    """Take the complete messages of a bag that was not closed."""
    noise: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="NAME=VALUE")] = ()
    """A standard deviation that is known, SI units and rad; repeatable. The others are estimated."""
    segment: Annotated[float | None, called("SECONDS")] = None
    """Length of the segments, s; 0 takes the log as one run; by default 10, or 0 where an internal state, as that of a
    controller, depends on the motion."""
    dt: Annotated[float | None, called("SECONDS")] = None
    """Step, s; by default one that shifts no parameter by much."""
    between: Literal["held", "linear"] = "held"
    """How inputs run between samples."""
    settle: Annotated[float | None, called("SECONDS")] = None
    """The initial time that is not fitted, s; by default 2 unless the log holds the states of actuators."""
    ignore: Annotated[tuple[str, ...], called("COLUMN …")] = ()
    """Columns to leave out, by name with or without the unit."""
    still: Annotated[tuple[str, ...], called("NAME …")] = ()
    """Actuators that the log does not hold and that stay where they start."""
    positive: Annotated[tuple[str, ...], called("NAME …")] = ()
    """Parameters that must stay positive."""
    coloured: Annotated[tuple[str, ...], called("NAME …")] = ()
    """Columns with coloured noise, whose correlation time is estimated."""
    biases: Annotated[tuple[str, ...], called("NAME …")] = ()
    """Columns whose bias is estimated as well; position, attitude, velocity and rates mean three each."""
    delays: Annotated[tuple[str, ...], called("NAME …")] = ()
    """Columns, or such groups of three, whose delay is estimated."""
    process_noise: Annotated[tuple[str, ...], called("NAME …")] = ()
    """Process noise: force, torque, X, Y, Z, K, M, N, or parameters such as water.velocity."""
    out: Annotated[Path | None, called("FILE")] = None
    """A figure of measured and simulated columns."""
    json: bool = False
    """Print JSON, and nothing else."""

    def __call__(self) -> int:
        from coadjoint.identification import identify, merged
        from coadjoint_vehicles.files.registry import load_vehicle
        from coadjoint_vehicles.logs import read_log
        from coadjoint_vehicles.model.craft import Craft

        if self.out is not None:
            require_home(self.out)
        craft = Craft(load_vehicle(self.vehicle))
        given = {"topics": self.topics, "sensors": self.sensors, "partial": self.partial}
        options = {name: value for name, value in given.items() if value}
        if not self.logs:
            raise ArgumentError(
                "Which log? Give its file after the vehicle, as in coadjoint identify remus_100 log.csv."
            )
        read = {"axes": self.axes, "ignore": self.ignore, "jumps": self.jumps, "unsorted": self.unsorted, **options}
        log = merged([read_log(path, **read) for path in self.logs])
        begun = {part.name: log.first(part.name) for part in craft.vehicle.commanded}
        actuators = {name: value for name, value in begun.items() if value is not None}
        found = identify(
            craft.system,
            log,
            start=craft.start(actuators=actuators),
            parameters=self.parameters,
            noise=dict(map(_given, self.noise)),
            segment="auto" if self.segment is None else self.segment or None,
            dt=self.dt,
            between=self.between,
            settle=self.settle if self.settle is not None else 0.0 if set(actuators) <= set(log.actual) else 2.0,
            positive=self.positive,
            still=self.still,
            coloured=self.coloured,
            biases=self.biases,
            delays=self.delays,
            process_noise=self.process_noise,
        )
        if self.json:
            terminal.json(_summary(found))
        else:
            terminal.line(str(found))
        if self.out is not None:
            from coadjoint.plotting.style import save

            path = save(found.plot(), self.out, dpi=160)
            if not self.json:
                terminal.line(f"Figure: {path}.")
        return 0


def _given(text: str | tuple[str, ...]) -> tuple[str, float]:
    text = text if isinstance(text, str) else text[0]
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise ArgumentError(f"--noise must be NAME=VALUE with a number, as in depth=0.02, but is {text!r}.") from None


def _number(value: float) -> float | None:
    """The number; None for an infinite end of an interval, which JSON cannot express."""
    return float(value) if math.isfinite(value) else None


def _summary(found: Identification) -> dict[str, object]:
    keys = ("value", "low", "high", "standard_error", "prior")
    return {
        "system": found.system.name,
        "dt": found.dt,
        "segments": found.segments,
        "level": found.level,
        "parameters": {n: {key: _number(getattr(e, key)) for key in keys} for n, e in found.estimates.items()},
        "correlation": found.correlation.tolist(),
        "noise": found.noise,
        "correlation_time_s": found.correlation_times,
        "process_noise": {
            n: {
                "deviation": one.deviation,
                "deviation_interval": [_number(end) for end in one.deviation_interval],
                "unit": one.unit,
                "correlation_time_s": one.correlation_time,
                "correlation_time_interval_s": [_number(end) for end in one.correlation_time_interval],
            }
            for n, one in found.process_noise.items()
        },
        "lag_one_correlation": found.whiteness,
        "settled": found.settled,
        "warnings": list(found.warnings),
    }
