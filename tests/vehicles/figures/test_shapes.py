"""How vehicles look: hulls, fins, propellers and thrusters where their numbers say."""

from __future__ import annotations

import json

import numpy as np
import pytest

import coadjoint_vehicles as vehicles
from coadjoint.plotting.entries import entries
from coadjoint.plotting.scene_of_runs import scene
from coadjoint_vehicles.figures.shapes import geometry
from made_runs import dataset


def looks(name: str) -> dict:
    return geometry(vehicles.load(name))


@pytest.mark.parametrize("name", vehicles.names())
def test_every_vehicle_has_a_hull_of_its_length_and_is_plain_data(name):
    vehicle, found = vehicles.load(name), looks(name)
    assert json.loads(json.dumps(found)) == found
    hull = found["shapes"][0]
    assert hull["kind"] in ("torpedo", "box", "ellipsoid")
    if vehicle.length is not None:
        assert found["size"] >= vehicle.length
    if hull["kind"] == "ellipsoid" and vehicle.length is None:
        assert 4 / 3 * np.pi * np.prod(hull["axes"]) == pytest.approx(float(vehicle.volume))


def test_a_solid_ellipsoid_looks_like_itself():
    """Its inertia and volume are those of its semi-axes, without a length to say so."""
    from dataclasses import replace

    axes = np.array([0.6, 0.3, 0.2])
    volume = 4 / 3 * np.pi * np.prod(axes)
    mass = 1000 * volume
    inertia = mass / 5 * (np.sum(axes**2) - axes**2)
    body = replace(
        vehicles.load("ellipsoid"), mass=mass, inertia=np.diag(inertia), volume=volume, length=None, parts=()
    )
    assert np.allclose(geometry(body)["shapes"][0]["axes"], axes)


def test_fins_have_their_area_and_stand_across_the_hull():
    moving = [item for item in looks("remus_100")["moving"] if item["motion"] == "hinge"]
    for name, normal in (("stern_planes", [0, 0, 1]), ("rudder", [0, 1, 0])):
        pair = [item for item in moving if item["variable"] == f"internal_{name}"]
        assert sum(item["shape"]["chord"] * item["shape"]["span"] for item in pair) == pytest.approx(0.0133)
        for item in pair:
            assert abs(np.dot(item["span_axis"], normal)) < 1e-12
            # Turned about its span by +δ, the trailing edge, at −x, goes towards +normal.
            assert np.allclose(np.cross(item["span_axis"], [-1, 0, 0]), normal)
        assert np.allclose(np.sum([item["at"] for item in pair], axis=0)[1:], 0)


def test_thrusters_of_a_matrix_are_on_the_lines_of_their_thrusts():
    vehicle = vehicles.load("bluerov2_heavy_blue")
    matrix = np.asarray(vehicle.part("thrusters").nominal_matrix)
    jets = [item for item in looks("bluerov2_heavy_blue")["moving"] if item["motion"] == "push"]
    assert len(jets) == matrix.shape[1] == 8
    for item in jets:
        force, torque = matrix[:3, item["column"]], matrix[3:, item["column"]]
        assert np.allclose(item["axis"], force / np.linalg.norm(force))
        across = torque - (torque @ force) * force / (force @ force)  # a torque about the thrust has no place
        assert np.allclose(np.cross(item["at"], force), across, atol=1e-12)


def test_parts_move_by_what_the_run_says():
    run = dataset()
    run["internal_propeller"] = ("time", np.full(200, 10.0))
    run["internal_thrusters"].attrs["units"] = "1"
    moving = [
        {"shape": {"kind": "blades", "diameter": 0.1}, "at": [0, 0, 0], "axis": [1, 0, 0]}
        | {"motion": "spin", "variable": "internal_propeller"},
        {"shape": {"kind": "jet", "diameter": 0.1}, "at": [0, 0, 0], "axis": [1, 0, 0], "motion": "push", "reach": 2.0}
        | {"variable": "internal_thrusters", "column": 1, "offset": -0.5, "factor": 0.25},
        {"shape": {"kind": "plate", "chord": 1, "span": 1}, "at": [0, 0, 0], "axis": [1, 0, 0]}
        | {"motion": "hinge", "variable": "internal_nothing"},
    ]
    run.attrs["vehicle_geometry"] = json.dumps({"size": 1.0, "shapes": [], "moving": moving})
    (body,) = scene(entries([run], ["a"])).members[0].bodies
    spin, push = body.moving
    assert spin.values[-1] == pytest.approx(2 * np.pi * 10 * 10 * 0.1)  # revolutions, a tenth of them
    assert np.allclose(push.values, 0.25 * (run.internal_thrusters.values[:, 1] - 0.5))


def test_a_mesh_takes_the_place_of_the_hull_and_leaves_the_parts():
    run = dataset()
    look = looks("remus_100")
    run.attrs["vehicle_geometry"] = json.dumps(look)
    surface = {"kind": "box", "size": [1, 1, 1]}
    (body,) = scene(entries([run], ["a"]), hull=surface).members[0].bodies
    assert body.shapes == [surface, *look["shapes"][1:]]
    assert [item.shape["kind"] for item in body.moving] == ["plate", "plate"]  # of those that the run has
