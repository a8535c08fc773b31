"""The parts and the controller of a vehicle file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, fields
from typing import Any

import numpy as np

from coadjoint import units as u
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError, nearest, prefixed
from coadjoint.sections import keys
from coadjoint.texts import Table
from coadjoint_vehicles import axes as border
from coadjoint_vehicles.files.kinds import kinds
from coadjoint_vehicles.files.read_derivatives import read_derivatives
from coadjoint_vehicles.files.table import Section, axes_of
from coadjoint_vehicles.model.vehicle import Quantity
from coadjoint_vehicles.parts.data_sheets import sheet_names
from coadjoint_vehicles.parts.force_curves import CURVES
from coadjoint_vehicles.parts.part import Part
from coadjoint_vehicles.parts.thrusters import COMMANDED, Thrusters


def read_part(section: Section, axes: border.Axes, body: dict[str, object], before: tuple[str, ...]) -> Part:
    """The part of one [[part]]; body: the values of [body], before: names of the parts above it."""
    name = section.text("name")
    section.key = name
    kind = section.text("kind", None, tuple(sorted(kinds("parts"))))
    section.text("note", "")
    axes = axes_of(section, axes)
    if not name.isidentifier():
        raise section.fail(f"name must be one word of letters, digits and _, but is {name!r}.")
    if name in before:
        raise section.fail(f"name is that of another part too: give each its own name, such as {name}_2.")
    cls = kinds("parts")[kind]
    if kind == "thrusters":
        return built(section, lambda: _thrusters(section, name, axes))
    if kind == "derivatives":
        return built(section, lambda: read_derivatives(section, name, read_fields(section, cls, axes), axes, body))
    values = read_fields(section, cls, axes)
    section.done()
    return built(section, lambda: cls(name=name, **values))


def read_fields(
    section: Section, cls: type, axes: border.Axes, commands: tuple[str, float, u.Dimension] | None = None
) -> dict[str, PyTree]:
    """The measured fields of a class of parts that are given, in SI units and FRD.

    commands: the unit of its commands, its size and its dimension. Raises ArgumentError for one that is missing.
    """
    values: Table = {}
    needed = {field.name for field in fields(cls) if field.default is MISSING}
    for name, found in keys(cls).items():
        if name not in section and name not in needed:
            continue
        if found.words:
            values[name] = section.text(name, None, found.words)
        elif found.dimension == COMMANDED and commands is not None:
            unit, size, dimension = commands
            value, told = section.quantity(name, dimension, special=(unit, "SI"))
            values[name] = value if told in (unit, "SI") else (np.asarray(value) / size).tolist()
        else:
            value, _ = section.quantity(name, found.dimension)
            values[name] = value if found.turn is None else _turned(section, name, value, found.turn, axes)
    return values


def _turned(section: Section, name: str, value: Any, turn: Callable[[Any, Any], Any], axes: border.Axes) -> Array:
    """The value in FRD; raises ArgumentError for a shape that cannot turn."""
    try:
        return turn(np.asarray(value, dtype=float), axes)
    except (ArgumentError, ValueError) as error:
        shape = np.shape(value)
        raise section.fail(f"{name} must hold rows of three, or of six, numbers, but has the shape {shape}.") from error


def read_controller(section: Section, parts: set[str]) -> Any:
    """The controller of [controller], which may name parts of the vehicle."""
    cls = kinds("controllers")[section.text("kind", None, tuple(sorted(kinds("controllers"))))]
    section.text("note", "")
    values: Table = {}
    for field in fields(cls):
        known = keys(cls).get(field.name)
        if field.name not in section:
            if field.default is MISSING:
                section.quantity(field.name, known and known.dimension)  # raises for the missing key
            continue
        given = section.given[field.name]
        if known is not None and known.words:
            values[field.name] = section.text(field.name, None, known.words)
        elif isinstance(given, str) and known is not None:
            unit = "SI" if known.dimension is None else known.dimension.si
            raise section.fail(
                f'{field.name} must be numbers with their unit, as in {field.name} = {{ value = …, unit = "{unit}", '
                f'source = "…" }}, but is {given!r}.'
            )
        elif isinstance(given, str) or (isinstance(given, list) and all(isinstance(name, str) for name in given)):
            values[field.name] = _named_parts(section, field.name, given, parts)
        else:
            value, _ = section.quantity(field.name, known and known.dimension)
            values[field.name] = tuple(value) if isinstance(value, list) and np.ndim(value) == 1 else value
    section.done()
    return built(section, lambda: cls(**values))


def _named_parts(section: Section, key: str, given: Any, parts: set[str]) -> Any:
    for name in [given] if isinstance(given, str) else given:
        if name not in parts:
            near = nearest(name, parts)
            hint = f"did you mean {near!r}?" if near else f"they are {', '.join(sorted(parts)) or 'none'}."
            raise section.fail(f"{key} names {name!r}, which is none of the parts: {hint}")
    return given if isinstance(given, str) else tuple(given)


def _thrusters(section: Section, name: str, axes: border.Axes) -> Part:
    unit = section.text("command_unit", "1")
    curve = _curve(section)
    values = read_fields(section, Thrusters, axes, (unit, *_command_unit(section, unit)))
    if "positions" in values and "directions" not in values:
        section.quantity("directions", u.NUMBER)
    section.done()
    return Thrusters(name=name, curve=curve, unit=unit, **values)


def _command_unit(section: Section, unit: str) -> tuple[float, u.Dimension]:
    """A command's unit in SI, and its dimension."""
    with prefixed(section.book.path, ArgumentError):
        size, powers = u.unit_of(unit, f"{section.title} command_unit")
    return size, u.Dimension(powers, unit, unit)


