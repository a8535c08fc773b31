"""A section of a vehicle file while it is read: every key is read once, and an unread key is a mistake."""

from __future__ import annotations

import math
import re
from dataclasses import MISSING, dataclass, field, fields
from typing import Any

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, nearest, prefixed, shown
from coadjoint.sections import checked, keys
from coadjoint.texts import Table
from coadjoint.units import NUMBER, Dimension, in_si, same
from coadjoint_vehicles.axes import Axes
from coadjoint_vehicles.model.vehicle import Quantity

BODY_AXES: dict[str, Axes] = {"FRD": "NED/FRD", "FLU": "ENU/FLU"}
QUANTITY_KEYS = ("value", "unit", "source", "note", "uncertainty")
SHARE = re.compile(r"\d+(\.\d*)?\s*%")
"""A share of a number, as in "5 %"."""
LARGEST = 1e15
"""Numbers beyond it are mistakes in any unit."""


@dataclass
class Notebook:
    """Results of reading one file: provenance by key, and warnings. `path` names the file in messages."""

    path: str
    sources: dict[str, str] = field(default_factory=dict)
    licences: dict[str, str] = field(default_factory=dict)
    provenance: dict[str, Quantity] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    used: set[str] = field(default_factory=set)
    without_source: list[str] = field(default_factory=list)

    def fail(self, sentence: str) -> ArgumentError:
        """The error to raise, with the file in front."""
        return ArgumentError(f"{self.path}: {sentence}")

    def warn(self, sentence: str) -> None:
        self.warnings.append(sentence)


