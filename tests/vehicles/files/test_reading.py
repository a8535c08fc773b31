"""Reading vehicle files: units, axes, forms of added mass, and a file in FLU that is the same vehicle as in FRD."""

from __future__ import annotations

from dataclasses import dataclass, fields
from importlib import import_module
from typing import Any, ClassVar

import numpy as np
import pytest

from coadjoint import units as u
from coadjoint.errors import ArgumentError
from coadjoint.sections import keys
from coadjoint_vehicles import Craft, Part
from coadjoint_vehicles.files import vehicle_to_toml
from coadjoint_vehicles.files.file import vehicle_from_text
from coadjoint_vehicles.files.kinds import kinds
from coadjoint_vehicles.files.read_derivatives import _without_added_mass
from coadjoint_vehicles.files.registry import vehicle_text
from coadjoint_vehicles.hydrodynamics import added_mass_about, ellipsoid_added_mass, slender_body_added_mass
from coadjoint_vehicles.parts.measured import measured, not_negative, place
from coadjoint_vehicles.parts.part import acting_at

HEAD = """
[vehicle]
name = "V"
axes = "{axes}"
[sources]
S = "somewhere"
[body]
mass = {{ value = 30, unit = "kg", source = "S" }}
inertia = {{ value = [[1, 0.1, 0.2], [0.1, 2, 0.3], [0.2, 0.3, 2.5]], unit = "kg m^2", source = "S" }}
center_of_mass = {{ value = [0.01, 0, {down}], unit = "m", source = "S" }}
center_of_buoyancy = {{ value = [0.01, 0, 0], unit = "m", source = "S" }}
neutral = true
fluid_density = {{ value = 1000, unit = "kg/m^3", source = "S" }}
length = {{ value = 1.5, unit = "m", source = "S" }}
"""


ELLIPSOID = "semi_axes = { value = [0.75, 0.1, 0.1], unit = 'm', source = 'S' }"


def vehicle(added_mass: str, axes: str = "FRD", parts: str = "", folder=None):
    text = HEAD.format(axes=axes, down=0.02 if axes == "FRD" else -0.02) + f"[added_mass]\n{added_mass}\n{parts}"
    return vehicle_from_text(text, "v.toml", *(() if folder is None else (folder,)))


@pytest.mark.parametrize(
    ("unit", "dimension", "factor"),
    [
        ("kg m^2", u.INERTIA, 1.0),
        ("g m²", u.INERTIA, 1e-3),
        ("lbf", u.FORCE, 4.4482216152605),
        ("kN", u.FORCE, 1e3),
        ("kg m/s^2", u.FORCE, 1.0),
        ("N s^2/m^4", u.DENSITY, 1.0),
        ("g/L", u.DENSITY, 1.0),
        ("deg", u.ANGLE, np.pi / 180),
        ("deg/s", u.ANGULAR_VELOCITY, np.pi / 180),
        ("rpm", u.ANGULAR_VELOCITY, 2 * np.pi / 60),
        ("rpm", u.REVOLUTIONS, 1 / 60),
        ("rad/s", u.REVOLUTIONS, 1 / (2 * np.pi)),
        ("Hz", u.REVOLUTIONS, 1.0),
        ("1/deg", u.PER_ANGLE, 180 / np.pi),
        ("1", u.PER_ANGLE, 1.0),
        ("kn", u.SPEED, 1852 / 3600),
        ("cm^2", u.AREA, 1e-4),
        ("L/min", u.VOLUME_RATE, 1e-3 / 60),
        ("%", u.NUMBER, 0.01),
    ],
)
def test_units_are_what_they_measure(unit, dimension, factor) -> None:
    assert u.in_si([2.0], unit, dimension, "x")[0] == pytest.approx(2 * factor, rel=1e-15)


@pytest.mark.parametrize(
    ("unit", "dimension"),
    [
        ("m", u.MASS),
        ("deg", u.NUMBER),
        ("1", u.ANGLE),
        ("1/s", u.ANGULAR_VELOCITY),
        ("rad", u.LENGTH),
        ("rpm", u.TIME),
    ],
)
def test_units_of_another_kind_are_refused(unit, dimension) -> None:
    with pytest.raises(ArgumentError, match="give a unit of that kind"):
        u.in_si(1.0, unit, dimension, "x")


@pytest.mark.parametrize("kind", sorted({"derivatives", "thrusters"} ^ set(kinds("parts"))))
def test_every_number_of_a_part_says_what_it_keys(kind):
    cls = kinds("parts")[kind]
    assert {field.name for field in fields(cls)} - {"name"} == set(keys(cls))


@pytest.mark.parametrize("kind", sorted(kinds("controllers")))
def test_every_controller_of_a_file_has_a_period_and_a_delay_in_seconds(kind):
    found = keys(kinds("controllers")[kind])
    assert found["period"].dimension == found["delay"].dimension == u.TIME


