"""Underwater vehicles (P57–P78; mathematics: section 10).

    vehicle = co.models.underwater.paper_vehicle()
    start = co.models.underwater.paper_start(vehicle)

**Axes.** The advected parameter is a = R⁻¹a₀, and a₀ is the direction of gravity in the space frame: it points *down*.
The Lagrangian holds the weight as +(mg − B) n·a, whatever the axes are called.
- The paper's axes: z points down, a₀ = (0, 0, 1), and q_z is a depth. A vehicle that is lighter than its water
  (mg < B) has q_z fall: it floats up. What the paper calls rising is a dive. Body axes that point down too: a centre of
  buoyancy above the mass centre has a negative third component, as in Table 1. So have ships' axes (north, east, down;
  forward, starboard, down).
- z up: pass `down=(0, 0, -1)` to `start`. Nothing else changes: q_z is then a height. Body vectors and matrices
  (centres, added mass, inertia) are stated in the body's own axes; if these point up as well, a centre of buoyancy
  above the mass centre has a positive third component.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

_HOMES = {
    "added_mass": ("added_mass_about", "added_mass_in_axes"),
    "capytaine": ("capytaine_added_mass",),
    "ellipsoids": ("displaced_mass", "ellipsoid", "ellipsoid_added_mass"),
    "general_form": ("general_vehicle", "se3_start", "se3_vehicle"),
    "log.inputs": ("inputs_from_csv",),
    "paper_form": ("start", "vehicle"),
    "remus": ("remus_100", "remus_start"),
    "slender_bodies": ("slender_body_added_mass",),
    "tables": ("PAPER_DURATION", "PAPER_STEP", "TABLE_1", "TABLE_2", "paper_start", "paper_vehicle"),
    "wamit": ("wamit_added_mass",),
    "parts.part": ("Command", "Flow", "Part"),
    "parts.damping": ("Damping",),
    "parts.hull": ("Hull",),
    "parts.derivatives": ("Derivatives",),
    "parts.fin": ("Fin",),
    "parts.propeller": ("Propeller",),
    "parts.published_curves": ("T200",),
    "parts.thrusters": ("Thrusters",),
    "parts.moving_mass": ("MovingMass",),
    "parts.ballast": ("Ballast",),
    "parts.lifting_body": ("LiftingBody",),
    "water.borders": ("altitude", "at_bottom", "at_surface", "first_of"),
    "water.currents": ("TIDES", "CurrentField", "TidalCurrent", "TimeCurrent"),
    "water.density": ("DensityTable", "ExponentialDensity", "LinearDensity"),
    "water.gauss_markov": ("GaussMarkovCurrent",),
    "water.profiles": ("LinearProfile", "LinearShear", "Logarithmic", "PowerLaw", "Sheared"),
    "water.sea": ("Sea",),
    "water.tables": ("CurrentTable",),
    "pilots.sawtooth": ("Sawtooth",),
    "gliding": ("Glide", "flattest_glides", "steady_glide", "trim"),
    "water.water": ("StillWater", "UniformWater", "Water"),
    "pilots.pilot": ("Pilot", "Sight"),
    "pilots.cruise": ("Cruise",),
    "pilots.attitude": ("Attitude",),
    "pilots.external": ("FunctionPilot",),
    "pilots.hover": ("Hover", "Manoeuvre", "Pose"),
    "pilots.line_of_sight": ("LineOfSight",),
    "pilots.proposed": ("proposed_pilot",),
    "vehicles.vehicle": ("Quantity", "Vehicle"),
    "vehicles.craft": ("Craft", "craft_of"),
    "vehicles.file": ("read_vehicle",),
    "vehicles.shelf": ("load_vehicle", "vehicle_names"),
    "vehicles.writing": ("vehicle_to_toml",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [*_HOME_OF]  # pyright: ignore[reportUnsupportedDunderAll]

if TYPE_CHECKING:
    from coadjoint.models.underwater.added_mass import added_mass_about as added_mass_about
    from coadjoint.models.underwater.added_mass import added_mass_in_axes as added_mass_in_axes
    from coadjoint.models.underwater.capytaine import capytaine_added_mass as capytaine_added_mass
    from coadjoint.models.underwater.ellipsoids import displaced_mass as displaced_mass
    from coadjoint.models.underwater.ellipsoids import ellipsoid as ellipsoid
    from coadjoint.models.underwater.ellipsoids import ellipsoid_added_mass as ellipsoid_added_mass
    from coadjoint.models.underwater.general_form import general_vehicle as general_vehicle
    from coadjoint.models.underwater.general_form import se3_start as se3_start
    from coadjoint.models.underwater.general_form import se3_vehicle as se3_vehicle
    from coadjoint.models.underwater.gliding import Glide as Glide
    from coadjoint.models.underwater.gliding import flattest_glides as flattest_glides
    from coadjoint.models.underwater.gliding import steady_glide as steady_glide
    from coadjoint.models.underwater.gliding import trim as trim
    from coadjoint.models.underwater.log.inputs import inputs_from_csv as inputs_from_csv
    from coadjoint.models.underwater.paper_form import start as start
    from coadjoint.models.underwater.paper_form import vehicle as vehicle
    from coadjoint.models.underwater.parts.ballast import Ballast as Ballast
    from coadjoint.models.underwater.parts.damping import Damping as Damping
    from coadjoint.models.underwater.parts.derivatives import Derivatives as Derivatives
    from coadjoint.models.underwater.parts.fin import Fin as Fin
    from coadjoint.models.underwater.parts.hull import Hull as Hull
    from coadjoint.models.underwater.parts.lifting_body import LiftingBody as LiftingBody
    from coadjoint.models.underwater.parts.moving_mass import MovingMass as MovingMass
    from coadjoint.models.underwater.parts.part import Command as Command
    from coadjoint.models.underwater.parts.part import Flow as Flow
    from coadjoint.models.underwater.parts.part import Part as Part
    from coadjoint.models.underwater.parts.propeller import Propeller as Propeller
    from coadjoint.models.underwater.parts.published_curves import T200 as T200
    from coadjoint.models.underwater.parts.thrusters import Thrusters as Thrusters
    from coadjoint.models.underwater.pilots.attitude import Attitude as Attitude
    from coadjoint.models.underwater.pilots.cruise import Cruise as Cruise
    from coadjoint.models.underwater.pilots.external import FunctionPilot as FunctionPilot
    from coadjoint.models.underwater.pilots.hover import Hover as Hover
    from coadjoint.models.underwater.pilots.hover import Manoeuvre as Manoeuvre
    from coadjoint.models.underwater.pilots.hover import Pose as Pose
    from coadjoint.models.underwater.pilots.line_of_sight import LineOfSight as LineOfSight
    from coadjoint.models.underwater.pilots.pilot import Pilot as Pilot
    from coadjoint.models.underwater.pilots.pilot import Sight as Sight
    from coadjoint.models.underwater.pilots.proposed import proposed_pilot as proposed_pilot
    from coadjoint.models.underwater.pilots.sawtooth import Sawtooth as Sawtooth
    from coadjoint.models.underwater.remus import remus_100 as remus_100
    from coadjoint.models.underwater.remus import remus_start as remus_start
    from coadjoint.models.underwater.slender_bodies import slender_body_added_mass as slender_body_added_mass
    from coadjoint.models.underwater.tables import PAPER_DURATION as PAPER_DURATION
    from coadjoint.models.underwater.tables import PAPER_STEP as PAPER_STEP
    from coadjoint.models.underwater.tables import TABLE_1 as TABLE_1
    from coadjoint.models.underwater.tables import TABLE_2 as TABLE_2
    from coadjoint.models.underwater.tables import paper_start as paper_start
    from coadjoint.models.underwater.tables import paper_vehicle as paper_vehicle
    from coadjoint.models.underwater.vehicles.craft import Craft as Craft
    from coadjoint.models.underwater.vehicles.craft import craft_of as craft_of
    from coadjoint.models.underwater.vehicles.file import read_vehicle as read_vehicle
    from coadjoint.models.underwater.vehicles.shelf import load_vehicle as load_vehicle
    from coadjoint.models.underwater.vehicles.shelf import vehicle_names as vehicle_names
    from coadjoint.models.underwater.vehicles.vehicle import Quantity as Quantity
    from coadjoint.models.underwater.vehicles.vehicle import Vehicle as Vehicle
    from coadjoint.models.underwater.vehicles.writing import vehicle_to_toml as vehicle_to_toml
    from coadjoint.models.underwater.wamit import wamit_added_mass as wamit_added_mass
    from coadjoint.models.underwater.water.borders import altitude as altitude
    from coadjoint.models.underwater.water.borders import at_bottom as at_bottom
    from coadjoint.models.underwater.water.borders import at_surface as at_surface
    from coadjoint.models.underwater.water.borders import first_of as first_of
    from coadjoint.models.underwater.water.currents import TIDES as TIDES
    from coadjoint.models.underwater.water.currents import CurrentField as CurrentField
    from coadjoint.models.underwater.water.currents import TidalCurrent as TidalCurrent
    from coadjoint.models.underwater.water.currents import TimeCurrent as TimeCurrent
    from coadjoint.models.underwater.water.density import DensityTable as DensityTable
    from coadjoint.models.underwater.water.density import ExponentialDensity as ExponentialDensity
    from coadjoint.models.underwater.water.density import LinearDensity as LinearDensity
    from coadjoint.models.underwater.water.gauss_markov import GaussMarkovCurrent as GaussMarkovCurrent
    from coadjoint.models.underwater.water.profiles import LinearProfile as LinearProfile
    from coadjoint.models.underwater.water.profiles import LinearShear as LinearShear
    from coadjoint.models.underwater.water.profiles import Logarithmic as Logarithmic
    from coadjoint.models.underwater.water.profiles import PowerLaw as PowerLaw
    from coadjoint.models.underwater.water.profiles import Sheared as Sheared
    from coadjoint.models.underwater.water.sea import Sea as Sea
    from coadjoint.models.underwater.water.tables import CurrentTable as CurrentTable
    from coadjoint.models.underwater.water.water import StillWater as StillWater
    from coadjoint.models.underwater.water.water import UniformWater as UniformWater
    from coadjoint.models.underwater.water.water import Water as Water


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"coadjoint.models.underwater has no `{name}`; it has: {', '.join(sorted(_HOME_OF))}.")
    value = getattr(import_module(f"{__name__}.{_HOME_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(_HOME_OF)
