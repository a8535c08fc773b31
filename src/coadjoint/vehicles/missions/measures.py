"""What parameters of a vehicle measure, by which the unit at the end of a key is checked."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from coadjoint.units import Dimension
from coadjoint.vehicles.missions.water import KINDS as OF_WATER
from coadjoint.vehicles.parts import measured


def measures(names: Iterable[str], vehicle: Any, controller: Any) -> dict[str, Dimension | None]:
    """What each parameter measures, by name: the body's, `<part>_<field>`, `water_<field>`, `controller_<field>`."""
    found = {**dimensions(vehicle), **{f"water_{name}": what for name, what in OF_WATER.items()}}
    for part in vehicle.parts:
        found |= {f"{part.name}_{key}": dimension for key, dimension in dimensions(part).items()}
    if controller is not None:
        found |= {f"controller_{key}": dimension for key, dimension in dimensions(controller).items()}
    return {name: found.get(name) for name in names}


def dimensions(of: Any) -> dict[str, Dimension | None]:
    """What the fields of a class, or of one of it, measure; None for what no unit does."""
    return {name: found.dimension for name, found in measured.measures(of).items()}
