"""Properties of a vehicle from its numbers alone: balance, righting, terminal speed."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from coadjoint.extending import brent
from coadjoint_vehicles.model.loads import loads
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.parts.allocator import LEAST_AUTHORITY
from coadjoint_vehicles.parts.part import Part
from coadjoint_vehicles.parts.propeller import Propeller
from coadjoint_vehicles.parts.thrusters import Thrusters
from coadjoint_vehicles.trim.under_way import Level

FASTEST = 50.0
"""m/s: no vehicle under water is faster."""


class Summary(NamedTuple):
    """mass, displaced_mass: including the parts, kg. net_weight: W − B, N, positive where it sinks.

    metacentric_height: of the centre of buoyancy above the centre of mass, m. terminal_speed: ahead, with everything
    that pushes ahead at its limit, m/s, or None.
    """

    mass: float
    displaced_mass: float
    net_weight: float
    metacentric_height: float
    terminal_speed: float | None


def summary(vehicle: Vehicle) -> Summary:
    """The summary of a vehicle with its parts in their starting positions."""
    all_of = loads(vehicle)
    height = float(all_of.center_of_mass[2] - vehicle.center_of_buoyancy[2])
    return Summary(all_of.mass, all_of.density * all_of.volume, all_of.net_weight, height, terminal_speed(vehicle))


def terminal_speed(vehicle: Vehicle) -> float | None:
    """u with X(u) = 0, straight and level, with everything that pushes ahead at its limit, m/s; None if nothing does.

    Fins, masses and ballast stay as they start.
    """
    push = _surge(vehicle)
    if not push(0.0) > 0 or not push(FASTEST) <= 0:
        return None
    return brent(push, 0.0, FASTEST, xtol=1e-12)


def without_terminal_speed(vehicle: Vehicle) -> str:
    """Why a vehicle has no terminal speed."""
    endless = [part.name for part in vehicle.parts if isinstance(part, Thrusters) and part.limit is None]
    if endless and not _surge(vehicle)(0.0) > 0:
        return f"no terminal speed: the thrusters `{endless[0]}` have no limit"
    if not _surge(vehicle)(0.0) > 0:
        return "no terminal speed: nothing pushes it ahead"
    return (
        f"no terminal speed: its drag does not hold what pushes ahead, not even at {FASTEST:g} m/s; is there damping "
        "in surge, and of the right sign?"
    )


def _surge(vehicle: Vehicle) -> Callable[[float], float]:
    """u ↦ X(u), N, straight and level, with everything that pushes ahead at its limit."""
    commands = np.concatenate([np.zeros(0), *(_ahead(part) for part in vehicle.commanded)])
    level = Level(vehicle)
    return lambda u: level.surge(u, commands)


def _ahead(part: Part) -> np.ndarray:
    """The commands of a part at which it pushes ahead as much as it can, in a row."""
    command = part.command
    assert command is not None
    start = np.full(command.shape, command.start, dtype=float)
    if isinstance(part, Propeller):
        return np.array([part.limit * np.sign(part.axis[0] * part.thrust[0])], dtype=float)
    if isinstance(part, Thrusters) and part.limit is not None:
        row = np.asarray(part.nominal_matrix)[0]
        low, high = (np.broadcast_to(limit, command.shape) for limit in part.limit)
        least = LEAST_AUTHORITY * np.max(np.abs(row))
        return np.where(row > least, high, np.where(row < -least, low, start))
    return np.ravel(start)
