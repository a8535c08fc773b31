"""The quantities of [body] in vehicle files, and the numbers of a shipped body, without NumPy for the catalogue."""

from __future__ import annotations

import tomllib
from importlib.resources import files

from coadjoint import units as u
from coadjoint.texts import Table

DATA = files(str(__package__)) / "data"
"""The folder of the vehicles that are shipped."""
SIZES = ("length", "diameter", "width", "height")
"""Keys of [body] for checks and the unit "prime"."""
MEASURED = {
    "mass": u.MASS,
    "inertia": u.INERTIA,
    "center_of_mass": u.LENGTH,
    "center_of_buoyancy": u.LENGTH,
    "gravity": u.ACCELERATION,
    "fluid_density": u.DENSITY,
    "volume": u.VOLUME,
    "buoyancy": u.FORCE,
    **dict.fromkeys(SIZES, u.LENGTH),
}
"""The dimensions of the quantities of [body]."""


def body_numbers(name: str) -> Table:
    """Mass, inertia, added mass, centres and gravity in SI units, of a file in FRD whose body is neutrally buoyant.

    As `general_vehicle` takes them: "buoyancy" is None, the weight.
    """
    table = tomllib.loads((DATA / f"{name}.toml").read_text(encoding="utf-8"))
    body = table["body"]
    assert table["vehicle"]["axes"] == "FRD" and body["neutral"] and table["added_mass"]["matrix"]["unit"] == "SI"
    given = [key for key in MEASURED if key in body and key not in ("fluid_density", *SIZES)]
    found = {
        **{key: u.in_si(body[key]["value"], body[key]["unit"], MEASURED[key], key) for key in given},
        "added_mass": table["added_mass"]["matrix"]["value"],
    }
    return {
        key: tuple(map(float, value)) if isinstance(value, list) else float(value) for key, value in found.items()
    } | {"buoyancy": None}
