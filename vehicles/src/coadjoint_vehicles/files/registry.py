"""Shipped vehicles and a user's own, by name or path."""

from __future__ import annotations

import os
from pathlib import Path

from coadjoint.errors import ArgumentError, nearest
from coadjoint_vehicles.files.bodies import DATA
from coadjoint_vehicles.files.file import read_vehicle, vehicle_from_text
from coadjoint_vehicles.model.vehicle import Vehicle


def vehicle_names() -> list[str]:
    """The names of the vehicles that are shipped. Sets that disagree on one vehicle have names of their own."""
    return sorted(entry.name.removesuffix(".toml") for entry in DATA.iterdir() if entry.name.endswith(".toml"))


def is_path(name: str) -> bool:
    """Whether this is the path of a file rather than the name of a shipped vehicle."""
    return name.endswith(".toml") or os.sep in name


def vehicle_text(name: str) -> str:
    """The file of a shipped vehicle, as a template; raises ArgumentError for an unknown name."""
    known = vehicle_names()
    if name not in known:
        near = nearest(name, known, 0.4)
        hint = f"did you mean `{near}`? There are" if near else "there are"
        raise ArgumentError(
            f"No vehicle `{name}` is shipped: {hint} {', '.join(known)}. A file of one's own ends in .toml."
        )
    return (DATA / f"{name}.toml").read_text(encoding="utf-8")


def load_vehicle(name: str | os.PathLike[str]) -> Vehicle:
    """A shipped vehicle, by name, or a user's own, by the path of its TOML file.

    `vehicle.warnings` lists doubtful values; for a user's own file they are also warnings.
    Raises ArgumentError, and FileError for a file that cannot be read.
    """
    text = os.fspath(name) if isinstance(name, (str, os.PathLike)) else None
    if not isinstance(text, str):
        raise ArgumentError(f"Argument `name` must be the name of a vehicle or the path of its file, but is {name!r}.")
    if is_path(text) or isinstance(name, Path):
        return read_vehicle(text)
    return vehicle_from_text(vehicle_text(text), f"{text}.toml")
