"""From a mission file to a craft, its start and its inputs."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import Setup
from coadjoint.mechanics.members import Each, count_members
from coadjoint.models.quantities import vector as three
from coadjoint.sections import Key, in_si, keys, of_section
from coadjoint.texts import Table
from coadjoint.units import ending, split_name
from coadjoint.units import in_si as in_si_units
from coadjoint_vehicles.figures.shapes import BOTTOM, GEOMETRY, geometry
from coadjoint_vehicles.logs.headers import inside
from coadjoint_vehicles.missions.electric import supply
from coadjoint_vehicles.missions.mission_section import arrival, require_to_go, require_unit
from coadjoint_vehicles.missions.perturb import perturbed, seeds
from coadjoint_vehicles.missions.results import require_room
from coadjoint_vehicles.missions.water import bottom, water
from coadjoint_vehicles.water.surface_bottom import altitude

if TYPE_CHECKING:
    from coadjoint_vehicles.missions.sections import MissionSections
    from coadjoint_vehicles.water.bottom import Bottom


def set_up(file: MissionSections) -> Setup:
    """The system, its start, its inputs and the end of a mission; raises ArgumentError and FileError."""
    from coadjoint.models.quantities import vector
    from coadjoint_vehicles import axes as border
    from coadjoint_vehicles.files.checks import doubts_of_changes
    from coadjoint_vehicles.missions.measures import parameters_in_si
    from coadjoint_vehicles.model.craft import Craft
    from coadjoint_vehicles.model.measures import measures
    from coadjoint_vehicles.model.set_points import doubts_of_set_points

    vehicle, doubts = file.vehicle.load(file.located)
    commands = {part.name: part.command.unit for part in vehicle.commanded if part.command is not None}
    begun = _start(file, commands)
    place = begun.get("position", (0.0, 0.0, 0.0))
    legs, members = file.mission, file.run.members
    if isinstance(place, Each) and not len(legs.points):
        place = place.member(0)  # Only way points ask for it.
    with of_section("initial"):
        place = border.space_vector(vector(place, "position"), begun["axes"])
    controller = legs.following(_controller(file.controller, vehicle), place)
    # Report mistakes in the file before proposing gains, which takes a second.
    inputs = _inputs(file, vehicle, commands, {} if controller is None else controller.inputs)
    if controller is not None:
        doubts_of_set_points(controller, inputs)
    faulty = [fault.fault(vehicle) for fault in file.faults]
    for lost in file.lost_sensors:
        lost.require_sensor(vehicle)
    sea = water(file.water, file.axes, file.located, seeds(file.perturb, members))
    craft = Craft(vehicle, controller=controller, water=sea, faults=faulty)
    kinds = measures(craft.vehicle, craft.parameters, craft.owners)
    with of_section("parameters"):
        craft = craft.replace(**parameters_in_si("parameters", file.parameters, kinds))
    if file.parameters and count_members(craft.parameters.asdict()) is None:
        doubts += [f"With [parameters] {sentence}" for sentence in doubts_of_changes(craft)]
    with of_section("initial"):
        start = craft.start(**begun)
    require_room(file.run, start)
    grid = bottom(file.water, file.located)
    if file.sensors is not None:
        file.sensors.require(vehicle, bottom_of_sensors(file))
    system = craft.system if grid is None else craft.system.watching({"altitude": altitude(grid)})
    if members > 1:
        system = perturbed(file.perturb, members, system, kinds)
        assert system.parameters is not None
        craft.replace(**system.parameters.asdict())  # refuses a member that cannot be
    legs.require_start_before_end(start.q, members)
    if "last way point" in legs.ends:
        require_to_go(craft.controller, start.q)
    arrived = arrival(craft.controller) if len(legs.points) else None
    told = {"vehicle_length": float(vehicle.length or 1.0), "vehicle_height": _height(vehicle)}
    told |= {"way_points": legs.points.ravel().tolist()} if len(legs.points) else {}
    told |= {GEOMETRY: json.dumps(geometry(vehicle))}
    told |= {} if legs.bottom is None else {BOTTOM: legs.bottom}
    told |= {} if craft.controller is None else craft.controller.attributes()
    told |= supply(craft.vehicle, craft.parameters)
    return Setup(system, start, inputs or None, legs.until(grid, arrived), told, doubts)


def _height(vehicle: PyTree) -> float:
    """The height of the hull, m; without one that of a cylinder of its length and volume."""
    length = float(vehicle.length or 1.0)
    return float(vehicle.height or vehicle.diameter or np.sqrt(4 * float(vehicle.volume) / (np.pi * length)) or length)


def bottom_of_sensors(file: MissionSections) -> float | Bottom | None:
    """The depth of [sensors] bottom_m, else the grid of [water.bottom], else [mission] bottom_m; None without."""
    if file.sensors is not None and file.sensors.bottom is not None:
        return file.sensors.bottom
    grid = bottom(file.water, file.located)
    return file.mission.bottom if grid is None else grid


def _inputs(file: MissionSections, vehicle: PyTree, commands: dict[str, str], wanted: dict[str, str]) -> Table:
    """The inputs of [mission], all that the controller wants among them."""
    inputs = file.mission.inputs({**commands, **wanted}, file.located)
    lacking = [f"`{name}` ({unit})" for name, unit in wanted.items() if name not in inputs]
    if lacking:
        raise ArgumentError(
            f"Section [mission] needs {', '.join(lacking)}: the controller of {vehicle.name} takes them."
        )
    return inputs


def _controller(section: Mapping[str, Any], vehicle: PyTree) -> PyTree:
    """The controller of [controller]: that of `kind`, none with "none", or the vehicle's own with changes."""
    from coadjoint_vehicles.files.kinds import kinds
    from coadjoint_vehicles.model.measures import dimensions

    CONTROLLERS = kinds("controllers")

    given = dict(section)
    kind = given.pop("kind", "")
    if kind == "none":
        if given:
            raise ArgumentError('Section [controller] with kind = "none" has no other keys.')
        return None
    if kind:
        checks.known(kind, [*CONTROLLERS, "none"], "kind", "Section [controller]")
    if not kind and vehicle.controller is None:
        raise ArgumentError(
            f"The vehicle {vehicle.name} has no controller: add a section [controller] with a kind of "
            f'{", ".join(sorted(CONTROLLERS))}, or kind = "none" to command its actuators in [mission].'
        )
    cls = CONTROLLERS[kind] if kind else type(vehicle.controller)
    known = [f.name for f in fields(cls)]
    if "mixing" in given and "allocation" in known:
        raise ArgumentError("Section [controller] has no key `mixing`: it is called `allocation`.")
    given = {name: _plain(name, value, cls) for name, value in given.items()}
    values = in_si("controller", given, known, {**dict.fromkeys(known), **dimensions(cls)})
    try:
        with of_section("controller"):
            return cls(**values) if kind else replace(vehicle.controller, **values)
    except TypeError as error:
        raise ArgumentError(f"Section [controller]: {str(error).split('() ')[-1]}.") from error


