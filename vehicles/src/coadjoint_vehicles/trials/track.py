"""The track of a manoeuvre: place, heading, speed and rudder over time."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from coadjoint import checks
from coadjoint.checks import choice
from coadjoint.errors import ArgumentError
from coadjoint.texts import Table
from coadjoint_vehicles.controllers.manoeuvres import MANOEUVRES, TRIAL
from coadjoint_vehicles.logs.records import VehicleRecords

if TYPE_CHECKING:
    from coadjoint.labelled import AnyDataset

_MEMORY = "internal_controller_value_memory"


@dataclass(frozen=True, eq=False)
class Track:
    """What a manoeuvre is judged by, at times t, (n,) each.

    manoeuvre: "turning_circle", "zigzag", "spiral", "stop" or "pull_out". time: s, increasing. north, east: m, of
    midships, or of the origin O of a vehicle. heading: rad. speed: ahead, m/s. order: δ_R, rad, positive to starboard,
    in force from its time on. rudder: its actual angle, rad, by default the order. rate: dψ/dt, rad/s, by default from
    differences of the heading. begin: time of the first execute, s, by default that of the first order that is not 0.
    course: the original course, rad, by default the heading at the first execute. length: L, m. Raises ArgumentError
    for columns of several lengths, numbers that are not finite, times that do not increase, and a track without an
    execute.
    """

    manoeuvre: str
    time: np.ndarray
    north: np.ndarray
    east: np.ndarray
    heading: np.ndarray
    speed: np.ndarray
    order: np.ndarray
    rudder: np.ndarray | None = None
    rate: np.ndarray | None = None
    begin: float | None = None
    course: float | None = None
    length: float | None = None

    def __post_init__(self) -> None:
        choice(self.manoeuvre, "manoeuvre", MANOEUVRES)
        count = np.shape(self.time)
        for name in ("time", "north", "east", "heading", "speed", "order"):
            object.__setattr__(self, name, checks.array(getattr(self, name), name, count))
        if len(count) != 1 or count[0] < 3 or np.any(np.diff(self.time) <= 0):
            raise ArgumentError("Argument `time` of a track must be three or more increasing times, (n,) s.")
        object.__setattr__(self, "heading", np.unwrap(self.heading))
        if self.rudder is not None:
            object.__setattr__(self, "rudder", checks.array(self.rudder, "rudder", count))
        rate = np.gradient(self.heading, self.time) if self.rate is None else checks.array(self.rate, "rate", count)
        object.__setattr__(self, "rate", rate)
        object.__setattr__(self, "begin", self._begun())

    def _begun(self) -> float:
        """The time of the first execute."""
        if self.begin is None and not np.any(self.order):
            raise ArgumentError("Argument `order` of a track is 0 throughout: give `begin`, the time of execute.")
        begin = float(self.time[np.flatnonzero(self.order)[0]]) if self.begin is None else float(self.begin)
        if not self.time[0] <= begin < self.time[-1]:
            raise ArgumentError(
                f"The first execute must be within the times of the track, {self.time[0]:g} to {self.time[-1]:g} s, "
                f"but is at {begin:g} s."
            )
        return begin

    @classmethod
    def of(cls, dataset: AnyDataset) -> Track:
        """The track of a mission with the controller `trial`; raises ArgumentError for other runs."""
        log = VehicleRecords(dataset)
        if TRIAL not in dataset.attrs:
            raise ArgumentError(
                f"The run of {dataset.attrs.get('system', 'this system')} is no standard manoeuvre: run a mission with "
                '[controller] kind = "trial", or give a Track of its columns.'
            )
        told = json.loads(dataset.attrs[TRIAL])
        stage = np.asarray(dataset[f"{_MEMORY}_stage"], dtype=float)
        begun = np.flatnonzero(stage >= 0)
        if not len(begun):
            raise ArgumentError(f"The manoeuvre has not begun at {log.time[-1]:g} s: run it for longer.")
        since, order = (np.asarray(dataset[f"{_MEMORY}_{name}"], dtype=float) for name in ("since", "order"))
        roll, pitch, heading = log.attitude.T
        rate = (log.rates[:, 1] * np.sin(roll) + log.rates[:, 2] * np.cos(roll)) / np.cos(pitch)
        return cls(
            manoeuvre=told["manoeuvre"],
            time=log.time,
            north=log.position[:, 0],
            east=log.position[:, 1],
            heading=heading,
            speed=log.through_water[:, 0],
            order=np.append(order[1:], order[-1]),  # a node holds what was ordered at the one before
            rudder=_turned(log, told),
            rate=rate,
            begin=float(since[begun[0]]),
            length=told["length"],
        )

    @cached_property
    def first(self) -> int:
        """The sample of the first execute."""
        return int(np.searchsorted(self.time, self.begin + 1e-9, side="right")) - 1  # pyright: ignore[reportOptionalOperand]

    @property
    def _course(self) -> float:
        return float(self.heading[self.first] if self.course is None else self.course)

    @cached_property
    def turned(self) -> np.ndarray:
        """ψ − ψ₀, (n,) rad, from the original course."""
        return self.heading - self._course

    @cached_property
    def ahead_and_aside(self) -> np.ndarray:
        """(n, 2) m from the place of the first execute: along the course, and to starboard of it."""
        course = self._course
        off = np.stack([self.north, self.east], axis=1)
        off = off - off[self.first]
        cosine, sine = np.cos(course), np.sin(course)
        return np.stack([cosine * off[:, 0] + sine * off[:, 1], cosine * off[:, 1] - sine * off[:, 0]], axis=1)

    @cached_property
    def travelled(self) -> np.ndarray:
        """The length of the path from the first execute, (n,) m; negative before it."""
        steps = np.hypot(np.diff(self.north), np.diff(self.east))
        path = np.concatenate([[0.0], np.cumsum(steps)])
        return path - path[self.first]

    @cached_property
    def rudder_integral(self) -> np.ndarray:
        """∫ δ dt, (n,) rad s: by the trapezoidal rule of the actual rudder, else of the orders, which are held."""
        values = self.order[:-1] if self.rudder is None else 0.5 * (self.rudder[1:] + self.rudder[:-1])
        return np.concatenate([[0.0], np.cumsum(np.diff(self.time) * values)])

    @property
    def side(self) -> float:
        """1 where the first order is to starboard, −1 to port."""
        ordered = self.order[np.flatnonzero(self.order)]
        return float(np.sign(ordered[0])) if len(ordered) else 1.0


def of_trial(dataset: AnyDataset) -> bool:
    """Whether it is a standard manoeuvre of one vehicle."""
    return TRIAL in dataset.attrs and "member" not in dataset.dims


def _turned(log: VehicleRecords, told: Table) -> np.ndarray:
    """The actual δ_R: of the fins' angles the part along their shares in turning."""
    shares = np.asarray(told["shares"], dtype=float)
    columns = [log.actuators[name].actual.reshape(len(log.time), -1) for name in dict.fromkeys(told["fins"])]
    return np.concatenate(columns, axis=1) @ shares / (shares @ shares)
