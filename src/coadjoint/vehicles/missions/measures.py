"""The parameters of a vehicle in a mission file: their tables, and what each measures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any

from coadjoint.errors import ArgumentError
from coadjoint.paths import paths, respelled
from coadjoint.runs.units import in_si
from coadjoint.spaces.named import Named
from coadjoint.units import Dimension, split_name
from coadjoint.vehicles.missions.water import KINDS as OF_WATER
from coadjoint.vehicles.model.changed import part_of
from coadjoint.vehicles.model.craft import Craft
from coadjoint.vehicles.parts import measured
from coadjoint.vehicles.water.density import Density
from coadjoint.vehicles.water.profiles import Profile
from coadjoint.vehicles.water.water import Water


def parameters_in_si(title: str, given: Mapping[str, Any], kinds: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a section, and of tables in it such as [parameters.rudder], by their names and in SI units.

    kinds: what each measures, in dictionaries as the parameters are. Raises ArgumentError as `in_si`, and for a name
    that was in use before, with the one that it has now.
    """
    known = paths(kinds)
    tables = {key: value for key, value in given.items() if isinstance(kinds.get(key), Mapping)}
    for key, value in tables.items():
        if not isinstance(value, Mapping):
            first = next(iter(kinds[key]), "…")
            raise ArgumentError(
                f"[{title}] {key} is several numbers, of which each has its key, as in {key}.{first} = …, but is "
                f"{value!r}."
            )
    for key in given:
        name, _ = split_name(key, [path.replace(".", "_") for path in known])
        if path := respelled(f"controller_{name[6:]}" if name.startswith("pilot_") else name, known):
            raise ArgumentError(f"[{title}] `{key}` is called `{path}`: write {path} = …, with its unit at the end.")
    alone = in_si(title, {key: value for key, value in given.items() if key not in tables}, list(kinds), kinds)
    inner = {key: parameters_in_si(f"{title}.{key}", value, kinds[key]) for key, value in tables.items()}
    return {**alone, **inner}


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
