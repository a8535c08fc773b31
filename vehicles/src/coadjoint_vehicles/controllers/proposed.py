"""A controller for a vehicle that has none: by its thrusters, or by its fins and propulsion."""

from __future__ import annotations

from coadjoint_vehicles.controllers.cruise import Cruise
from coadjoint_vehicles.controllers.hover import Manoeuvre
from coadjoint_vehicles.model.controller import Controller
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.thrusters import Thrusters


def proposed_controller(vehicle: Vehicle, speed: float = 1.5) -> Controller:
    """Depth, heading and speed: `Manoeuvre` where several thrusters push, `Cruise` for `speed` (m/s) where fins turn.

    Their gains are proposed from the vehicle's mass, damping and actuators. Raises ArgumentError where it has neither.
    """
    several = [part for part in vehicle.parts if isinstance(part, Thrusters) and part.count >= 3]
    return Manoeuvre(thrusters=several[0].name).fitted(vehicle) if several else Cruise(speed=speed).fitted(vehicle)


def own_controller(vehicle: Vehicle) -> Controller:
    """The controller that the vehicle is shipped with, or one that is proposed."""
    return proposed_controller(vehicle) if vehicle.controller is None else vehicle.controller