def _curve(section: Section) -> Any:
    """The force curve: the name of a published one, or `curve.linear` and so on, with the unit "SI"."""
    if isinstance(section.given.get("curve"), str):
        return _published(section, section.text("curve"))
    if "curve" not in section:
        raise section.fail('needs a curve: curve = "T200", or curve.quadratic = { value = …, unit = "SI" }.')
    inner = section.inner("curve")
    if "published" in inner:
        return _supplied(section, inner)
    given = [kind for kind in CURVES if kind in inner]
    if len(given) != 1:
        inner.done()
        raise section.fail(f"curve needs one of {', '.join(CURVES)}, but has {' and '.join(given) or 'none of them'}.")
    value, _ = inner.quantity(given[0], None)
    inner.done()
    return {given[0]: value}


def _supplied(section: Section, inner: Section) -> Table:
    """A data sheet at a voltage, with the resistance of battery and cables."""
    found: Table = {"published": inner.text("published", None, sheet_names())}
    found["voltage"], _ = inner.quantity("voltage", u.VOLTAGE)
    if "resistance" in inner:
        found["resistance"], _ = inner.quantity("resistance", u.RESISTANCE)
    inner.done()
    _published(section, str(found["published"]))
    return found


def _published(section: Section, name: str) -> str:
    """The name of a published curve, which counts as its own source."""
    from coadjoint_vehicles.parts.published_curves import PUBLISHED

    if name in PUBLISHED:
        book = section.book
        book.sources.setdefault(name, f"force curve that Blue Robotics published, coadjoint_vehicles.parts.{name}")
        book.licences.setdefault(name, "none stated: numbers only")
        book.used.add(name)
        unit = section.given.get("command_unit", "1")
        book.provenance[f"{section.key}.curve"] = Quantity(name, f"{unit} to N", name, "")
    return name


def built(section: Section, make: Callable[[], Any]) -> Any:
    """The result of `make`, with file and part at the beginning of its error messages."""
    try:
        return make()
    except ArgumentError as error:
        if str(error).startswith(section.book.path):
            raise
        raise section.fail(f"cannot be as it is given: {error}") from error
