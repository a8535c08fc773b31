"""The section [faults] of a mission: actuators that stand from a time, or a depth, on; payloads that are dropped."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint import units as u
from coadjoint.errors import ArgumentError
from coadjoint.runs.units import in_si, unknown
from coadjoint.units import split_name
from coadjoint.vehicles.logs.headers import inside
from coadjoint.vehicles.missions import lost_sensors as sensors
from coadjoint.vehicles.missions.lost_sensors import is_of_sensor, lost_sensors

if TYPE_CHECKING:
    from coadjoint.vehicles.missions.file import MissionFile
    from coadjoint.vehicles.model.faults import Fault

KEYS = ("part", "stuck", "out", "dropped", "time", "depth")
"""What a table [faults.NAME] holds."""
ACTIONS = ("stuck", "out", "dropped")
MEASURED = {"time": u.TIME, "depth": u.LENGTH}


def faults(file: MissionFile, vehicle: Any) -> list[Fault]:
    """The faults of [faults.NAME]; raises ArgumentError for what a vehicle cannot have."""
    lost_sensors(file)
    return [_fault(name, table, vehicle) for name, table in file.faults.items() if not is_of_sensor(table)]


def _fault(name: str, given: Any, vehicle: Any) -> Fault:
    from coadjoint.vehicles.model.faults import Fault

    title = f"faults.{name}"
    if not isinstance(given, dict):
        raise ArgumentError(f'[faults] holds tables, as in [faults.{name}] with part = "rudder", but is {given!r}.')
    table, action = _split(title, given)
    part = str(table.get("part", ""))
    known = [one.name for one in vehicle.commanded]
    if part not in known:
        raise ArgumentError(unknown(f"actuator {part!r}", f"[{title}] part: the vehicle", part, known))
    value, which = _stands(title, action, table[action], vehicle.part(part), given)
    begins = {key: table[key] for key in ("time", "depth") if key in table}
    if len(begins) != 1:
        raise ArgumentError(f"[{title}] needs one of `time_s` and `depth_m`, from which on it is there.")
    found = in_si(title, begins, list(begins), {key: MEASURED[key] for key in begins})
    key, begin = next(iter(found.items()))
    if np.ndim(begin) or isinstance(begin, bool):
        raise ArgumentError(f"[{title}] {key} must be one number, but is {begin!r}.")
    if key == "time":
        return Fault(part, value, which, time=float(begin), name=name)
    depth = float(begin)
    return Fault(part, value, which, when=lambda motion, p: motion.q[2] - depth, name=name)


def _split(title: str, given: dict[str, Any]) -> tuple[dict[str, Any], str]:
    """The table by names without units, those of `time` and `depth` in SI, and what happens."""
    table: dict[str, Any] = {}
    for key, value in given.items():
        name = key if key in KEYS else split_name(key)[0]
        if name not in KEYS:
            raise ArgumentError(unknown(f"key `{key}`", f"Section [{title}]", name, KEYS))
        table[name] = in_si(title, {key: value}, [name], {name: MEASURED[name]})[name] if name in MEASURED else value
    actions = [name for name in ACTIONS if name in table]
    if len(actions) != 1:
        raise ArgumentError(
            f"[{title}] needs one of `stuck`, `out` and `dropped`, but has {', '.join(actions) or 'none'}."
        )
    return table, actions[0]


def _stands(title: str, action: str, value: Any, part: Any, given: dict[str, Any]) -> tuple[Any, Any]:
    """(where the part stands, which of its thrusters)."""
    if action == "stuck":
        if value is True:
            return None, None
        unit = next((split_name(key)[1] for key in given if key.startswith("stuck_")), "")
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ArgumentError(f"[{title}] stuck must be a number, or true: where it is then; not {value!r}.")
        if not unit:
            return float(value), None
        si, factor = inside(unit)
        if si != part.command.unit:
            raise ArgumentError(
                f"[{title}] stuck_{unit} is in {si}, but {part.name} stands in {part.command.unit}: give it in "
                "a unit of that."
            )
        return float(value) * factor, None
    if action == "dropped":
        if value is not True or part.kind != "payload":
            raise ArgumentError(
                f"[{title}] dropped = true is of a payload, but {part.name} is of the kind {part.kind}."
            )
        return 1.0, None
    rest = 0.0 if part.command is None else part.command.start
    if value is True:
        return rest, None
    numbers = value if isinstance(value, list) else [value]
    if not all(isinstance(number, int) and not isinstance(number, bool) and number >= 1 for number in numbers):
        raise ArgumentError(f"[{title}] out must be true, or the numbers of thrusters from 1, but is {value!r}.")
    return rest, tuple(number - 1 for number in numbers)


def sentences(file: MissionFile, dataset: Any) -> list[str]:
    """A sentence on each fault for the card: from when on it was there; saved nodes only."""
    found_sentences = []
    for name, table in file.faults.items():
        found = None if is_of_sensor(table) else dataset.get(f"internal_faults_{name}")
        if found is None:
            continue
        said = ", ".join(f"{key} = {value!r}" for key, value in table.items() if key != "part")
        there = np.asarray(found.values) > 0.5
        first = np.argmax(there, axis=-1)
        times = np.asarray(dataset.time.values)[first]
        if not np.any(there):
            found_sentences.append(f"The fault `{name}` of {table['part']} ({said}) did not come.")
        elif there.ndim > 1:
            found_sentences.append(
                f"The fault `{name}` of {table['part']} ({said}) came to {int(there.any(-1).sum())} members."
            )
        else:
            found_sentences.append(f"From t = {float(times):.6g} s on, fault `{name}` of {table['part']}: {said}.")
    return [*found_sentences, *sensors.sentences(file, dataset)]
