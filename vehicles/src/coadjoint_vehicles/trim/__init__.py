"""Steady motions of vehicles: flight straight ahead, on a slope or in a circle, gliding, at rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    from coadjoint_vehicles.trim.flight import SteadyFlight as SteadyFlight
    from coadjoint_vehicles.trim.reading import Trim as Trim
    from coadjoint_vehicles.trim.reading import trim as trim

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
