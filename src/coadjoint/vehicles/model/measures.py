"""What each parameter of a vehicle measures."""

from __future__ import annotations

from dataclasses import is_dataclass
from typing import TYPE_CHECKING, Any

from coadjoint.paths import paths
from coadjoint.spaces.named import Named
from coadjoint.units import Dimension
from coadjoint.vehicles.model.changed import part_of
from coadjoint.vehicles.parts import measured
from coadjoint.vehicles.water.density import Density
from coadjoint.vehicles.water.dimensions import DIMENSIONS as OF_WATER
from coadjoint.vehicles.water.profiles import Profile
from coadjoint.vehicles.water.water import Water

if TYPE_CHECKING:
    from coadjoint.vehicles.model.craft import Craft


def measures(craft: Craft) -> dict[str, Any]:
    """What each parameter of a craft measures, in dictionaries as its parameters are; None for what no unit does."""
    of_body = dimensions(craft.vehicle)
    return {
        name: _measures(value, craft.owners[name]) if isinstance(value, Named) else of_body.get(name)
        for name, value in craft.parameters.asdict().items()
    }


def _measures(parameters: Named, owner: Any) -> dict[str, Any]:
    own = dimensions(owner) if is_dataclass(owner) else {}
    own = OF_WATER if isinstance(owner, (Water, Density, Profile)) else own
    return {
        name: _measures(value, part_of(owner, name)) if isinstance(value, Named) else own.get(name)
        for name, value in parameters.asdict().items()
    }


def dimensions(of: Any) -> dict[str, Dimension | None]:
    """What the fields of a class, or of one of it, measure; None for what no unit does."""
    return {name: found.dimension for name, found in measured.measures(of).items()}


def parameter_units(craft: Craft) -> dict[str, str]:
    """The SI unit of each parameter of a craft that measures one thing, by its path as "rudder.area"."""
    known = paths(measures(craft)).items()
    return {path: kind.si.replace("^2", "²").replace("^3", "³") for path, kind in known if kind is not None}
