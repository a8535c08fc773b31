"""Values by their paths, as in `rudder.area`, put into dictionaries in dictionaries."""

from __future__ import annotations

from collections.abc import Mapping

from coadjoint.arrays import PyTree


def nested(values: Mapping[str, PyTree]) -> dict[str, PyTree]:
    """{"rudder": {"area": 1.0}} of {"rudder.area": 1.0}."""
    found: dict[str, PyTree] = {}
    for path, value in values.items():
        *rooms, name = path.split(".")
        place = found
        for room in rooms:
            place = place.setdefault(room, {})
        place[name] = value
    return found
