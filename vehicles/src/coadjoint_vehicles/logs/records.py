"""A vehicle's run in the words of engineers: position, attitude, speeds, set points, actuators, current."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError

if TYPE_CHECKING:
    from coadjoint.labelled import AnyDataset

NEEDED = ("n", "nu", "xi", "a_down", "a_north")
"""The variables that make a run a vehicle's: its place and velocities, and down and north in body axes."""

GUIDED = "internal_controller_value_memory_wanted_"
"""How the variables begin that hold the set points of guidance."""


@dataclass(frozen=True)
class Actuator:
    """The actual values of an actuator, (nodes,) or (nodes, k), its commands, if they are known, and its limits."""

    actual: np.ndarray
    unit: str
    command: np.ndarray | None = None
    low: PyTree = None
    high: PyTree = None

    @property
    def ends(self) -> list[np.ndarray]:
        """Its limits, numbers or those of each thruster, (k,)."""
        return [np.asarray(end, dtype=float) for end in (self.low, self.high) if end is not None]


@dataclass(frozen=True, eq=False)
class VehicleRecords:
    """The records of one run of a vehicle, north, east, down and forward, starboard, down; SI units and rad.

    With d and b the directions of down and north in the body frame, the vehicle is at (n·b, n·(d × b), n·d), its pitch
    is atan2(−d_x, |(d_y, d_z)|), its roll atan2(d_y, d_z), its heading atan2((d × b)_x, b_x).
    """

    dataset: AnyDataset

    def __post_init__(self):
        if not is_vehicle(self.dataset):
            raise ArgumentError(
                "Tracks and logs are of vehicles whose advected parameters are `down` and `north`, such as those "
                f"of coadjoint_vehicles, but the run of {self.dataset.attrs.get('system', 'this system')} "
                f"has {', '.join(sorted(map(str, self.dataset.data_vars)))}."
            )
        if "member" in self.dataset.dims:
            raise ArgumentError("A log is of one run: choose a member of the ensemble with dataset.isel(member=0).")

    @cached_property
    def time(self) -> np.ndarray:
        """(nodes,), s."""
        return self._values("time")

    @cached_property
    def directions(self) -> np.ndarray:
        """North, east and down in the body frame, (nodes, 3, 3): the rotation from the body to space."""
        down, north = self._values("a_down"), self._values("a_north")
        return np.stack([north, np.cross(down, north), down], axis=1)

    @cached_property
    def position(self) -> np.ndarray:
        """North, east and depth of the origin, (nodes, 3), m."""
        return np.einsum("kij,kj->ki", self.directions, self._values("n"))

    @property
    def depth(self) -> np.ndarray:
        """(nodes,), m."""
        return self.position[:, 2]

    @cached_property
    def attitude(self) -> np.ndarray:
        """Roll, pitch and heading, (nodes, 3), rad."""
        north, east, down = np.moveaxis(self.directions, 1, 0)
        roll = np.arctan2(down[:, 1], down[:, 2])
        pitch = np.arctan2(-down[:, 0], np.hypot(down[:, 1], down[:, 2]))
        return np.stack([roll, pitch, np.arctan2(east[:, 0], north[:, 0])], axis=1)

    @property
    def velocity(self) -> np.ndarray:
        """Surge, sway and heave over ground, body axes, (nodes, 3), m/s."""
        return self._at_node("nu")

    @property
    def rates(self) -> np.ndarray:
        """Roll, pitch and yaw rates, body axes, (nodes, 3), rad/s."""
        return self._at_node("xi")

    def _at_node(self, name: str) -> np.ndarray:
        """Velocities at the nodes, which older files have under names of their own."""
        return self._values(f"node_{name}" if f"node_{name}" in self.dataset else name)

    @property
    def current(self) -> np.ndarray | None:
        """The velocity of the water, space axes, (nodes, 3), m/s; None if the run has no record of it."""
        return self._values("current") if "current" in self.dataset else None

    @cached_property
    def through_water(self) -> np.ndarray:
        """Surge, sway and heave through the water, body axes, (nodes, 3), m/s."""
        if self.current is None:
            return self.velocity
        return self.velocity - np.einsum("kij,ki->kj", self.directions, self.current)

    @cached_property
    def set_points(self) -> dict[str, tuple[np.ndarray, str]]:
        """The set points of the controller, by name, with their units, and those that guidance gives its helm."""
        found = {name: self._with_unit(f"inputs_{name}") for name in self._named("inputs_")}
        for name in self._named(GUIDED):
            held = self._values(f"{GUIDED}{name}")
            # A node holds what was computed at the one before.
            found[name] = np.append(held[1:], held[-1:]), "m" if name == "depth" else "rad"
        return {name: value for name, value in found.items() if name not in self.actuators}

    @cached_property
    def actuators(self) -> dict[str, Actuator]:
        """The actual values, commands and limits of every actuator, by its name."""
        names = [name for name in self._named("internal_") if name.split("_")[0] not in ("controller", "water")]
        return {name: self._actuator(name) for name in names}

    @cached_property
    def way_points(self) -> np.ndarray:
        """North, east and depth of the way points, (k, 3), m; empty for a run without way points."""
        return np.asarray(self.dataset.attrs.get("way_points", ()), dtype=float).reshape(-1, 3)

    @property
    def work(self) -> dict[str, np.ndarray]:
        """The energy that each part has put in since the start, J."""
        return {name: self._values(f"work_{name}") for name in self._named("work_")}

    def _actuator(self, name: str) -> Actuator:
        actual, unit = self._with_unit(f"internal_{name}")
        sources = (f"internal_controller_value_{name}", f"internal_controller_value_commands_{name}", f"inputs_{name}")
        command = next((self._values(source) for source in sources if source in self.dataset), None)
        limits = self.dataset[f"internal_{name}"].attrs
        return Actuator(actual, unit, command, limits.get("low"), limits.get("high"))

    def _named(self, prefix: str) -> list[str]:
        return [str(key)[len(prefix) :] for key in self.dataset.data_vars if str(key).startswith(prefix)]

    def _with_unit(self, name: str) -> tuple[np.ndarray, str]:
        return self._values(name), str(self.dataset[name].attrs.get("units", ""))

    def _values(self, name: str) -> np.ndarray:
        return np.asarray(self.dataset[name], dtype=float)


def is_vehicle(dataset: AnyDataset) -> bool:
    """Whether a dataset is a vehicle's, with directions of down and north."""
    return all(name in dataset for name in NEEDED) and dataset["n"].shape[-1] == 3
