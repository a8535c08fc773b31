"""A vehicle as the text of a TOML file, after a change or a construction in Python."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import MISSING, fields
from typing import Any

import numpy as np

from coadjoint.arrays import Array
from coadjoint.sections import keys
from coadjoint.texts import Table
from coadjoint.units import Dimension
from coadjoint_vehicles.files.kinds import kind_of
from coadjoint_vehicles.model.loads import held
from coadjoint_vehicles.model.vehicle import Quantity, Vehicle
from coadjoint_vehicles.parts.derivatives import Derivatives
from coadjoint_vehicles.parts.part import Part
from coadjoint_vehicles.parts.published_curves import PUBLISHED
from coadjoint_vehicles.parts.supplied_curve import Supplied
from coadjoint_vehicles.parts.thrusters import Thrusters
from coadjoint_vehicles.sensors.errors import dimensions
from coadjoint_vehicles.sensors.sensor import Sensor


def vehicle_to_toml(vehicle: Vehicle) -> str:
    """The text of a vehicle file that reads as this vehicle, in SI units and forward, starboard, down.

    Sources and notes are those of the provenance, by key; a number without them there has none in the file. Added mass
    is written as a matrix about the origin, derivatives without the terms that follow from the added mass.
    """
    return "\n".join(_lines(vehicle)) + "\n"


def _lines(vehicle: Vehicle) -> Iterator[str]:
    told = vehicle.provenance
    yield "[vehicle]"
    for key in ("name", "description", "note", "licence"):
        if text := getattr(vehicle, key):
            yield f"{key} = {_text(text)}"
    yield 'axes = "FRD"'
    for title, texts in (("sources", vehicle.sources), ("licences", vehicle.licences)):
        if texts:
            yield f"\n[{title}]"
            yield from (f"{_key(key)} = {_text(text)}" for key, text in texts.items())
    yield "\n[body]"
    held_mass, _, held_volume, _ = held(vehicle.parts)
    neutral = (vehicle.mass + held_mass) / vehicle.fluid_density - held_volume
    for key, dimension in dimensions_of(Vehicle):
        if key == "added_mass":
            continue
        given = told.get(f"body.{key}", told.get("body.buoyancy") if key == "volume" else None)
        if key == "volume" and given is None and vehicle.volume == neutral:
            yield "neutral = true"
        elif getattr(vehicle, key) is not None:
            yield _line(key, _diagonal(getattr(vehicle, key)), dimension, given)
    yield "\n[added_mass]"
    forms = [name for name in told if name.startswith("added_mass.") and name != "added_mass.about"]
    yield _line("matrix", _diagonal(vehicle.added_mass), None, told.get(forms[0]) if forms else None)
    for part in vehicle.parts:
        yield f"\n[[part]]\nkind = {_text(kind_of(part))}\nname = {_text(part.name)}"
        yield from _part(part, vehicle)
    for sensor in vehicle.sensors:
        yield from _sensor(sensor, vehicle)
    if vehicle.controller is not None:
        yield f"\n[controller]\nkind = {_text(kind_of(vehicle.controller))}"
        yield from _controller(vehicle)


def dimensions_of(of: object) -> list[tuple[str, Dimension | None]]:
    """The declared fields of a class, or of an instance, with their dimensions."""
    return [(name, declared.dimension) for name, declared in keys(of).items()]


def _part(part: Part, vehicle: Vehicle) -> Iterator[str]:
    if isinstance(part, Derivatives):
        yield from _derivatives(part, vehicle)
    elif isinstance(part, Thrusters):
        yield from _thrusters(part, vehicle)
    else:
        yield from _fields(part, part.name, vehicle)


def _fields(of: Any, owner: str, vehicle: Vehicle) -> Iterator[str]:
    """The measured fields of a part or a sensor that differ from their defaults."""
    defaults: Table = {field.name: field.default for field in fields(of)}
    for key, found in keys(of).items():
        value, told = getattr(of, key), vehicle.provenance.get(f"{owner}.{key}")
        if told is None and (value is None or np.array_equal(value, defaults[key])):
            continue
        yield f"{key} = {_text(value)}" if found.words else _line(key, value, found.dimension, told)


def _sensor(sensor: Sensor, vehicle: Vehicle) -> Iterator[str]:
    key = f"sensors.{sensor.name}"
    yield f"\n[{key}]\nkind = {_text(kind_of(sensor))}"
    yield from _fields(sensor, key, vehicle)
    for channel in sensor.channels:
        errors, inner = sensor.errors(channel), f"{key}.{channel.name}"
        given = [name for name in dimensions(channel) if getattr(errors, name) is not None]
        if given:
            yield f"\n[{inner}]"
        for name in given:
            told = vehicle.provenance.get(f"{inner}.{name}")
            yield _line(name, getattr(errors, name), dimensions(channel)[name], told)


def _derivatives(part: Derivatives, vehicle: Vehicle) -> Iterator[str]:
    told = vehicle.provenance
    for key, dimension in dimensions_of(part):
        value, given = getattr(part, key), told.get(f"{part.name}.{key}")
        if value is not None and (given is not None or key != "length" or value != vehicle.length):
            yield _line(key, value, dimension, given)
    first = next((told[f"{part.name}.{key}"] for key in part.coefficients if f"{part.name}.{key}" in told), None)
    yield f"\n[part.coefficients]\nunit = {_text('SI' if part.length is None else 'prime')}"
    if first is not None:
        yield from (f"{key} = {_text(text)}" for key, text in (("source", first.source), ("note", first.note)) if text)
    yield "\n[part.coefficients.value]"
    yield from (f"{_key(key)} = {_number(value)}" for key, value in part.coefficients.items())


def _thrusters(part: Thrusters, vehicle: Vehicle) -> Iterator[str]:
    told, defaults = vehicle.provenance, {field.name: field.default for field in fields(part)}
    published = next((name for name, curve in PUBLISHED.items() if curve is part.curve), None)
    if published is not None:
        yield f"curve = {_text(published)}"
    yield f"command_unit = {_text(part.unit)}"
    for key, dimension in dimensions_of(part):
        value, given = getattr(part, key), told.get(f"{part.name}.{key}")
        ends = key == "limit" and given is None and np.array_equal(value, part.curve.reach or ())
        usual = given is None and bool(np.all(np.asarray(value) == defaults[key]))
        if value is not None and not ends and not usual:
            yield _line(key, value, dimension, given)
    if isinstance(part.curve, Supplied):
        yield f"\n[part.curve]\npublished = {_text(part.curve.published)}"
        for key, dimension in dimensions_of(part.curve):
            if (value := getattr(part.curve, key)) is not None:
                yield _line(key, value, dimension, told.get(f"{part.name}.curve.{key}"))
    elif published is None:
        kind = part.curve.kind
        yield "\n[part.curve]"
        yield _line(kind, part.curve.in_file, None, told.get(f"{part.name}.curve.{kind}"))


def _controller(vehicle: Vehicle) -> Iterator[str]:
    controller = vehicle.controller
    assert controller is not None
    for field in fields(controller):
        value = getattr(controller, field.name)
        if value is None or (field.default is not MISSING and np.array_equal(value, field.default)):
            continue
        if hasattr(value, "_fields"):  # What a fitted controller has worked out of the vehicle; it does so again.
            continue
        if isinstance(value, str):
            yield f"{field.name} = {_text(value)}"
        elif isinstance(value, (int, float, list, tuple, np.ndarray)):
            told = vehicle.provenance.get(f"controller.{field.name}")
            yield _line(field.name, value, keys(controller)[field.name].dimension, told)


def _line(key: str, value: object, dimension: Dimension | None, told: Quantity | None) -> str:
    unit = "SI" if dimension is None else dimension.si
    words = [f"value = {_value(value)}", f"unit = {_text(unit)}"]
    if told is not None:
        words += [f"{name} = {_text(text)}" for name, text in (("source", told.source), ("note", told.note)) if text]
        if told.uncertainty is not None:
            of = told.uncertainty
            words.append(f"uncertainty = {_text(of) if isinstance(of, str) else _value(of)}")
    return f"{key} = {{ {', '.join(words)} }}"


def _value(value: object) -> str:
    found = np.asarray(value, dtype=float)
    if found.ndim == 0:
        return _number(found)
    return "[" + ", ".join(_value(inner) for inner in found) + "]"


def _diagonal(value: object) -> Array:
    """The diagonal of a diagonal matrix, for readability."""
    found = np.asarray(value)
    return np.diag(found) if found.ndim == 2 and np.array_equal(found, np.diag(np.diag(found))) else found


def _number(value: Any) -> str:
    return repr(float(value))


def _text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _key(key: str) -> str:
    return key if key.isascii() and key.replace("_", "").isalnum() else _text(key)
