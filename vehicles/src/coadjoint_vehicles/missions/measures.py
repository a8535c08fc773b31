"""The parameters of a vehicle in a mission file: their tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from coadjoint.errors import ArgumentError
from coadjoint.paths import paths, respelled
from coadjoint.sections import in_si
from coadjoint.texts import Table
from coadjoint.units import Dimension, split_name


def parameters_in_si(title: str, given: Mapping[str, Any], kinds: Mapping[str, Any]) -> Table:
    """The values of a section, and of tables in it such as [parameters.rudder], by their names and in SI units.

    kinds: the dimension of each, in dictionaries as the parameters are. Raises ArgumentError as `in_si`, and for a name
    that was in use before, with the one that it has now.
    """
    known = paths(kinds, leaf=Dimension)
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
