"""A vehicle while it is read from the files of a simulator: its numbers, each with its place there, and the report."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.errors import prefixed
from coadjoint.models.descriptions.elements import Element
from coadjoint.texts import Table
from coadjoint_vehicles.importing.report import LOOKS as SEEN
from coadjoint_vehicles.importing.report import Left, Report, Taken
from coadjoint_vehicles.model.vehicle import Quantity, Vehicle
from coadjoint_vehicles.parts.part import Part

FILE, GIVEN = "FILE", "IMPORT"
NOTICED, REFUSED = 1e-9, 0.1
"""|M_ij − M_ji|/√(M_ii M_jj) from which an asymmetry is reported, and from which it is too large for rounding."""
LOOKS = ("visual", "material", "mesh", "camera", "light", "self_collide", "enable_wind")


@dataclass
class Draft:
    """name: of the vehicle. source: of its numbers, a citation."""

    name: str
    source: str
    body: Table = field(default_factory=dict)
    elements: int = 0
    """How many elements of included files were read."""
    parts: list[Part] = field(default_factory=list)
    provenance: dict[str, Quantity] = field(default_factory=dict)
    report: Report = field(default_factory=Report)
    flip: np.ndarray = field(default_factory=lambda: np.array([1.0, -1.0, -1.0]))
    """The signs of x, y, z from the axes of the files to forward, starboard, down."""

    def take(self, key: str, value: object, unit: str, where: Element | str, note: str = "") -> PyTree:
        """Remember where a number is from, and return it. key: as in the provenance, "body.mass"."""
        place = where if isinstance(where, str) else where.place
        value = _plain(value)
        said = f"{place}; {note}" if note else place
        self.provenance[key] = Quantity(value, unit, FILE, said)
        self.report.taken.append(Taken(key, value, unit, place))
        return value

    def given(self, key: str, value: object, unit: str, note: str) -> PyTree:
        """As `take`, for a number that is in no file."""
        self.provenance[key] = Quantity(value, unit, GIVEN, note)
        self.report.taken.append(Taken(key, value, unit, note))
        return value

    def differs(self, sentence: str) -> None:
        """Report, once, a difference between the motions of the vehicle and of the simulator."""
        if sentence not in self.report.differs:
            self.report.differs.append(sentence)

    def left(self, where: Element | str, what: str, why: str) -> None:
        self.report.left.append(Left(where if isinstance(where, str) else where.place, what, why))

    def symmetric(self, matrix: np.ndarray, where: Element) -> np.ndarray:
        """½(M + Mᵀ); reports an asymmetric M; raises FileError if one of two entries is wrong."""
        size = np.sqrt(np.maximum(np.diag(matrix), 1e-3 * np.max(np.diag(matrix), initial=0.0)))
        skew = np.abs(matrix - matrix.T) / np.maximum(np.outer(size, size), 1e-300)
        i, j = sorted(int(index) for index in np.unravel_index(np.argmax(skew), skew.shape))
        if skew[i, j] > NOTICED:
            pair = f"row {i + 1}, column {j + 1} is {matrix[i, j]:g}, and row {j + 1}, column {i + 1} {matrix[j, i]:g}"
            if skew[i, j] > REFUSED:
                raise where.fail(f"must be a symmetric matrix, as the added mass of every body is, but {pair}.")
            self.differs(f"{where.place}: the added mass is not symmetric: {pair}; the mean of both is taken.")
        return 0.5 * (matrix + matrix.T)

    def vehicle(self) -> Vehicle:
        """The vehicle of all imported values; raises FileError for values that a vehicle cannot have."""
        sources = {FILE: self.source, GIVEN: "chosen at the import, where the files say nothing"}
        used = {told.source for told in self.provenance.values()}
        with prefixed(f"{self.source}: no vehicle can be made of it"):
            return Vehicle(
                name=self.name,
                description=f"imported from {self.report.format}",
                note=" ".join([*self.report.impossible, *self.report.differs]),
                parts=tuple(self.parts),
                provenance=self.provenance,
                sources={key: text for key, text in sources.items() if key in used},
                **self.body,
            )


def _plain(value: object) -> PyTree:
    """A number or an array without -0.0, a matrix of six rows that is diagonal as its diagonal."""
    found = np.asarray(value, dtype=float) + 0.0
    if found.ndim == 0:
        return float(found)
    diagonal = found.shape == (6, 6) and np.array_equal(found, np.diag(np.diag(found)))
    return np.diag(found).copy() if diagonal else found


def places(elements: Iterable[Element]) -> str:
    """The places of several elements, each once: "a.xacro:3, 7, b.xacro:2"."""
    said: list[str] = []
    last = ""
    for element in {element.place: element for element in elements}.values():
        said.append(str(element.line) if element.file == last else element.place)
        last = element.file
    return ", ".join(said)


def untouched(root: Element, draft: Draft) -> None:
    """Add to the report all elements and attributes of a tree that have not been read, only the uppermost of each."""
    for child in root.children:
        if child.taken:
            for name in child.attributes:
                if name not in child.asked and name not in ("name", "type", "version"):
                    draft.left(child, f"{name}={child.attributes[name]!r} of {child.label}", _why(child.tag))
            untouched(child, draft)
        else:
            draft.left(child, _named(child), _why(child.tag))


def _named(element: Element) -> str:
    text = " ".join(element.text.split())
    file = element.attributes.get("filename")
    shown = f" {text[:40]!r}" if text and not element.children else ""
    return f"{element.label}{shown}" + (f" of {file}" if element.tag == "plugin" and file else "")


def _why(tag: str) -> str:
    if tag in LOOKS:
        return SEEN
    if tag == "collision":
        return "its shape for contacts, which vehicles here do not have"
    if tag == "sensor":
        return "a sensor, which no part of a vehicle is"
    if tag == "plugin":
        return "a program that the import does not know"
    return "no part of a vehicle is made of it"
