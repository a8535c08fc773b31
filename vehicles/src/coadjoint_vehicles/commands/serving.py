"""The command `coadjoint serve`: a vehicle for another program, one period at a time, over UDP."""

from __future__ import annotations

import json as json_text
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import radians
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import tyro

from coadjoint.cli import terminal
from coadjoint.cli.metavars import called
from coadjoint.errors import ArgumentError
from coadjoint.texts import Table

if TYPE_CHECKING:
    from coadjoint_vehicles.model.craft import Craft
    from coadjoint_vehicles.serving.ardupilot import Lockstep
    from coadjoint_vehicles.serving.loop import Loop
    from coadjoint_vehicles.serving.plain import Service


@dataclass(frozen=True)
class Serve:
    """Serve a vehicle over UDP: `coadjoint serve bluerov2_heavy_blue --ardupilot`, or plain JSON without it."""

    BEGINS: ClassVar[str] = "Reading {vehicle}."

    vehicle: Annotated[tyro.conf.Positional[str], called("VEHICLE")]
    """A vehicle that is shipped, or a TOML file of your own."""
    ardupilot: bool = False
    """Speak ArduPilot's JSON interface, as ArduSub does with `--model JSON:127.0.0.1`."""
    frame: Annotated[str, called("FRAME")] = "vectored_6dof"
    """The frame of ArduSub: bluerov1, vectored, vectored_6dof."""
    rate: Annotated[float | None, called("HERTZ")] = None
    """Steps a second; by default 20, or with ArduPilot the rate of its first packet."""
    depth: Annotated[float, called("METRES")] = 1.0
    """Where it starts, m below the surface."""
    speed: Annotated[float, called("M_S")] = 0.0
    """How fast it starts ahead through the water, m/s."""
    heading: Annotated[float, called("DEGREES")] = 0.0
    """Where it heads at the start, degrees from north to east."""
    current: Annotated[tuple[float, float, float], called("NORTH EAST DOWN")] = (0.0, 0.0, 0.0)
    """The velocity of the water north, east and down, m/s."""
    imu: Annotated[tuple[float, float, float], called("X Y Z")] = (0.0, 0.0, 0.0)
    """Where the inertial unit sits: forward, starboard, down, m."""
    controller: bool = False
    """Serve it with the controller of its file: commands are its set points."""
    paced: bool = False
    """Answer at the pace of real time, and report the delays."""
    host: Annotated[str, called("ADDRESS")] = "127.0.0.1"
    """The address to listen at; 0.0.0.0 for all."""
    port: Annotated[int | None, called("PORT")] = None
    """The port, by default 9002 for ArduPilot and 9010 otherwise."""
    answers: Annotated[int | None, called("COUNT")] = None
    """Stop after so many answers; by default never."""
    idle: Annotated[float | None, called("SECONDS")] = None
    """Stop when nothing has come for so many seconds; by default never."""
    json: bool = False
    """Print the figures at the end as JSON, and nothing else."""

    def __call__(self) -> int:
        from coadjoint_vehicles.serving import ardupilot, plain
        from coadjoint_vehicles.serving.loop import Loop

        self._require()
        usual = ardupilot.PORT if self.ardupilot else plain.PORT
        loop = Loop(self.host, usual if self.port is None else self.port, self.paced)
        if not self.json:
            terminal.line(f"Setting up {self.vehicle} …")
        answering, text = self._for_ardupilot() if self.ardupilot else self._plain()
        if not self.json:
            terminal.line(text)
            terminal.line(f"Listening at {loop.address[0]}:{loop.address[1]}; Ctrl-C ends it.")
        sys.stdout.flush()
        try:
            loop.run(answering, self.answers, self.idle)
        finally:
            found = _figures(loop, answering.counts)
            terminal.line(json_text.dumps(found)) if self.json else terminal.fields(_rows(found))
        return 0

    def _require(self) -> None:
        from coadjoint import checks

        checks.not_negative(self.depth, "--depth, measured downwards,")
        for name, value in {"speed": self.speed, "heading": self.heading}.items():
            checks.number(value, f"--{name}")
        for name, value in {"answers": self.answers, "idle": self.idle}.items():
            if value is not None:
                checks.positive(value, f"--{name}")
        if self.rate is not None:
            checks.number(self.rate, "--rate, in steps a second,", 1, 100_000)
        if self.ardupilot and self.controller:
            raise ArgumentError("ArduPilot is the controller: leave --controller out.")

    def _craft(self) -> tuple[Craft, Callable[[], Any]]:
        from coadjoint_vehicles.files.registry import load_vehicle
        from coadjoint_vehicles.model.craft import Craft
        from coadjoint_vehicles.water.water import UniformWater

        vehicle = load_vehicle(self.vehicle)
        if self.controller and vehicle.controller is None:
            raise ArgumentError(f"{vehicle.name} has no controller in its file: leave --controller out.")
        controller = vehicle.controller if self.controller else None
        craft = Craft(vehicle, controller=controller, water=UniformWater(self.current) if any(self.current) else None)
        begin = partial(
            craft.start, position=(0.0, 0.0, self.depth), speed=self.speed, euler_zyx=(radians(self.heading), 0.0, 0.0)
        )
        return craft, begin

    def _for_ardupilot(self) -> tuple[Lockstep, str]:
        from coadjoint_vehicles.serving.ardupilot import Lockstep, Rates
        from coadjoint_vehicles.serving.frames import motors, thrusters_of
        from coadjoint_vehicles.serving.served import Served

        craft, begin = self._craft()
        thrusters = thrusters_of(craft.vehicle)
        found = motors(self.frame, thrusters)
        rates = Rates(lambda rate: Served(craft, begin(), 1.0 / rate, self.imu), self.rate)
        names = ", ".join(f"{'-' if motor.sign < 0 else ''}{motor.thruster + 1}" for motor in found)
        text = f"{craft.vehicle.name} for ArduSub's frame {self.frame}: its motors are the thrusters {names}."
        return Lockstep(rates, thrusters, found), text

    def _plain(self) -> tuple[Service, str]:
        from coadjoint_vehicles.serving.plain import Service
        from coadjoint_vehicles.serving.served import Served

        craft, begin = self._craft()
        rate = 20.0 if self.rate is None else self.rate
        served = Served(craft, begin(), 1.0 / rate, self.imu)
        names = ", ".join(served.commands) or "none"
        return Service(served, begin), f"{craft.vehicle.name} in steps of 1/{rate:g} s; its commands are {names}."


COUNTED = (
    "answers", "unsent", "refused", "requests", "errors", "unanswered", "ignored", "frames", "duplicates", "late",
    "lost", "failed", "restarts",
)  # fmt: skip


def _figures(loop: Loop, counts: Counter[str]) -> dict[str, object]:
    found: Table = {"answers": loop.answers, "refused": loop.refused, **counts}
    found |= {"unsent": loop.unsent} if loop.unsent else {}
    found |= {"simulated_s": loop.simulated, "seconds": loop.seconds}
    if loop.paced and loop.answers:
        late = loop.lateness
        found["lateness_s"] = {"median": late.share(0.5), "p99": late.share(0.99), "largest": late.largest}
    return found


def _rows(found: Table) -> list[tuple[str, str]]:
    rows = [(name, str(found[name])) for name in COUNTED if name in found]
    rows.append(
        ("simulated", f"{found['simulated_s']:.6g} s, from the first answer to the last {found['seconds']:.3g} s")
    )
    if "lateness_s" in found:
        late = [f"{name} {1e3 * value:.3g} ms" for name, value in found["lateness_s"].items()]
        rows.append(("lateness", ", ".join(late)))
    return rows
