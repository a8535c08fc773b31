"""The section [mission]: set points by time, or way points, and what ends it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from coadjoint.cli.mission_file import MissionFile
from coadjoint.cli.units import unknown
from coadjoint.errors import ArgumentError
from coadjoint.models.underwater.log.columns import split

OTHERS = ("time", "between", "file", "ends", "bottom", "clearance", "way_points", "acceptance", "look_ahead")
"""The keys of [mission] that are no set points."""
SCALARS = ("depth", "altitude", "heading", "pitch", "roll", "speed")
"""Set points of one number."""
ENDS = ("surface", "bottom", "last way point")


def inputs(file: MissionFile, units: Mapping[str, str]) -> dict[str, Any]:
    """The set points and commands of [mission] by name: co.Held or co.Linear over `time`, or numbers that stay.

    units: what the pilot and the actuators take, with the unit of each. Raises ArgumentError for what nobody takes.
    """
    import coadjoint as co

    given = _plain(file)
    between = given.get("between", "held")
    if between not in ("held", "linear"):
        raise ArgumentError(f'[mission] between must be "held" or "linear", but is {between!r}.')
    found: dict[str, Any] = {}
    if "file" in given:
        from coadjoint.models.underwater.log.inputs import inputs_from_csv

        found |= inputs_from_csv(file.located(given["file"]), between=between)
    time = _numbers("time", given["time"]) if "time" in given else None
    for name, value in given.items():
        if name in OTHERS:
            continue
        values = _numbers(name, value)
        if np.ndim(values) == 0 or (time is None and name not in SCALARS):
            found[name] = values
        elif time is None:
            raise ArgumentError(
                f"[mission] {name} has {len(values)} values, so that it needs `time_s`, when each begins."
            )
        elif len(values) != len(time):
            raise ArgumentError(
                f"[mission] {name} must be one number, or a value for each of {len(time)} times, but has {len(values)}."
            )
        else:
            found[name] = (co.Held if between == "held" else co.Linear)(time, values)
    for name in found:
        if name not in units:
            raise ArgumentError(unknown(f"set point `{name}`", "Section [mission]", name, [*units, *OTHERS]))
    _require_units(file, units)
    return found


def _require_units(file: MissionFile, units: Mapping[str, str]) -> None:
    """Raise ArgumentError where the unit of a key is not one of what it measures."""
    for key in file.mission:
        name, unit, _ = (key, "", 1.0) if key in OTHERS else split(key)
        if unit and name in units and unit != units[name]:
            raise ArgumentError(f"[mission] `{name}` measures {units[name]}, but `{key}` is in {unit}.")


def _plain(file: MissionFile) -> dict[str, Any]:
    """[mission] under names without their units, in SI units and rad."""
    found: dict[str, Any] = {}
    for key, value in file.mission.items():
        name, _, factor = (key, "", 1.0) if key in OTHERS else split(key)
        if name in found:
            raise ArgumentError(f"Section [mission] gives `{name}` twice: once as `{key}`, once in another unit.")
        found[name] = value if factor == 1.0 else (factor * _numbers(key, value)).tolist()
    return found


def _numbers(name: str, value: Any) -> np.ndarray:
    try:
        found = np.asarray(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"[mission] {name} must hold numbers, but is {value!r}.") from error
    if not np.all(np.isfinite(found)) or isinstance(value, (bool, str)):
        raise ArgumentError(f"[mission] {name} must hold numbers, but is {value!r}.")
    return found


def way_points(file: MissionFile) -> dict[str, Any]:
    """The fields of a pilot that follows way points, as far as [mission] gives them."""
    given = _plain(file)
    return {name: given[name] for name in ("way_points", "acceptance", "look_ahead") if name in given}


def until(file: MissionFile, arrived: Any = None) -> Any:
    """The event that ends the mission before its time, None where nothing does; raises ArgumentError.

    arrived: the event that the last way point is reached, where there are way points.
    """
    given = _plain(file)
    if not given.get("ends"):
        return None
    from coadjoint.models.underwater.water import borders

    ends = given.get("ends", [])
    chosen = [ends] if isinstance(ends, str) else list(ends)
    events = []
    for end in chosen:
        if end not in ENDS:
            raise ArgumentError(unknown(f"end {end!r}", "Section [mission]", str(end), ENDS))
        if end == "surface":
            events.append(borders.at_surface())
        elif end == "bottom":
            if "bottom" not in given:
                raise ArgumentError('[mission] ends = "bottom" needs `bottom`, its depth in m.')
            events.append(borders.at_bottom(given["bottom"], given.get("clearance", 0.0)))
        elif arrived is None:
            raise ArgumentError('[mission] ends = "last way point" needs `way_points`.')
        else:
            events.append(arrived)
    return events[0] if len(events) == 1 else borders.first_of(*events)
