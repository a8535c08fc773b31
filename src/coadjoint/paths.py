"""Paths such as `rudder.area`, of values in nested namespaces and dictionaries."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from coadjoint.arrays import PyTree


def paths(tree: PyTree, prefix: str = "", leaf: type = object) -> dict[str, Any]:
    """The values of a nested dictionary, or namespace with `asdict`, by their paths, in their order.

    Entries of tuples have their numbers for names, as in `net[0].weight`; a tuple of the class `leaf` is one value.
    """
    if isinstance(tree, tuple):
        named = {f"[{index}]": value for index, value in enumerate(tree)}
    else:
        named = tree if isinstance(tree, Mapping) else tree.asdict()
    found: dict[str, Any] = {}
    for name, value in named.items():
        whole = leaf is not object and isinstance(value, leaf)
        inner = not whole and (isinstance(value, (Mapping, tuple)) or hasattr(value, "asdict"))
        dot = "" if isinstance(value, tuple) else "."
        found |= paths(value, f"{prefix}{name}{dot}", leaf) if inner else {f"{prefix}{name}": value}
    return found


def respelled(name: str, known: Iterable[str]) -> str:
    """The path `rudder.area` among those that are known, of the name `rudder_area`; "" if there is none."""
    return next((path for path in known if path != name and path.replace(".", "_") == name), "")
