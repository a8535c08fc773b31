"""The parts and the pilot of a vehicle file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, fields
from typing import Any

import numpy as np

from coadjoint import units as u
from coadjoint.errors import ArgumentError
from coadjoint.vehicles import axes as border
from coadjoint.vehicles.files.kinds import (
    PARTS,
    PILOT_FIELDS,
    PILOT_WORDS,
    PILOTS,
    Field,
    part_class,
    pilot_class,
)
from coadjoint.vehicles.files.table import Section, axes_of
from coadjoint.vehicles.model.vehicle import Quantity
from coadjoint.vehicles.parts.part import Part

CURVES = ("linear", "quadratic", "polynomial", "table")


def read_part(section: Section, axes: border.Axes, body: dict[str, Any], before: tuple[str, ...]) -> Part:
    """The part of one [[part]]; body: what [body] says, before: names of the parts above it."""
    kinds = (*PARTS, "thrusters", "derivatives")
    name = section.text("name")
    section.key = name
    kind = section.text("kind", None, tuple(sorted(kinds)))
    section.text("note", "")
    axes = axes_of(section, axes)
    if not name.isidentifier():
        raise section.fail(f"name must be one word of letters, digits and _, but is {name!r}.")
    if name in before:
        raise section.fail(f"name is that of another part too: give each a name of its own, such as {name}_2.")
    if kind == "thrusters":
        return _built(section, lambda: _thrusters(section, name, axes))
    if kind == "derivatives":
        from coadjoint.vehicles.files.read_derivatives import read_derivatives

        return _built(section, lambda: read_derivatives(section, name, axes, body))
    values = _values(section, part_class(kind), PARTS[kind][1], axes)
    section.done()
    return _built(section, lambda: part_class(kind)(name=name, **values))


def read_pilot(section: Section, parts: set[str]) -> Any:
    """The pilot of [pilot], which may name parts of the vehicle."""
    kind = section.text("kind", None, tuple(sorted(PILOTS)))
    section.text("note", "")
    cls = pilot_class(kind)
    values: dict[str, Any] = {}
    for field in fields(cls):
        if field.name not in section:
            if field.default is MISSING:
                section.quantity(field.name, PILOT_FIELDS.get(field.name))  # says what is missing
            continue
        if field.name in PILOT_WORDS:
            values[field.name] = section.text(field.name, None, PILOT_WORDS[field.name])
            continue
        given = section.given[field.name]
        if isinstance(given, str) or (isinstance(given, list) and all(isinstance(name, str) for name in given)):
            values[field.name] = _named_parts(section, field.name, given, parts)
            continue
        value, _ = section.quantity(field.name, PILOT_FIELDS.get(field.name))
        values[field.name] = tuple(value) if isinstance(value, list) and np.ndim(value) == 1 else value
    section.done()
    return _built(section, lambda: cls(**values))


def _named_parts(section: Section, key: str, given: Any, parts: set[str]) -> Any:
    from difflib import get_close_matches

    for name in [given] if isinstance(given, str) else given:
        if name not in parts:
            near = get_close_matches(name, list(parts), n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"they are {', '.join(sorted(parts)) or 'none'}."
            raise section.fail(f"{key} names {name!r}, which is none of the parts: {hint}")
    return given if isinstance(given, str) else tuple(given)


def _values(section: Section, cls: type, known: dict[str, Field], axes: border.Axes) -> dict[str, Any]:
    """The fields of a class of parts, in SI units and FRD."""
    values: dict[str, Any] = {}
    for field in fields(cls):
        if field.name == "name":
            continue
        if field.name not in section:
            if field.default is MISSING:
                section.quantity(field.name, known[field.name].dimension)  # says what is missing
            continue
        found = known[field.name]
        value, _ = section.quantity(field.name, found.dimension)
        values[field.name] = value if found.turn is None else turned(section, field.name, value, found, axes)
    return values


def turned(section: Section, name: str, value: Any, found: Field, axes: border.Axes) -> Any:
    """The value in FRD; raises ArgumentError for a shape that cannot turn."""
    assert found.turn is not None
    try:
        return found.turn(np.asarray(value, dtype=float), axes)
    except (ArgumentError, ValueError) as error:
        shape = np.shape(value)
        raise section.fail(f"{name} must hold rows of three, or of six, numbers, but has the shape {shape}.") from error


def _thrusters(section: Section, name: str, axes: border.Axes) -> Part:
    from coadjoint.vehicles.parts.thrusters import Thrusters

    unit = section.text("command_unit", "1")
    size, commands = _command_unit(section, unit)
    values: dict[str, Any] = {"curve": _curve(section), "unit": unit}
    for key, field in (
        ("positions", Field(u.LENGTH, border.body_vector)),
        ("directions", Field(u.NUMBER, border.body_vector)),
        ("allocation", Field(None, _columns)),
    ):
        if key in section:
            value, _ = section.quantity(key, field.dimension)
            values[key] = turned(section, key, value, field, axes)
    if "positions" in values and "directions" not in values:
        section.quantity("directions", u.NUMBER)
    if "torque" in section:
        values["torque"], _ = section.quantity("torque", u.LENGTH)
    for key in ("limit", "dead_band"):
        if key in section:
            value, told = section.quantity(key, commands, special=(unit, "SI"))
            values[key] = value if told in (unit, "SI") else (np.asarray(value) / size).tolist()
    for key, dimension in (("lag", u.TIME), ("density", u.DENSITY)):
        if key in section:
            values[key] = section.number(key, dimension)
    section.done()
    return Thrusters(name=name, **values)


def _command_unit(section: Section, unit: str) -> tuple[float, u.Dimension]:
    """A command's unit in SI, and what it measures."""
    try:
        size, powers = u.unit_of(unit, f"{section.title} command_unit")
    except ArgumentError as error:
        raise section.book.fail(str(error)) from error
    return size, u.Dimension(powers, unit, unit)


def _columns(value: Any, axes: border.Axes) -> Any:
    return border.twist(np.transpose(value), axes).T


def _curve(section: Section) -> Any:
    """The force curve: the name of a published one, or `curve.linear` and so on, with the unit "SI"."""
    if isinstance(section.given.get("curve"), str):
        return _published(section, section.text("curve"))
    if "curve" not in section:
        raise section.fail('needs a curve: curve = "T200", or curve.quadratic = { value = …, unit = "SI" }.')
    inner = section.inner("curve")
    given = [kind for kind in CURVES if kind in inner]
    if len(given) != 1:
        inner.done()
        raise section.fail(f"curve needs one of {', '.join(CURVES)}, but has {' and '.join(given) or 'none of them'}.")
    value, _ = inner.quantity(given[0], None)
    inner.done()
    return {given[0]: value}


def _published(section: Section, name: str) -> str:
    """The name of a published curve, which counts as its own source."""
    from coadjoint.vehicles.parts.published_curves import PUBLISHED

    if name in PUBLISHED:
        book = section.book
        book.sources.setdefault(name, f"published force curve of {name}, see coadjoint.vehicles.parts.{name}")
        book.used.add(name)
        unit = section.given.get("command_unit", "1")
        book.provenance[f"{section.key}.curve"] = Quantity(name, f"{unit} to N", name, "")
    return name


def _built(section: Section, make: Callable[[], Any]) -> Any:
    """What `make` builds, with file and part in front of its complaints."""
    try:
        return make()
    except ArgumentError as error:
        if str(error).startswith(section.book.path):
            raise
        raise section.fail(f"cannot be as it is given: {error}") from error
