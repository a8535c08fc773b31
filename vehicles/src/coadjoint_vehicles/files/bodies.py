"""The section [body] of vehicle files, and the numbers of a shipped body, read without JAX for the catalogue."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib.resources import files

from coadjoint import checks
from coadjoint import units as u
from coadjoint.arrays import PyTree, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.sections import key, keys
from coadjoint.texts import Table

DATA = files(str(__package__)) / "data"
"""The folder of the vehicles that are shipped."""


def _three(value: object, name: str) -> list[float]:
    if not isinstance(value, list) or len(value) != 3 or any(isinstance(inner, list) for inner in value):
        raise ArgumentError(f"{name} must be 3 numbers in brackets, but is {value}.")
    return value


@dataclass(frozen=True, kw_only=True)
class BodySection:
    """The quantities of [body], of the hull without what parts hold; one of `volume` and `buoyancy`, or `neutral`."""

    mass: Scalar = key("mass, without what parts hold", u.MASS, check=checks.positive)
    inertia: PyTree = key("moments of inertia, three or three rows of three", u.INERTIA)
    center_of_mass: list[float] = key("centre of mass from the origin", u.LENGTH, check=_three)
    center_of_buoyancy: list[float] = key("centre of buoyancy from the origin", u.LENGTH, check=_three)
    fluid_density: Scalar = key("density of the water", u.DENSITY, check=checks.positive)
    gravity: Scalar = key("gravity", u.ACCELERATION, check=checks.not_negative, default=9.81)
    volume: Scalar | None = key("volume of the water displaced", u.VOLUME, check=checks.positive, default=None)
    buoyancy: Scalar | None = key("force of buoyancy", u.FORCE, check=checks.positive, default=None)
    length: Scalar | None = key("length of the hull", u.LENGTH, check=checks.positive, default=None)
    diameter: Scalar | None = key("diameter of a round hull", u.LENGTH, check=checks.positive, default=None)
    width: Scalar | None = key("width of another hull", u.LENGTH, check=checks.positive, default=None)
    height: Scalar | None = key("height of another hull", u.LENGTH, check=checks.positive, default=None)


SIZES = ("length", "diameter", "width", "height")
"""Its keys for checks and the unit "prime"."""


def body_numbers(name: str) -> Table:
    """Mass, inertia, added mass, centres and gravity in SI units, of a file in FRD whose body is neutrally buoyant.

    As `general_vehicle` takes them: "buoyancy" is None, the weight.
    """
    table = tomllib.loads((DATA / f"{name}.toml").read_text(encoding="utf-8"))
    body = table["body"]
    assert table["vehicle"]["axes"] == "FRD" and body["neutral"] and table["added_mass"]["matrix"]["unit"] == "SI"
    own = {key: declared for key, declared in keys(BodySection).items() if key not in ("fluid_density", *SIZES)}
    found = {
        **{
            key: u.in_si(body[key]["value"], body[key]["unit"], declared.dimension, key)
            for key, declared in own.items()
            if key in body and declared.dimension is not None
        },
        "added_mass": table["added_mass"]["matrix"]["value"],
    }
    return {
        key: tuple(map(float, value)) if isinstance(value, list) else float(value) for key, value in found.items()
    } | {"buoyancy": None}
