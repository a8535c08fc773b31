"""The kinds of parts and controllers in files: every class of their packages with a word for it."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any


@cache
def kinds(room: str) -> dict[str, type[Any]]:
    """The classes of "parts" or "controllers" by their `kind`: those in the `__init__` of that package."""
    module = import_module(f"coadjoint_vehicles.{room}")
    found = [getattr(module, name) for name in module.__all__]
    return {made.kind: made for made in found if isinstance(made, type) and getattr(made, "kind", "")}


def kind_of(made: Any) -> str:
    """The kind of a part or a controller: the word for it in vehicle files."""
    return made.kind or type(made).__name__.lower()
