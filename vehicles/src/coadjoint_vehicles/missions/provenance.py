"""Where the numbers of a mission's vehicle are from, for reports."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from coadjoint.extending import Sourced, kept_inputs
from coadjoint.extending import shown_number as shown
from coadjoint_vehicles.files.registry import load_vehicle


def numbers(file: Path, table: Mapping[str, Any]) -> dict[str, list[Sourced]]:
    """The numbers of the vehicle of a mission file, with their sources, and where [parameters] changes them."""
    vehicle = _vehicle(file, table["vehicle"])
    changed = _names(table.get("parameters", {}))
    rows = []
    for key, told in vehicle.provenance.items():
        name = key.removeprefix("body.")
        where = "changed by [parameters] of the run file; " if _among(name, changed) else ""
        source = vehicle.sources.get(told.source, told.source)
        rows.append(Sourced(key, shown(told.value), told.unit, source, where + told.note))
    return {f"of the vehicle {vehicle.name}": rows}


def _vehicle(file: Path, section: Mapping[str, Any]) -> Any:
    if "file" not in section:
        return load_vehicle(str(section.get("name")))
    name = str(section["file"])
    place = kept_inputs(file).get(name, file.parent / name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # they are in the certificate
        return load_vehicle(place)


def _names(table: Mapping[str, Any], prefix: str = "") -> list[str]:
    found = []
    for key, value in table.items():
        inner = isinstance(value, Mapping) and "value" not in value
        found += _names(value, f"{prefix}{key}.") if inner else [prefix + key]
    return found


def _among(name: str, changed: list[str]) -> bool:
    return any(key == name or key.startswith(f"{name}_") for key in changed)
