"""REMUS 100: the shipped torpedo as a system, with or without a cruise controller, in a steady current."""

from __future__ import annotations

from typing import Any

from coadjoint.arrays import PyTree
from coadjoint.mechanics import State, System
from coadjoint.models.quantities import positive
from coadjoint_vehicles.controllers.cruise import Cruise
from coadjoint_vehicles.files.registry import load_vehicle
from coadjoint_vehicles.model.craft import Craft, craft_of
from coadjoint_vehicles.water.water import UniformWater

FINS = ("stern_planes", "rudder")


def remus_100(*, automatic: bool = True, current: object = (0.0, 0.0, 0.0)) -> System:
    """REMUS 100 on SO(3) × ℝ³ in a steady current: `Craft(load_vehicle("remus_100"), …).system`.

    automatic: whether the `Cruise` controller flies it, by the inputs `depth` (m), `heading` (rad) and `speed` (m/s
    through the water); without, inputs `stern_planes`, `rudder` (rad) and `propeller` (1/s) command the actuators, or
    they stay as they start. current: (3,) m/s, north, east, down; the parameter `water.velocity`.
    Energy has a line for each of `damping`, `hull`, `stern_planes`, `rudder`, `propeller`.
    """
    controller = Cruise() if automatic else None
    return Craft(load_vehicle("remus_100"), controller=controller, water=UniformWater(current)).system


def remus_start(
    vehicle: System,
    *,
    position: PyTree = (0.0, 0.0, 0.0),
    speed: object = 0.0,
    euler_zyx: object = (0.0, 0.0, 0.0),
    stern_planes: float = 0.0,
    rudder: float = 0.0,
    revolutions: float = 0.0,
) -> State:
    """The state at a position (north, east, depth) (m), going ahead at `speed` (m/s) through the water.

    euler_zyx: yaw, pitch, roll (rad). stern_planes, rudder: rad. revolutions: of the propeller, 1/s.
    """
    actuators = {"stern_planes": stern_planes, "rudder": rudder, "propeller": revolutions}
    return craft_of(vehicle).start(position=position, speed=speed, euler_zyx=euler_zyx, actuators=actuators)


def open_loop(*, fluid_density: Any, axial_drag: Any, crossflow_drag: Any, fin_lift_slope: Any, current: Any) -> System:
    """REMUS 100 without a controller, neutrally buoyant, with other values of the least certain parameters."""
    made = remus_100(automatic=False, current=current)
    density = positive(fluid_density, "fluid_density")
    parameters: PyTree = made.parameters
    return made.replace(
        fluid_density=density,
        volume=parameters.mass / density,
        hull={"axial_drag": axial_drag, "crossflow_drag": crossflow_drag},
        **{fin: {"lift_slope": fin_lift_slope} for fin in FINS},
    )
