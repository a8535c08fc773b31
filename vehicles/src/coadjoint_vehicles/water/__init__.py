"""The water that a craft moves through: currents and density."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    from coadjoint_vehicles.water.bottom import Bottom as Bottom
    from coadjoint_vehicles.water.currents import TIDES as TIDES
    from coadjoint_vehicles.water.currents import CurrentField as CurrentField
    from coadjoint_vehicles.water.currents import TidalCurrent as TidalCurrent
    from coadjoint_vehicles.water.currents import TimeCurrent as TimeCurrent
    from coadjoint_vehicles.water.density import DensityTable as DensityTable
    from coadjoint_vehicles.water.density import ExponentialDensity as ExponentialDensity
    from coadjoint_vehicles.water.density import LinearDensity as LinearDensity
    from coadjoint_vehicles.water.gauss_markov import GaussMarkovCurrent as GaussMarkovCurrent
    from coadjoint_vehicles.water.profiles import LinearProfile as LinearProfile
    from coadjoint_vehicles.water.profiles import LinearShear as LinearShear
    from coadjoint_vehicles.water.profiles import Logarithmic as Logarithmic
    from coadjoint_vehicles.water.profiles import PowerLaw as PowerLaw
    from coadjoint_vehicles.water.profiles import Sheared as Sheared
    from coadjoint_vehicles.water.sea import Sea as Sea
    from coadjoint_vehicles.water.surface_bottom import altitude as altitude
    from coadjoint_vehicles.water.surface_bottom import at_bottom as at_bottom
    from coadjoint_vehicles.water.surface_bottom import at_surface as at_surface
    from coadjoint_vehicles.water.surface_bottom import first_of as first_of
    from coadjoint_vehicles.water.tables import CurrentTable as CurrentTable
    from coadjoint_vehicles.water.water import StillWater as StillWater
    from coadjoint_vehicles.water.water import UniformWater as UniformWater
    from coadjoint_vehicles.water.water import Water as Water

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
