"""Underwater vehicles: from a file of numbers and their sources to a craft that flies its mission.

    vehicle = co.vehicles.load("remus_100")
    water = co.vehicles.water.UniformWater((0.1, 0.2, 0.0))
    craft = co.vehicles.Craft(vehicle, controller=vehicle.controller, water=water)
    run = co.vehicles.load_mission("square.toml").run()

The packages: `parts`, `water`, `hydrodynamics` (added mass), `model` (vehicle and craft), `controllers`, `trim`,
`files`, `importing` (from other simulators), `logs`, `figures`, `missions`, `serving` (for other programs, over UDP),
`environments` (for learning, by Gymnasium). Axes are north, east, down and forward,
starboard, down; see `axes`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    __all__ = ["load", "names", "read"]  # which have other names where they are defined

    from coadjoint.vehicles import axes as axes
    from coadjoint.vehicles import controllers as controllers
    from coadjoint.vehicles import environments as environments
    from coadjoint.vehicles import figures as figures
    from coadjoint.vehicles import files as files
    from coadjoint.vehicles import hydrodynamics as hydrodynamics
    from coadjoint.vehicles import importing as importing
    from coadjoint.vehicles import logs as logs
    from coadjoint.vehicles import missions as missions
    from coadjoint.vehicles import model as model
    from coadjoint.vehicles import parts as parts
    from coadjoint.vehicles import readings as readings
    from coadjoint.vehicles import remus as remus
    from coadjoint.vehicles import sensors as sensors
    from coadjoint.vehicles import serving as serving
    from coadjoint.vehicles import trim as trim
    from coadjoint.vehicles import water as water
    from coadjoint.vehicles.environments.make import environment as environment
    from coadjoint.vehicles.environments.make import vector_environment as vector_environment
    from coadjoint.vehicles.files.file import read_vehicle as read
    from coadjoint.vehicles.files.registry import load_vehicle as load
    from coadjoint.vehicles.files.registry import vehicle_names as names
    from coadjoint.vehicles.importing.importing import import_vehicle as import_vehicle
    from coadjoint.vehicles.missions.mission import load_mission as load_mission
    from coadjoint.vehicles.model.controller import Controller as Controller
    from coadjoint.vehicles.model.controller import Feedback as Feedback
    from coadjoint.vehicles.model.craft import Craft as Craft
    from coadjoint.vehicles.model.vehicle import Vehicle as Vehicle
    from coadjoint.vehicles.parts.part import Command as Command
    from coadjoint.vehicles.parts.part import Flow as Flow
    from coadjoint.vehicles.parts.part import Part as Part

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
