"""What a vehicle weighs and displaces with all that its parts hold, at the start of a run."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from coadjoint.spaces.named import Named, named
from coadjoint.vehicles.model.vehicle import Vehicle
from coadjoint.vehicles.parts.part import Part


def held_mass(parts: Iterable[Part]) -> tuple[float, np.ndarray]:
    """(Σ m, Σ m r) of the masses that parts hold, kg and kg m."""
    return _summed((lump[0], lump[1]) for part in parts if part.holds_mass for lump in part.lumps(*_start(part)))


def held_volume(parts: Iterable[Part]) -> tuple[float, np.ndarray]:
    """(Σ V, Σ V r) of what parts displace beyond the body, m³ and m⁴."""
    return _summed(held for part in parts if part.holds_mass for held in part.displaced(*_start(part)))


def total_mass(vehicle: Vehicle) -> float:
    """The mass of the body and of what its parts hold, kg."""
    return float(vehicle.mass) + held_mass(vehicle.parts)[0]


def total_volume(vehicle: Vehicle) -> float:
    """The volume of the body and of what its parts displace, m³."""
    return float(vehicle.volume) + held_volume(vehicle.parts)[0]


def center_of_all_mass(vehicle: Vehicle) -> np.ndarray:
    """(3,) m."""
    mass, moment = held_mass(vehicle.parts)
    return (vehicle.mass * np.asarray(vehicle.center_of_mass) + moment) / (vehicle.mass + mass)


def _summed(held: Iterable[tuple[Any, Any]]) -> tuple[float, np.ndarray]:
    total, moment = 0.0, np.zeros(3)
    for amount, position in held:
        total, moment = total + float(amount), moment + float(amount) * np.asarray(position, dtype=float)
    return total, moment


def _start(part: Part) -> tuple[Any, Named]:
    """The actuator where it starts, and the part's own numbers."""
    command = part.command
    actual = None if command is None else named(part.at_rest(np.full(command.shape, command.start)))
    return actual, Named(**part.parameters())
