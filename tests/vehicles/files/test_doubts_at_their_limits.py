"""From where on a vehicle is doubted: just sound on one side of each limit, and named with its numbers on the other."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import coadjoint_vehicles as vehicles
from coadjoint.errors import FileError
from coadjoint_vehicles.files import check_parts, checks
from coadjoint_vehicles.files.added_masses import _matrix

MASS, G = 100.0, 9.81
SOUND = replace(
    vehicles.load("ellipsoid"),
    mass=MASS, volume=MASS / 1025, fluid_density=1025.0, gravity=G, parts=(), length=2.0, diameter=0.4, width=None,
    height=None, inertia=np.diag([3.0, 20.0, 20.0]), added_mass=np.diag([10.0, 90.0, 90.0, 0.0, 15.0, 15.0]),
    center_of_mass=np.zeros(3), center_of_buoyancy=np.array([0.0, 0.0, -0.02]),
)  # fmt: skip


def said(rule: Any, **changes: Any) -> list[str]:
    return list(rule(replace(SOUND, **changes)))


def test_a_sound_vehicle_is_not_doubted():
    assert checks.check(SOUND) == ()


@pytest.mark.parametrize(("share", "words"), [(1.031, "+3.1 %: it floats up"), (0.969, "-3.1 %: it sinks")])
def test_weight_and_buoyancy_belong_together_within_3_percent(share, words):
    (sentence,) = said(checks._balance, volume=share * SOUND.volume)
    assert words in sentence and f"its weight is {MASS * G:.4g} N and its buoyancy {share * MASS * G:.4g} N" in sentence
    for sound in (1.029, 0.971):
        assert said(checks._balance, volume=sound * SOUND.volume) == []


def test_a_vehicle_rights_itself_where_its_buoyancy_is_above_its_mass():
    (sentence,) = said(checks._righting, center_of_buoyancy=[0.0, 0.0, 0.003])
    assert "is 3 mm below its centre of mass: it turns over" in sentence
    (sentence,) = said(checks._righting, center_of_buoyancy=[0.0, 0.0, 0.0])
    assert "at one height" in sentence and said(checks._righting, center_of_buoyancy=[0.0, 0.0, -1e-6]) == []
    assert said(checks._righting, center_of_buoyancy=[0.0, 0.0, 0.003], gravity=0.0) == []


@pytest.mark.parametrize(
    ("offset", "words"),
    [
        ((0.004, 0.0), "trim of 11° nose down"), ((-0.004, 0.0), "trim of 11° nose up"),
        ((0.0, 0.004), "heel of 11° to starboard"), ((0.0, -0.004), "heel of 11° to port"),
    ],
)  # fmt: skip
def test_a_trim_or_heel_over_10_degrees_is_doubted(offset, words):
    (sentence,) = said(checks._trim, center_of_buoyancy=[-offset[0], -offset[1], -0.02])
    assert words in sentence and "4 mm off" in sentence
    assert said(checks._trim, center_of_buoyancy=[-0.8 * offset[0], -0.8 * offset[1], -0.02]) == []


def test_moments_of_inertia_are_those_of_a_body_of_this_size():
    (sentence,) = said(checks._inertia, inertia=np.diag([3.0, 4.0, 7.5]))
    assert (
        "3, 4 and 7.5 kg m² break 7.5 ≤ 3 + 4" in sentence
        and said(checks._inertia, inertia=np.diag([3.0, 4.0, 7.0])) == []
    )
    sentences = said(checks._inertia, inertia=np.diag([250.0, 450.0, 450.0]))
    assert len(sentences) == 1 and "√(I/m) = 2.12 m, is more than its size of 2 m" in sentences[0]
    assert said(checks._inertia, inertia=np.diag([250.0, 390.0, 390.0])) == []
    (sentence,) = said(checks._inertia, inertia=np.full(3, 0.15))
    assert (
        "√(I/m) ≤ 0.039 m, are tiny for a size of 2 m" in sentence
        and said(checks._inertia, inertia=np.full(3, 0.17)) == []
    )
    assert "its size of 0.921 m" in said(checks._inertia, length=None, inertia=np.diag([60.0, 90.0, 90.0]))[0]


def test_added_mass_is_there_and_of_the_size_of_the_water_displaced():
    assert said(checks._added_mass, added_mass=np.zeros((6, 6))) == [
        "it has no added mass at all: water that is pushed aside is left out."
    ]
    assert said(checks._added_mass, added_mass=np.diag([10.0, 0.0, 90.0, 0, 0, 0])) == [
        "its added mass in sway is zero, which no body has."
    ]
    (sentence,) = said(checks._added_mass, added_mass=np.diag([10.0, 90.0, 510.0, 0, 0, 0]))
    assert "added mass in heave, 510 kg, is 5 times the water that it displaces (100 kg)" in sentence
    assert said(checks._added_mass, added_mass=np.diag([10.0, 90.0, 499.0, 0, 0, 0])) == []


def test_axes_of_a_slender_body_are_not_exchanged():
    (sentence,) = said(checks._axes, added_mass=np.diag([10.0, 9.0, 90.0, 0, 0, 0]))
    assert "added mass in sway, 9 kg, is less than in surge, 10 kg, on a body 5.0 times as long as wide" in sentence
    (sentence,) = said(checks._axes, inertia=np.diag([3.0, 20.0, 2.0]))
    assert "inertia about z, 2 kg m², is less than about x, 3 kg m²" in sentence
    wrong: dict[str, Any] = {"added_mass": np.diag([10.0, 9.0, 10.0, 0, 0, 0]), "inertia": np.full(3, 3.0)}
    assert said(checks._axes, diameter=0.67, **wrong) == [] and len(said(checks._axes, diameter=2 / 3, **wrong)) == 1


def test_water_and_gravity_are_those_of_the_earth():
    for density, doubted in ((949.0, True), (950.0, False), (1100.0, False), (1101.0, True)):
        assert bool(said(checks._surroundings, fluid_density=density)) == doubted
    for gravity, doubted in ((9.69, True), (9.7, False), (9.9, False), (9.91, True), (0.0, False)):
        assert bool(said(checks._surroundings, gravity=gravity)) == doubted


def test_the_least_number_on_the_diagonal_of_an_added_mass_is_named():
    section: Any = SimpleNamespace(
        quantity=lambda *_, **__: ([1.0, 2.0, -1.0, 3.0, -5.0, 1.0], None), fail=lambda told: FileError(told)
    )
    with pytest.raises(FileError, match="-5 on its diagonal, row 5: the kinetic energy of water is positive"):
        _matrix(section, 1000.0, None)


@pytest.mark.parametrize(
    ("sound", "doubted", "words"),
    [
        ({"axial_drag": 3.0}, {"axial_drag": 3.01}, "axial_drag of `hull` is 3.01; blunt bodies have 1 to 2"),
        ({"crossflow_drag": 3.0}, {"crossflow_drag": 3.01}, "crossflow_drag of `hull` is 3.01"),
        ({"length": 3.0}, {"length": 3.01}, "is 3.01 m long on a vehicle of 2 m: check the units"),
        ({"axial_area": 1.4}, {"axial_area": 1.5}, "axial_area of `hull` is 1.5 m², but the vehicle shows 0.284 m²"),
        ({"width": 0.3, "height": 0.2}, {"width": 0.31, "height": 0.2}, "are sway and heave exchanged"),
        ({"width": 0.2, "height": 0.31}, {"width": 0.31, "height": 0.2}, "10 kg in sway and 9 kg in heave"),
    ],
)
def test_a_hull_is_doubted_beyond_the_numbers_of_hulls(sound, doubted, words):
    craft = replace(vehicles.load("remus_100"), added_mass=np.diag([1.0, 10.0, 9.0, 0, 0, 0]), diameter=0.6013)
    hull = replace(craft.part("hull"), width=0.2, height=0.2)
    assert list(check_parts._hull(replace(hull, **sound), craft, 2.0)) == []
    (sentence,) = check_parts._hull(replace(hull, **doubted), craft, 2.0)
    assert words in sentence
