"""Vehicle files: a vehicle as TOML, every number with its unit, its source and a note."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError, warn
from coadjoint.sections import key
from coadjoint.texts import Table, file_text, read_table
from coadjoint_vehicles import axes as border
from coadjoint_vehicles.files.added_masses import read_added_mass
from coadjoint_vehicles.files.bodies import MEASURED
from coadjoint_vehicles.files.checks import check
from coadjoint_vehicles.files.kinds import kinds
from coadjoint_vehicles.files.read_parts import read_controller, read_part
from coadjoint_vehicles.files.read_sensors import read_sensors
from coadjoint_vehicles.files.table import BODY_AXES, Notebook, Section, axes_of
from coadjoint_vehicles.model.loads import held
from coadjoint_vehicles.model.vehicle import Quantity, Vehicle

SECTIONS = ("vehicle", "sources", "licences", "body", "added_mass", "part", "sensors", "controller")


def _three(value: object, name: str) -> list[float]:
    if not isinstance(value, list) or len(value) != 3 or any(isinstance(inner, list) for inner in value):
        raise ArgumentError(f"{name} must be 3 numbers in brackets, but is {value}.")
    return value


@dataclass(frozen=True, kw_only=True)
class BodySection:
    """The quantities of [body], of the hull without what parts hold; one of `volume` and `buoyancy`, or `neutral`."""

    mass: Scalar = key("mass, without what parts hold", MEASURED["mass"], check=checks.positive)
    inertia: PyTree = key("moments of inertia, three or three rows of three", MEASURED["inertia"])
    center_of_mass: list[float] = key("centre of mass from the origin", MEASURED["center_of_mass"], check=_three)
    center_of_buoyancy: list[float] = key(
        "centre of buoyancy from the origin", MEASURED["center_of_buoyancy"], check=_three
    )
    fluid_density: Scalar = key("density of the water", MEASURED["fluid_density"], check=checks.positive)
    gravity: Scalar = key("gravity", MEASURED["gravity"], check=checks.not_negative, default=9.81)
    volume: Scalar | None = key(
        "volume of the water displaced", MEASURED["volume"], check=checks.positive, default=None
    )
    buoyancy: Scalar | None = key("force of buoyancy", MEASURED["buoyancy"], check=checks.positive, default=None)
    length: Scalar | None = key("length of the hull", MEASURED["length"], check=checks.positive, default=None)
    diameter: Scalar | None = key("diameter of a round hull", MEASURED["diameter"], check=checks.positive, default=None)
    width: Scalar | None = key("width of another hull", MEASURED["width"], check=checks.positive, default=None)
    height: Scalar | None = key("height of another hull", MEASURED["height"], check=checks.positive, default=None)


def read_vehicle(path: str | os.PathLike[str]) -> Vehicle:
    """The vehicle of a TOML file, in SI units and forward, starboard, down, with the provenance of every number.

    Raises FileError for a file that cannot be read or is not TOML, and ArgumentError, with file, key and remedy, for
    values that a vehicle cannot have. Warns of doubtful values; `vehicle.warnings` lists them.
    """
    source = Path(path)
    vehicle = vehicle_from_text(file_text(source, "vehicle file"), str(source), source.parent)
    for sentence in vehicle.warnings:
        warn(f"{source.name}: {sentence}", stacklevel=2)
    return vehicle


def vehicle_from_text(text: str, name: str = "vehicle.toml", folder: Path = Path()) -> Vehicle:
    """The vehicle of a TOML text; messages show `name`; files that it names are in `folder`."""
    table = read_table(text, name)
    book = Notebook(name)
    if not table:
        raise book.fail("the file is empty: `coadjoint vehicles show NAME --toml` prints one to start from.")
    if "run" in table or "mission" in table:
        raise book.fail(f"this is not a vehicle file, but one of a run or a mission: `coadjoint run {name}` takes it.")
    if "pilot" in table:
        raise book.fail("the section [pilot] is called [controller]: rename it.")
    whole = Section(book, "The file", "", table)
    for section in SECTIONS:
        _ = section in whole
    whole.done()
    for section in ("vehicle", "body", "added_mass"):
        if section not in table:
            raise book.fail(f"a vehicle file needs a section [{section}].")
    book.sources.update(_texts(book, "sources", table.get("sources", {})))
    book.licences.update(_texts(book, "licences", table.get("licences", {})))
    if strange := [key for key in book.licences if key not in book.sources]:
        raise book.fail(f"[licences] names {strange[0]}, which [sources] does not have.")
    return _vehicle(book, table, folder)


def _vehicle(book: Notebook, table: Table, folder: Path) -> Vehicle:
    head = Section(book, "[vehicle]", "vehicle", table["vehicle"])
    said = {key: head.text(key, "" if key != "name" else None) for key in ("name", "description", "note", "licence")}
    if not said["name"].strip():
        raise head.fail("name must not be empty.")
    axes = BODY_AXES[head.text("axes", None, tuple(BODY_AXES))]
    head.done()

    section = Section(book, "[body]", "body", table["body"])
    body = _body(section, axes)
    matter = Section(book, "[added_mass]", "added_mass", table["added_mass"])
    body["added_mass"] = read_added_mass(matter, axes, body["fluid_density"], body["length"], folder)
    parts = _parts(book, table.get("part", []), axes, body)
    body["volume"] = _volume(section, body, parts)
    del body["buoyancy"]
    section.done()
    sensors = read_sensors(book, table.get("sensors", {}), axes)
    controller = None
    if "controller" in table:
        controller = read_controller(
            Section(book, "[controller]", "controller", table["controller"]), {part.name for part in parts}
        )
    try:
        made = Vehicle(
            name=said["name"],
            description=said["description"],
            note=said["note"],
            licence=said["licence"],
            licences=book.licences,
            parts=tuple(parts),
            sensors=sensors,
            controller=controller,
            provenance=book.provenance,
            sources=book.sources,
            **body,
        )
    except ArgumentError as error:
        raise book.fail(str(error)) from error
    _tell_sources(book)
    object.__setattr__(made, "warnings", (*book.warnings, *check(made)))
    return made


def _body(body: Section, axes: border.Axes) -> Table:
    """The quantities of [body] in SI units and FRD, with the inertia about the mass centre."""
    axes = axes_of(body, axes)
    found = body.quantities(BodySection)
    if "gravity" not in body.given:
        body.book.provenance["body.gravity"] = Quantity(9.81, "m/s^2", "", "the value where a file gives none")
    for center in ("center_of_mass", "center_of_buoyancy"):
        found[center] = border.body_vector(found[center], axes)
    found["inertia"] = _inertia(body, found["inertia"], axes, found["mass"], found["center_of_mass"])
    return found


def _inertia(body: Section, value: object, axes: border.Axes, mass: float, center: Any) -> Array:
    """I_c, (3, 3): about the mass centre, from there or from the origin, I_c = I_O − m(|r|²1 − r rᵀ)."""
    found = np.asarray(value, dtype=float) if isinstance(value, list) else np.zeros(0)
    if found.shape not in ((3,), (3, 3)):
        raise body.fail("inertia must be three numbers, or three rows of three, about the axes of the body.")
    full = np.diag(found) if found.ndim == 1 else found
    if np.max(np.abs(full - full.T)) > 1e-6 * np.max(np.abs(full), initial=1e-300):
        raise body.fail("inertia must be symmetric: give the products of inertia, with a minus, on both sides.")
    full = border.body_tensor(0.5 * (full + full.T), axes)
    about = body.text("inertia_about", "center_of_mass", ("center_of_mass", "origin"))
    if about == "origin":
        full = full - mass * (center @ center * np.eye(3) - np.outer(center, center))
    least = float(np.linalg.eigvalsh(full)[0])
    if least <= 0:
        where = (
            " about the mass centre, after what the offset of the mass centre takes away" if about == "origin" else ""
        )
        raise body.fail(
            f"inertia{where} must be positive about every axis, but has the eigenvalue {least:g} kg m^2: check its "
            "signs, its unit and `inertia_about`."
        )
    return full


def _volume(body: Section, found: Table, parts: list[Any]) -> float:
    """V, m³, from `volume`, from `buoyancy`, or from `neutral = true`: V = m/ρ, with masses and volumes of parts.

    `found`: the quantities of [body].
    """
    density, gravity = found["fluid_density"], found["gravity"]
    given = [key for key in ("volume", "buoyancy") if found[key] is not None] + ["neutral"] * body.flag("neutral")
    if len(given) != 1:
        listed = " and ".join(f"`{key}`" for key in given) or "none of them"
        raise body.fail(f"needs one of `volume`, `buoyancy` and `neutral = true`, but has {listed}.")
    if given == ["neutral"]:
        mass, _, volume, _ = held(parts)
        return (found["mass"] + mass) / density - volume
    if given == ["volume"]:
        return found["volume"]
    if gravity == 0:
        raise body.fail("gives its buoyancy in N, but gravity is 0: give `volume`.")
    return found["buoyancy"] / (density * gravity)


def _parts(book: Notebook, given: object, axes: border.Axes, body: Table) -> list[Any]:
    if not isinstance(given, list):
        raise book.fail("a part begins with [[part]], in double brackets, since a vehicle has several.")
    made: list[Any] = []
    for index, table in enumerate(given):
        title = f"[[part]] {index + 1}"
        if isinstance(table, dict) and isinstance(table.get("name"), str):
            title = f"[[part]] {table['name']}"
        made.append(read_part(Section(book, title, "", table), axes, body, tuple(part.name for part in made)))
    return made


def _texts(book: Notebook, name: str, given: object) -> dict[str, str]:
    section = Section(book, f"[{name}]", name, given)
    return {key: section.text(key) for key in cast("dict[str, Any]", given)}


def _tell_sources(book: Notebook) -> None:
    if book.without_source:
        shown = ", ".join(book.without_source[:4])
        more = f" and {len(book.without_source) - 4} more" if len(book.without_source) > 4 else ""
        book.warn(f'no source is given for {shown}{more}: add source = "…", a key of [sources].')
    notes = " ".join(told.note for told in book.provenance.values())
    unused = [key for key in book.sources if key not in book.used and key not in notes]
    if unused:
        book.warn(f"[sources] has {', '.join(unused)}, which no number and no note names.")


def declared() -> dict[str, type]:
    """The sections of vehicle files, whose fields are their keys: the body, and each kind of part and of sensor."""
    rooms = {"part": "parts", "sensors": "sensors"}
    return {
        "body": BodySection,
        **{f"{word}, {kind}": made for word, room in rooms.items() for kind, made in kinds(room).items()},
    }