def test_a_new_part_is_one_class_and_one_line_of_its_room(monkeypatch):
    """A brake with one field, in a file of its own, listed in `parts.__init__`: read, turned, written and refused."""

    @dataclass(frozen=True, eq=False)
    class Brake(Part):
        kind: ClassVar[str] = "brake"
        strength: Any = measured(u.FORCE, not_negative)
        position: Any = place(default=(0.0, 0.0, 0.0))

        def force(self, flow, actual, own):
            return acting_at(own.position, -own.strength * flow.velocity)

    room = import_module("coadjoint_vehicles.parts")
    monkeypatch.setattr(room, "Brake", Brake, raising=False)
    monkeypatch.setattr(room, "__all__", [*room.__all__, "Brake"])
    part = """[[part]]
kind = "brake"
name = "chute"
strength = { value = 0.002, unit = "kN", source = "S" }
position = { value = [1.0, 2.0, 3.0], unit = "cm", source = "S" }
"""
    made = vehicle(ELLIPSOID, "FLU", part)
    chute: Any = made.part("chute")
    assert chute.strength == 2.0 and np.allclose(chute.position, [0.01, -0.02, -0.03])
    assert Craft(made).parameters.chute.strength == 2.0
    again: Any = vehicle_from_text(vehicle_to_toml(made)).part("chute")
    assert again.strength == 2.0 and np.allclose(again.position, chute.position)
    with pytest.raises(ArgumentError, match="`strength` of the brake `chute` must be at least 0"):
        vehicle(ELLIPSOID, "FLU", part.replace("0.002", "-1"))


def test_a_file_in_flu_is_the_same_vehicle_as_in_frd() -> None:
    """Every vector, matrix and coefficient with the signs of the other axes, by hand."""
    both = {}
    for axes, s in (("FRD", 1), ("FLU", -1)):
        matrix = np.diag([4.0, 40, 50, 1, 8, 9])
        matrix[0, 4] = matrix[4, 0] = 2.0 * s  # surge with pitch
        matrix[1, 5] = matrix[5, 1] = -3.0  # sway with yaw
        matrix[1, 3] = matrix[3, 1] = 1.5 * s  # sway with roll
        rows = f"matrix = {{ value = {matrix.tolist()}, unit = 'SI', source = 'S' }}"
        rows += f"\nabout = {{ value = [0.1, 0, {0.05 * s}], unit = 'm', source = 'S' }}"
        parts = f"""
[[part]]
kind = "fin"
name = "rudder"
position = {{ value = [-0.7, 0, {-0.1 * s}], unit = "m", source = "S" }}
normal = {{ value = [0, {s}, 0], unit = "1", source = "S" }}
area = {{ value = 100, unit = "cm^2", source = "S" }}
lift_slope = {{ value = 3, unit = "1/rad", source = "S" }}
stall = {{ value = 20, unit = "deg", source = "S" }}
[[part]]
kind = "damping"
name = "drag"
linear = {{ value = [5, 6, 7, 1, 1, 1], unit = "SI", source = "S" }}
[[part]]
kind = "derivatives"
name = "more"
[part.coefficients]
unit = "SI"
source = "S"
[part.coefficients.value]
Y_uv = -20.0
M_uw = {3.0}
"Z_u|w|" = {-4.0 * s}
K_vw = {0.5}
X_ww = 0.25
[[part]]
kind = "thrusters"
name = "jets"
[part.allocation]
value = [[1, 1], [{0.1 * s}, 0], [0, 0], [0, 0.3], [0, {0.2 * s}], [0, {-0.4 * s}]]
unit = "SI"
source = "S"
[part.curve]
linear = {{ value = 2, unit = "SI", source = "S" }}
"""
        text = vehicle(rows, axes, parts)
        both[axes] = text
    ours, theirs = both["FRD"], both["FLU"]
    assert np.array_equal(ours.added_mass, theirs.added_mass)
    assert theirs.center_of_mass == pytest.approx(ours.center_of_mass)
    assert theirs.inertia == pytest.approx(np.asarray(ours.inertia) * [[1, -1, -1], [-1, 1, 1], [-1, 1, 1]])
    assert np.array_equal(ours.part("rudder").position, theirs.part("rudder").position)
    assert np.array_equal(ours.part("rudder").normal, theirs.part("rudder").normal)
    assert np.array_equal(ours.part("jets").allocation, theirs.part("jets").allocation)
    assert np.array_equal(ours.part("drag").linear, theirs.part("drag").linear)
    found = theirs.part("more").coefficients
    assert {key: float(value) for key, value in found.items()} == {
        key: float(value) for key, value in ours.part("more").coefficients.items()
    }


