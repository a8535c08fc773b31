"""A vehicle as data, and the craft that it makes with a controller in its water: energies, loads, actuators, starts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.extending import lazy

if TYPE_CHECKING:
    from coadjoint_vehicles.model.craft import Craft as Craft
    from coadjoint_vehicles.model.craft import craft_of as craft_of
    from coadjoint_vehicles.model.faults import Fault as Fault
    from coadjoint_vehicles.model.vehicle import Quantity as Quantity
    from coadjoint_vehicles.model.vehicle import Vehicle as Vehicle

if not TYPE_CHECKING:
    __getattr__, __dir__, __all__ = lazy(__name__)
