"""The kinds of parts, sensors and controllers in files: the library's classes, and those of other packages."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from coadjoint.errors import ArgumentError
from coadjoint.extending import Registry, import_string

ADDED: dict[str, Registry[str]] = {
    section: Registry(section.upper()) for section in ("parts", "sensors", "controllers")
}
"""Kinds of packages above, in their tables `PARTS`, `SENSORS` and `CONTROLLERS`: "module:Class" by the kind."""


def kinds(section: str) -> dict[str, type[Any]]:
    """The classes of "parts", "sensors" or "controllers" by their `kind`, those in the `__init__` of a package first.

    Raises ArgumentError where a package above adds a kind that exists already, or a class of another kind.
    """
    module = import_module(f"coadjoint_vehicles.{section}")
    own = [getattr(module, name) for name in module.__all__]
    found = {made.kind: made for made in own if isinstance(made, type) and getattr(made, "kind", "")}
    for kind, place in ADDED[section].items():
        made = import_string(place)
        if kind in found or made.kind != kind:
            why = "exists already" if kind in found else f"is {made.kind!r} in the class"
            raise ArgumentError(f"The table {section.upper()} adds {place} as the kind {kind!r}, which {why}.")
        found[kind] = made
    return found


def kind_of(made: Any) -> str:
    """The kind of a part or a controller: the word for it in vehicle files."""
    return made.kind or type(made).__name__.lower()