def _plain(name: str, value: PyTree, cls: type) -> PyTree:
    """A value of [controller] as it stands, or that of { value = …, unit = "…" } in SI units.

    Raises ArgumentError for a text or for one number where numbers are expected, with the formats that hold.
    """
    declared = keys(cls).get(name)
    if declared is None or declared.words:
        return value
    if isinstance(value, dict):
        unit, dimension = value.get("unit", "SI"), declared.dimension
        fits = {"value"} <= set(value) <= {"value", "unit", "source", "note"}
        checks.expect(fits, value, f"[controller] {name}", _formats(name, declared))
        return (
            value["value"] if unit == "SI" or dimension is None else in_si_units(value["value"], unit, dimension, name)
        )
    fits = not isinstance(value, (str, bool)) and (declared.check is not three or np.ndim(value) != 0)
    checks.expect(fits, value, f"[controller] {name}", _formats(name, declared))
    return value


def _formats(name: str, declared: Key) -> str:
    """How a value of [controller] may be written."""
    numbers = "[1.0, 0.0, 0.0]" if declared.check is three else "1.0"
    said = "three numbers" if declared.check is three else "a number"
    if declared.dimension is None:
        return f"{said} in SI units, as in {name} = {numbers}"
    unit = declared.dimension.si
    return (
        f"{said} in SI units, {unit}, or with a unit, as in {name}{ending(unit)} = {numbers} or {name} = "
        f'{{ value = {numbers}, unit = "{unit}" }}'
    )


def _start(file: MissionSections, units: Mapping[str, str]) -> Table:
    """[initial] as keywords of `Craft.start`; units: those of the actuators."""
    found = file.initial.arguments(file.axes)
    if "actuators" in found:
        found["actuators"] = _actuators(found["actuators"], units)
    return found


def _actuators(given: PyTree, units: Mapping[str, str]) -> dict[str, np.ndarray]:
    """Where actuators start, by part, in SI units."""
    checks.instance(given, "[initial] actuators", dict, "a table, as in { propeller_rpm = 900 }")
    found = {}
    for key, value in given.items():
        name, unit = split_name(key, units)
        if unit:
            require_unit("[initial] actuators:", key, name, inside(unit)[0], units[name])
        if name in found:
            raise ArgumentError(f"[initial] actuators give `{name}` twice: once as `{key}`, once in another unit.")
        try:
            number = value if isinstance(value, Each) else np.asarray(value, dtype=float)
            found[name] = (inside(unit)[1] if unit else 1.0) * number
        except (TypeError, ValueError):
            raise ArgumentError(f"[initial] actuators must hold numbers, but {key} is {value!r}.") from None
    return found
