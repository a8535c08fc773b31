"""How large a vehicle and its parts are drawn: from the numbers of its file, and from its inertia where it has none."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import coadjoint_vehicles as vehicles
from coadjoint_vehicles.figures.shapes import geometry
from coadjoint_vehicles.parts import Fin, Hull, Propeller

AXES = np.array([0.6, 0.3, 0.2])
VOLUME = float(4 / 3 * np.pi * np.prod(AXES))
INERTIA = 1000 * VOLUME / 5 * (np.sum(AXES**2) - AXES**2)
BODY = replace(
    vehicles.load("ellipsoid"), mass=1000 * VOLUME, inertia=np.diag(INERTIA), volume=VOLUME, length=None, parts=()
)
FIN: dict[str, Any] = {"area": 0.01, "lift_slope": 3.0, "stall": 0.3}


def shapes(*parts: Any, **sizes: Any) -> list[dict[str, Any]]:
    """What is drawn of the ellipsoid with these parts and sizes: first its hull."""
    found = geometry(replace(BODY, parts=parts, **sizes))
    return [*found["shapes"], *found["moving"]]


def test_a_body_of_three_sides_is_a_box_as_long_as_its_longest_side():
    body = replace(BODY, length=1.0, width=2.0, height=0.5)
    assert geometry(body)["size"] == 2.0
    assert geometry(body)["shapes"][0] == {"kind": "box", "size": [1.0, 2.0, 0.5], "at": [0.0, 0.0, 0.0]}
    assert shapes(length=1.0, width=2.0)[0]["kind"] == "ellipsoid"
    assert shapes(length=1.0, width=2.0, height=0.5, diameter=0.3)[0]["kind"] == "torpedo"


def test_a_torpedo_has_its_own_diameter_or_the_larger_side_of_its_hull():
    hull = Hull("hull", axial_drag=0.1, axial_area=0.1, crossflow_drag=1.0, width=0.2, height=0.4, length=1.7)
    assert shapes(hull)[0] == {"kind": "torpedo", "length": 1.7, "diameter": 0.4, "at": [0.0, 0.0, 0.0]}
    assert shapes(hull, length=1.5, diameter=0.3)[0]["diameter"] == 0.3
    assert shapes(hull, length=1.5)[0]["length"] == 1.5
    assert shapes(diameter=0.5)[0]["length"] == pytest.approx(2 * AXES[0])


def test_an_ellipsoid_of_a_length_keeps_its_volume():
    (hull,) = shapes(length=2.0)
    assert hull["axes"][0] == 1.0 and np.prod(hull["axes"]) == pytest.approx(np.prod(AXES))
    assert hull["axes"][1] / hull["axes"][2] == pytest.approx(1.5)
    assert geometry(BODY)["size"] == pytest.approx(1.2)
    assert shapes(inertia=INERTIA)[0]["axes"] == pytest.approx(AXES)


def test_an_inertia_that_no_ellipsoid_has_is_drawn_with_a_thin_one():
    (hull,) = shapes(inertia=np.diag([2.0, 1.0, 0.5]))
    assert np.all(np.isfinite(hull["axes"])) and min(hull["axes"]) > 0
    assert np.prod(hull["axes"]) == pytest.approx(np.prod(AXES))


def test_a_fin_on_the_middle_line_is_a_pair_and_one_beside_it_is_one():
    """Plates of 1.3 times their chord in span; a pair begins at 0.3 diameters from the axis."""
    look = {"length": 2.0, "diameter": 0.4}
    pair = shapes(Fin("rudder", position=(-0.8, 0.0, 0.0), normal=(0.0, 1.0, 0.0), limit=0.3, **FIN), **look)[1:]
    assert [item["shape"]["span"] for item in pair] == pytest.approx([np.sqrt(0.005 * 1.3)] * 2)
    assert [item["shape"]["span"] / item["shape"]["chord"] for item in pair] == pytest.approx([1.3, 1.3])
    assert sorted(item["at"][2] for item in pair) == pytest.approx(
        [s * (0.12 + np.sqrt(0.005 * 1.3) / 2) for s in (-1, 1)]
    )
    assert {item["motion"] for item in pair} == {"hinge"}
    beside = Fin("wing", position=(0.1, 0.1, 0.0), normal=(0.0, 0.0, 1.0), **FIN)
    (one,) = shapes(beside, **look)[1:]
    assert one["chord"] * one["span"] == pytest.approx(0.01) and one["at"] == pytest.approx([0.1, 0.1, 0.0])
    assert one["dim"] and "motion" not in one
    (wide,) = shapes(replace(beside, area=9.0), **look)[1:]
    assert wide["chord"] * wide["span"] == pytest.approx(0.05 * 2.0**2)


def test_a_fin_at_the_stern_does_not_stand_behind_the_hull():
    pair = shapes(Fin("rudder", position=(-1.0, 0.0, 0.0), normal=(0.0, 1.0, 0.0), **FIN), length=2.0, diameter=0.4)
    assert [item["at"][0] for item in pair[1:]] == pytest.approx([-1.0 + np.sqrt(0.005 / 1.3)] * 2)


def test_a_propeller_is_where_it_says_or_just_behind_the_hull():
    told: dict[str, Any] = {"diameter": 0.2, "thrust": (0.4, -0.3), "torque": (0.05, -0.04), "limit": 20.0}
    told |= dict.fromkeys(("thrust_deduction", "wake_fraction", "torque_fraction"), 0.1)
    stern, placed = (
        shapes(Propeller("propeller", position=at, **told), length=2.0, diameter=0.4)[1]
        for at in ((0.0, 0.0, 0.0), (-0.7, 0.0, 0.1))
    )
    assert stern["at"] == pytest.approx([-1.04, 0.0, 0.0]) and placed["at"] == [-0.7, 0.0, 0.1]
    assert stern["shape"]["diameter"] == 0.2 and stern["variable"] == "internal_propeller"
