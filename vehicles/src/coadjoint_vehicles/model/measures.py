"""The dimension of each parameter of a vehicle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import is_dataclass

from coadjoint.arrays import PyTree
from coadjoint.paths import paths
from coadjoint.sections import keys
from coadjoint.spaces import Named
from coadjoint.units import Dimension
from coadjoint_vehicles.model.changed import part_of
from coadjoint_vehicles.model.vehicle import Vehicle
from coadjoint_vehicles.water.density import Density
from coadjoint_vehicles.water.dimensions import DIMENSIONS as OF_WATER
from coadjoint_vehicles.water.profiles import Profile
from coadjoint_vehicles.water.water import Water


def measures(vehicle: Vehicle, parameters: Named, owners: Mapping[str, object]) -> dict[str, object]:
    """The dimension of each parameter of a craft, in dictionaries as its parameters are; None if none applies.

    owners: the parts of the craft that groups of parameters belong to, by the names of the groups.
    """
    of_body = dimensions(vehicle)
    return {
        name: _measures(value, owners[name]) if isinstance(value, Named) else of_body.get(name)
        for name, value in parameters.asdict().items()
    }


def _measures(parameters: Named, owner: object) -> dict[str, object]:
    own = dimensions(owner) if is_dataclass(owner) else {}
    own = OF_WATER if isinstance(owner, (Water, Density, Profile)) else own
    return {
        name: _measures(value, part_of(owner, name)) if isinstance(value, Named) else own.get(name)
        for name, value in parameters.asdict().items()
    }


def dimensions(of: object) -> dict[str, Dimension | None]:
    """The dimensions of the fields of a class, or of an instance; None if none applies."""
    return {name: found.dimension for name, found in keys(of).items()}


def parameter_units(vehicle: Vehicle, parameters: Named, owners: Mapping[str, PyTree]) -> dict[str, str]:
    """The SI unit of each parameter of a craft that measures one thing, by its path as "rudder.area"."""
    known = paths(measures(vehicle, parameters, owners), leaf=Dimension).items()
    return {path: kind.si.replace("^2", "²").replace("^3", "³") for path, kind in known if kind is not None}
