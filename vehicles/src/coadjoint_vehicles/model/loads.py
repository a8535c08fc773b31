"""Weight and displacement of a vehicle including its parts, at the start of a run."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.extending import named
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.part import Part


class Loads(NamedTuple):
    """Masses (kg) and volumes (m³), and their first moments about O, (3,) kg m and m⁴; gravity g and density ρ."""

    mass: float
    mass_moment: np.ndarray
    volume: float
    volume_moment: np.ndarray
    gravity: float
    density: float

    @property
    def net_weight(self) -> float:
        """W − B, N, positive where it sinks."""
        return (self.mass - self.density * self.volume) * self.gravity

    @property
    def righting(self) -> np.ndarray:
        """Σ m g r_g − Σ ρ V g r_b, (3,) N m: its cross product with the direction of down is the torque of both."""
        return (self.mass_moment - self.density * self.volume_moment) * self.gravity

    @property
    def center_of_mass(self) -> np.ndarray:
        """(3,) m."""
        return self.mass_moment / self.mass


def loads(vehicle: Vehicle) -> Loads:
    """Those of the body and of its parts."""
    mass, mass_moment, volume, volume_moment = held(vehicle.parts)
    m, V = float(vehicle.mass), float(vehicle.volume)
    return Loads(
        m + mass,
        m * np.asarray(vehicle.center_of_mass) + mass_moment,
        V + volume,
        V * np.asarray(vehicle.center_of_buoyancy) + volume_moment,
        float(vehicle.gravity),
        float(vehicle.fluid_density),
    )


def held(parts: Iterable[Part]) -> tuple[float, np.ndarray, float, np.ndarray]:
    """(Σ m, Σ m r, Σ V, Σ V r) of the masses and volumes of parts beyond the body, kg, kg m, m³ and m⁴."""
    holding = [(part, *_start(part)) for part in parts if part.holds_mass]
    masses = [(m, r) for part, *at in holding for m, r, _ in part.lumps(*at)]
    volumes = [one for part, *at in holding for one in part.displaced(*at)]
    return (*_summed(masses), *_summed(volumes))


def _summed(of: Iterable[tuple[PyTree, PyTree]]) -> tuple[float, np.ndarray]:
    total, moment = 0.0, np.zeros(3)
    for amount, position in of:
        total, moment = total + float(amount), moment + float(amount) * np.asarray(position, dtype=float)
    return total, moment


def _start(part: Part) -> tuple[PyTree, PyTree]:
    """The actuator where it starts, and the part's own numbers."""
    command = part.command
    actual = None if command is None else named(part.at_rest(np.full(command.shape, command.start)))
    return actual, named(part.parameters())
