"""From a mission file to a craft, its start and what drives it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.mechanics.members import Each, count_members
from coadjoint.runs.initial import initial_values
from coadjoint.runs.setup import Setup
from coadjoint.runs.units import in_si, unknown
from coadjoint.units import split_name
from coadjoint.vehicles.figures.scenes import BOTTOM, GEOMETRY
from coadjoint.vehicles.figures.shapes import geometry
from coadjoint.vehicles.logs.headers import inside
from coadjoint.vehicles.missions import legs
from coadjoint.vehicles.missions.faults import faults
from coadjoint.vehicles.missions.perturb import perturbed, seeds
from coadjoint.vehicles.missions.results import require_room
from coadjoint.vehicles.missions.sensors import sensors_section
from coadjoint.vehicles.missions.vehicle import vehicle_of
from coadjoint.vehicles.missions.water import bottom as seabed
from coadjoint.vehicles.missions.water import water
from coadjoint.vehicles.water.borders import altitude

if TYPE_CHECKING:
    from coadjoint.vehicles.missions.file import MissionFile

START = ("position", "speed", "velocity", "euler_zyx", "angular_velocity", "actuators", "axes", "t")
"""What [initial] holds, beside yaw, pitch and roll, or heading, one by one."""


def set_up(file: MissionFile) -> Setup:
    """The system, its start, its inputs and the end of a mission; raises ArgumentError and FileError."""
    from coadjoint.models.quantities import vector
    from coadjoint.vehicles import axes as border
    from coadjoint.vehicles.files.checks import doubts_of_changes
    from coadjoint.vehicles.missions.measures import parameters_in_si
    from coadjoint.vehicles.model.craft import Craft
    from coadjoint.vehicles.model.measures import measures

    vehicle, doubts = vehicle_of(file)
    commands = {part.name: part.command.unit for part in vehicle.commanded if part.command is not None}
    begun = _start(file, commands)
    place = begun.get("position", (0.0, 0.0, 0.0))
    if isinstance(place, Each) and not len(legs.way_points(file)):
        place = place.member(0)  # Only way points ask for it.
    place = border.space_vector(vector(place, "position"), begun["axes"])
    controller = legs.following(file, _controller(file, vehicle), place)
    # What is mistaken in the file is told before gains are proposed, which takes a second.
    inputs = _inputs(file, vehicle, commands, {} if controller is None else controller.inputs)
    faulty = faults(file, vehicle)
    craft = Craft(vehicle, controller=controller, water=water(file, seeds(file)), faults=faulty)
    kinds = measures(craft)
    craft = craft.replace(**parameters_in_si("parameters", file.parameters, kinds))
    if file.parameters and count_members(craft.parameters.asdict()) is None:
        doubts += [f"With [parameters] {sentence}" for sentence in doubts_of_changes(craft)]
    start = craft.start(**begun)
    require_room(file, start)
    sensors_section(file, vehicle)
    grid = seabed(file)
    system = craft.system if grid is None else craft.system.watching({"altitude": altitude(grid)})
    if file.run.members > 1:
        system = perturbed(file, system, kinds)
        craft.replace(**system.parameters.asdict())  # refuses a member that cannot be
    legs.require_room_to_end(file, start.q)
    points = legs.way_points(file)
    arrived = legs.arrival(craft.controller) if len(points) else None
    told = {"vehicle_length": float(vehicle.length or 1.0)}
    told |= {"way_points": points.ravel().tolist()} if len(points) else {}
    told |= {GEOMETRY: json.dumps(geometry(vehicle))}
    told |= {} if (bottom := legs.bottom(file)) is None else {BOTTOM: bottom}
    return Setup(system, start, inputs or None, legs.until(file, arrived), told, doubts)


def _inputs(file: MissionFile, vehicle: Any, commands: dict[str, str], wanted: dict[str, str]) -> dict[str, Any]:
    """The inputs of [mission], all that the controller wants among them."""
    inputs = legs.inputs(file, {**commands, **wanted})
    lacking = [f"`{name}` ({unit})" for name, unit in wanted.items() if name not in inputs]
    if lacking:
        raise ArgumentError(
            f"Section [mission] needs {', '.join(lacking)}: the controller of {vehicle.name} takes them."
        )
    return inputs


def _controller(file: MissionFile, vehicle: Any) -> Any:
    """The controller of [controller]: that of `kind`, none with "none", or the vehicle's own with changes."""
    from coadjoint.vehicles.files.kinds import kinds
    from coadjoint.vehicles.model.measures import dimensions

    CONTROLLERS = kinds("controllers")

    given = dict(file.controller)
    kind = given.pop("kind", "")
    if kind == "none":
        if given:
            raise ArgumentError('Section [controller] with kind = "none" has no other keys.')
        return None
    if kind and kind not in CONTROLLERS:
        raise ArgumentError(unknown(f"kind {kind!r}", "Section [controller]", str(kind), [*CONTROLLERS, "none"]))
    if not kind and vehicle.controller is None:
        raise ArgumentError(
            f"The vehicle {vehicle.name} has no controller of its own: add a section [controller] with a kind of "
            f'{", ".join(sorted(CONTROLLERS))}, or kind = "none" to command its actuators in [mission].'
        )
    cls = CONTROLLERS[kind] if kind else type(vehicle.controller)
    known = [f.name for f in fields(cls)]
    values = in_si("controller", given, known, {**dict.fromkeys(known), **dimensions(cls)})
    try:
        return cls(**values) if kind else replace(vehicle.controller, **values)
    except TypeError as error:
        raise ArgumentError(f"Section [controller]: {str(error).split('() ')[-1]}.") from error


def _start(file: MissionFile, units: Mapping[str, str]) -> dict[str, Any]:
    """[initial] as keywords of `Craft.start`; units: those of the actuators."""
    given = dict(file.initial)
    axes = given.setdefault("axes", file.axes)
    if axes not in ("NED/FRD", "ENU/FLU"):
        raise ArgumentError(f'[initial] axes must be "NED/FRD" or "ENU/FLU", but is {axes!r}.')
    for key in [key for key in given if key.split("_")[0] == "heading"]:
        if axes != "NED/FRD":
            raise ArgumentError(f"[initial] {key} belongs to NED/FRD: give `yaw`, from east to the left, in {axes}.")
        given["yaw" + key.removeprefix("heading")] = given.pop(key)
    found = initial_values(given, START)
    if "actuators" in found:
        found["actuators"] = _actuators(found["actuators"], units)
    return found


def _actuators(given: Any, units: Mapping[str, str]) -> dict[str, np.ndarray]:
    """Where actuators start, by part, in SI units."""
    if not isinstance(given, dict):
        raise ArgumentError(f"[initial] actuators must be a table, as in {{ propeller_rpm = 900 }}, but is {given!r}.")
    found = {}
    for key, value in given.items():
        name, unit = split_name(key, units)
        if unit:
            legs.require_unit("[initial] actuators:", key, name, unit, units[name])
        if name in found:
            raise ArgumentError(f"[initial] actuators give `{name}` twice: once as `{key}`, once in another unit.")
        try:
            number = value if isinstance(value, Each) else np.asarray(value, dtype=float)
            found[name] = (inside(unit)[1] if unit else 1.0) * number
        except (TypeError, ValueError):
            raise ArgumentError(f"[initial] actuators must hold numbers, but {key} is {value!r}.") from None
    return found