class Section:
    """The keys of one table. title: as in the file, "[body]". key: before the dot in the provenance, "body"."""

    def __init__(self, book: Notebook, title: str, key: str, given: object):
        if not isinstance(given, dict):
            raise book.fail(f"{title} must be a section with keys, but is {shown(given)}.")
        self.book, self.title, self.key, self.given = book, title, key, given
        self.asked: set[str] = set()

    def __contains__(self, name: str) -> bool:
        self.asked.add(name)
        return name in self.given

    def fail(self, sentence: str) -> ArgumentError:
        return self.book.fail(f"{self.title} {sentence}")

    def text(self, name: str, default: str | None = None, choices: tuple[str, ...] = ()) -> str:
        """A text; without a default it must be there."""
        self.asked.add(name)
        if name not in self.given:
            if default is None:
                raise self.fail(f'needs `{name} = "…"`{self._instead(name)}')
            return default
        value = self.given[name]
        if not isinstance(value, str):
            raise self.fail(f'{name} must be a text in quotes, but is {shown(value)}: write {name} = "…".')
        if choices and value not in choices:
            near = nearest(value, choices)
            hint = f" Did you mean {near!r}?" if near else ""
            raise self.fail(f"{name} must be one of {', '.join(map(repr, choices))}, but is {shown(value)}.{hint}")
        return value

    def flag(self, name: str, default: bool = False) -> bool:
        self.asked.add(name)
        value = self.given.get(name, default)
        if not isinstance(value, bool):
            raise self.fail(f"{name} must be true or false, but is {shown(value)}.")
        return value

    def inner(self, name: str) -> Section:
        """A section inside this one."""
        self.asked.add(name)
        title = f"{self.title} {name}"
        return Section(self.book, title, f"{self.key}.{name}", self.given.get(name))

    def quantity(
        self, name: str, dimension: Dimension | None, special: tuple[str, ...] = (), named: bool = False
    ) -> tuple[Any, str]:
        """(numbers in SI units, unit as given): `value`, `unit`, `source`, `note`; its dimension is `dimension`.

        Where the numbers measure several things, `dimension` is None and the unit is "SI", or one of `special`. named:
        the numbers are a table, each with its name.
        """
        self.asked.add(name)
        if name not in self.given:
            si = dimension.si if dimension else "SI"
            raise self.fail(f'needs {name} = {{ value = …, unit = "{si}", source = "…" }}{self._instead(name)}')
        what = f"{self.title} {name}"
        given = self._quantity_table(name, dimension)
        value = given["value"]
        if named and not (isinstance(value, dict) and value):
            raise self.fail(f"{name} must have a table of values by name, as in value = {{ Y_uv = -20.0 }}.")
        if named:
            value = {key: self._numbers(inner, f"{what} {key}") for key, inner in value.items()}
        else:
            value = self._numbers(value, what)
        unit = given.get("unit")
        if unit is None and dimension == NUMBER:
            unit = "1"
        if not isinstance(unit, str) or not unit:
            si = f'unit = "{dimension.si}"' if dimension else 'unit = "SI"'
            has = "has no unit" if unit is None else f"has the unit {shown(unit)}"
            raise self.fail(f"{name} {has}: add {si}, or the unit that its numbers are in.")
        self._remember(name, given, value, unit, self._uncertainty(name, given, unit, dimension, special))
        if any(same(unit, word) for word in special) or (dimension is None and unit == "SI"):
            return value, unit
        if dimension is None:
            wanted = " or ".join(f'"{word}"' for word in ("SI", *special))
            raise self.fail(
                f'{name} has the unit "{unit}", but its numbers measure several things: turn them into N, m, kg, s and '
                f"rad, and write unit = {wanted}."
            )
        with prefixed(self.book.path, ArgumentError):
            return in_si(value, unit, dimension, what), unit

    def number(self, name: str, dimension: Dimension) -> float:
        """One number in SI units."""
        value, _ = self.quantity(name, dimension)
        if isinstance(value, (list, dict)):
            raise self.fail(f"{name} must be one number, but is {shown(self.given[name]['value'])}.")
        return float(value)

    def positive(self, name: str, dimension: Dimension) -> float:
        """One number above zero, in SI units."""
        value = self.number(name, dimension)
        if value <= 0:
            raise self.fail(f"{name} must be positive, but is {self.given[name]['value']:g}.")
        return value

    def vector(self, name: str, dimension: Dimension, size: int = 3) -> list[float]:
        """`size` numbers in SI units."""
        value, _ = self.quantity(name, dimension)
        if not isinstance(value, list) or len(value) != size or any(isinstance(inner, list) for inner in value):
            raise self.fail(f"{name} must be {size} numbers in brackets, but is {shown(self.given[name]['value'])}.")
        return value

    def quantities(self, kind: type) -> Table:
        """The quantities that a dataclass declares, in SI units and checked; the default of one that is not given.

        Raises ArgumentError for one that is missing and has no default.
        """
        values: Table = {f.name: f.default for f in fields(kind)}
        for name, declared in keys(kind).items():
            if name in self or values[name] is MISSING:
                value, _ = self.quantity(name, declared.dimension)
                with prefixed(self.book.path, ArgumentError):
                    values[name] = checked(declared, value, f"{self.title} {name}")
        return values

    def done(self) -> None:
        """Raise ArgumentError for unread keys, with the nearest known key."""
        checks.all_known(self.given, self.asked, "key", f"{self.book.path}: {self.title}")

    def _instead(self, name: str) -> str:
        """The end of a message on a missing key: a given key that may be a misspelling of it."""
        found = nearest(name, [key for key in self.given if key not in self.asked], 0.8)
        return f", but has `{found}`: did you mean `{name}`?" if found else "."

    def _quantity_table(self, name: str, dimension: Dimension | None) -> Table:
        given = self.given[name]
        what = f"{self.title} {name}"
        if not isinstance(given, dict):
            si = dimension.si if dimension else "SI"
            raise self.book.fail(
                f"{what} must say its unit and where it is from, but is {shown(given)} alone: write {name} = "
                f'{{ value = {shown(given)}, unit = "{si}", source = "…" }}.'
            )
        checks.all_known(given, QUANTITY_KEYS, "key", f"{self.book.path}: {what}")
        if "value" not in given:
            raise self.book.fail(f"{what} has no `value`.")
        return given

    def _numbers(self, value: object, what: str) -> PyTree:
        """Finite numbers in rectangular lists; raises ArgumentError."""
        if isinstance(value, list):
            found = [self._numbers(inner, what) for inner in value]
            if not value or len({_shape(inner) for inner in found}) != 1:
                raise self.book.fail(f"{what} must hold numbers in rows of one length, but is {shown(value)}.")
            return found
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.book.fail(f"{what} must be a number, but is {shown(value)}.")
        if isinstance(value, int) and abs(value) > LARGEST:
            raise self.book.fail(f"{what} = {shown(value)} is larger than anything at sea.")
        if not math.isfinite(value):
            raise self.book.fail(f"{what} must be finite, but is {value}.")
        if abs(value) > LARGEST:
            raise self.book.fail(f"{what} = {value:g} is larger than anything at sea.")
        return float(value)

    def _uncertainty(
        self, name: str, given: dict[str, object], unit: str, dimension: Dimension | None, special: tuple[str, ...]
    ) -> PyTree:
        """The standard deviation of a quantity: a share of it such as "5 %", or in SI units; None if there is none."""
        found = given.get("uncertainty")
        if found is None:
            return None
        what = f"{name}: its uncertainty must be "
        if isinstance(found, str):
            share = SHARE.fullmatch(found.strip())
            if share is None:
                raise self.fail(f'{what}a share such as "5 %", or numbers in {unit}, but is {shown(found)}.')
            return found
        numbers = self._numbers(found, f"{self.title} {name}: its uncertainty")
        if _shape(numbers) not in ((), _shape(given["value"])):
            raise self.fail(f"{what}one number, or as many as its value, but is {shown(found)}.")
        if any(number < 0 for number in _flat(numbers)):
            raise self.fail(f"{what}at least 0, but is {shown(found)}.")
        if any(same(unit, word) for word in special):
            raise self.fail(f'{what}a share such as "5 %", because its numbers are in "{unit}", but is {shown(found)}.')
        return numbers if dimension is None else in_si(numbers, unit, dimension, f"{self.title} {name}")

    def _remember(
        self, name: str, given: dict[str, object], value: object, unit: str, uncertainty: object = None
    ) -> None:
        texts = {}
        for key in ("source", "note"):
            texts[key] = given.get(key, "")
            if not isinstance(texts[key], str):
                raise self.fail(f"{name}: its {key} must be a text in quotes, but is {shown(texts[key])}.")
        source = texts["source"]
        if source and source not in self.book.sources:
            near = nearest(source, self.book.sources)
            hint = f"did you mean {near!r}?" if near else f'add {source} = "citation, where it is found" there.'
            raise self.fail(f"{name} has the source {shown(source)}, which [sources] does not have: {hint}")
        self.book.used.add(source)
        if not source:
            self.book.without_source.append(f"{self.key}.{name}")
        self.book.provenance[f"{self.key}.{name}"] = Quantity(value, unit, source, texts["note"], uncertainty)


def axes_of(section: Section, otherwise: Axes) -> Axes:
    """The body axes of a section: its key `axes`, or those of the file."""
    return BODY_AXES[section.text("axes", None, tuple(BODY_AXES))] if "axes" in section else otherwise


def _flat(value: Any) -> list[float]:
    """The numbers of lists in lists."""
    return [number for inner in value for number in _flat(inner)] if isinstance(value, list) else [value]


def _shape(value: object) -> tuple[int, ...]:
    """The shape of rectangular lists."""
    return (len(value), *_shape(value[0])) if isinstance(value, list) else ()
