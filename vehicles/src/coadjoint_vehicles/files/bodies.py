"""The numbers of a shipped vehicle's body, read from its file without JAX: defaults of models in the catalogue."""

from __future__ import annotations

import tomllib
from importlib.resources import files

from coadjoint import units as u
from coadjoint.texts import Table

DATA = files(str(__package__)) / "data"
"""The folder of the vehicles that are shipped."""
_MEASURED = {
    "mass": u.MASS,
    "inertia": u.INERTIA,
    "center_of_mass": u.LENGTH,
    "center_of_buoyancy": u.LENGTH,
    "gravity": u.ACCELERATION,
}


def body_numbers(name: str) -> Table:
    """Mass, inertia, added mass, centres and gravity in SI units, of a file in FRD whose body is neutrally buoyant.

    As `general_vehicle` takes them: "buoyancy" is None, the weight.
    """
    table = tomllib.loads((DATA / f"{name}.toml").read_text(encoding="utf-8"))
    body = table["body"]
    assert table["vehicle"]["axes"] == "FRD" and body["neutral"] and table["added_mass"]["matrix"]["unit"] == "SI"
    found = {
        **{key: u.in_si(body[key]["value"], body[key]["unit"], dimension, key) for key, dimension in _MEASURED.items()},
        "added_mass": table["added_mass"]["matrix"]["value"],
    }
    return {
        key: tuple(map(float, value)) if isinstance(value, list) else float(value) for key, value in found.items()
    } | {"buoyancy": None}