def test_added_mass_about_another_point_of_the_body() -> None:
    diagonal = [4.0, 40.0, 50.0, 1.0, 8.0, 9.0]
    found = vehicle(
        f"matrix = {{ value = {diagonal}, unit = 'SI', source = 'S' }}\nabout = {{ value = [100, 0, 20], unit = 'mm' }}"
    )
    back = added_mass_about(found.added_mass, (0.1, 0.0, 0.02))
    assert back == pytest.approx(np.diag(diagonal), abs=1e-12)
    assert found.added_mass[1, 5] == pytest.approx(0.1 * 40)  # what sways ahead of the origin yaws


def test_added_mass_of_an_ellipsoid_and_of_strips() -> None:
    found = vehicle("semi_axes = { value = [75, 10, 10], unit = 'cm', source = 'S' }")
    assert np.array_equal(found.added_mass, ellipsoid_added_mass((0.75, 0.1, 0.1), 1000.0))
    x, b = [-0.75, -0.5, 0.5, 0.75], [0.0, 0.1, 0.1, 0.0]
    found = vehicle(
        f"stations = {{ value = {x}, unit = 'm', source = 'S' }}\n"
        f"half_breadth = {{ value = {b}, unit = 'm', source = 'S' }}"
    )
    assert np.array_equal(found.added_mass, slender_body_added_mass(x, b, fluid_density=1000.0))


def test_added_mass_from_a_file_of_wamit_beside_the_vehicle_file(tmp_path) -> None:
    diagonal = [0.5, 4.0, 4.0, 0.1, 0.8, 0.8]
    rows = [f"0.0 {i + 1} {i + 1} {value}" for i, value in enumerate(diagonal)]
    (tmp_path / "hull.1").write_text("\n".join(rows), encoding="utf-8")
    form = "wamit = 'hull.1'\naxes = 'z_up'\nulen = { value = 10, unit = 'cm', source = 'S' }"
    found = vehicle(form, folder=tmp_path)
    power = np.array([3, 3, 3, 5, 5, 5])
    assert np.diag(found.added_mass) == pytest.approx(1000 * 0.1**power * diagonal)


def test_a_vehicle_that_holds_masses_is_neutral_with_them() -> None:
    parts = """
[[part]]
kind = "moving_mass"
name = "battery"
mass = { value = 10, unit = "kg", source = "S" }
position = { value = [0, 0, 0], unit = "m", source = "S" }
axis = { value = [1, 0, 0], unit = "1", source = "S" }
low = { value = -5, unit = "cm", source = "S" }
high = { value = 5, unit = "cm", source = "S" }
rate = { value = 1, unit = "cm/s", source = "S" }
"""
    found = vehicle("semi_axes = { value = [75, 10, 10], unit = 'cm', source = 'S' }", parts=parts)
    assert found.volume == pytest.approx(40 / 1000, rel=1e-14)


def test_texts_of_shipped_files_are_utf_8_with_lines_that_end() -> None:
    assert vehicle_text("rexrov").endswith("\n") and "\r" not in vehicle_text("rexrov")


def test_what_the_added_mass_says_is_taken_once_from_a_product_written_both_ways() -> None:
    M = np.diag([2.0, 30.0, 30.0, 0.1, 4.0, 4.0])
    left = _without_added_mass({"Y_ur": 5.0, "Y_ru": 1.0}, {"Y_ur": 1.0, "Y_ru": 1.0}, M)
    assert sum(left.values()) == 5.0 + 1.0 + M[0, 0]  # −(ω × P)_y = −r M_11 u


def test_terms_of_the_added_mass_that_no_coefficient_names_are_told() -> None:
    """A simulator without Munk moments writes no M_uw and N_uv: its vehicle would keep those of the added mass."""
    form = "matrix = { value = [2, 30, 30, 0.1, 4, 4], unit = 'SI', source = 'S' }"
    part = """
[[part]]
kind = "derivatives"
name = "manoeuvring"
with_added_mass = true

[part.coefficients]
unit = "SI"
source = "S"

[part.coefficients.value]
"""
    rest = "Y_v = -5\nX_wq = -30\nX_vr = 30\nY_ur = -2\nY_wp = 30\nZ_uq = 2\nZ_vp = -30\nM_pr = 3.9\nN_pq = -3.9\n"
    told = [sentence for sentence in vehicle(form, parts=part + rest).warnings if "with_added_mass" in sentence]
    assert len(told) == 1 and "names no N_uv, M_uw, so that" in told[0] and "N_uv = -28, M_uw = 28 in SI" in told[0]
    stated = vehicle(form, parts=part + rest + "M_uw = 0.0\nN_uv = 0.0\n")
    assert not any("with_added_mass" in sentence for sentence in stated.warnings)
    assert stated.part("manoeuvring").coefficients == {"Y_v": -5.0, "M_uw": -28.0, "N_uv": 28.0}
