"""Underwater vehicles: from a file of numbers and their sources to a craft that flies its mission.

    vehicle = co.vehicles.load("remus_100")
    water = co.vehicles.water.UniformWater((0.1, 0.2, 0.0))
    craft = co.vehicles.Craft(vehicle, controller=vehicle.controller, water=water)
    run = co.vehicles.load_mission("square.toml").run()

The packages: `parts`, `water`, `hydrodynamics` (added mass), `model` (vehicle and craft), `controllers`, `trim`,
`files`, `importing` (from other simulators), `logs`, `figures`, `missions`, `trials`, `serving` (for other programs,
over UDP), `environments` (for learning, by Gymnasium). Axes are north, east, down and forward, starboard, down; see
`axes`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    __all__ = ["load", "names", "read"]  # which have other names where they are defined

    from coadjoint_vehicles import axes as axes
    from coadjoint_vehicles import controllers as controllers
    from coadjoint_vehicles import environments as environments
    from coadjoint_vehicles import figures as figures
    from coadjoint_vehicles import files as files
    from coadjoint_vehicles import hydrodynamics as hydrodynamics
    from coadjoint_vehicles import importing as importing
    from coadjoint_vehicles import logs as logs
    from coadjoint_vehicles import missions as missions
    from coadjoint_vehicles import model as model
    from coadjoint_vehicles import parts as parts
    from coadjoint_vehicles import readings as readings
    from coadjoint_vehicles import remus as remus
    from coadjoint_vehicles import sensors as sensors
    from coadjoint_vehicles import serving as serving
    from coadjoint_vehicles import trials as trials
    from coadjoint_vehicles import trim as trim
    from coadjoint_vehicles import water as water
    from coadjoint_vehicles.environments.make import environment as environment
    from coadjoint_vehicles.environments.make import vector_environment as vector_environment
    from coadjoint_vehicles.files.file import read_vehicle as read
    from coadjoint_vehicles.files.registry import load_vehicle as load
    from coadjoint_vehicles.files.registry import vehicle_names as names
    from coadjoint_vehicles.importing.importing import import_vehicle as import_vehicle
    from coadjoint_vehicles.missions.mission import load_mission as load_mission
    from coadjoint_vehicles.model.controller import Controller as Controller
    from coadjoint_vehicles.model.controller import Feedback as Feedback
    from coadjoint_vehicles.model.craft import Craft as Craft
    from coadjoint_vehicles.model.vehicle import Vehicle as Vehicle
    from coadjoint_vehicles.parts.measured import measured as measured
    from coadjoint_vehicles.parts.part import Command as Command
    from coadjoint_vehicles.parts.part import Flow as Flow
    from coadjoint_vehicles.parts.part import Part as Part

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
