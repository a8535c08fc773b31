"""The page that plays a scene: what is in it, whose work it holds, and that names do no harm."""

from __future__ import annotations

import hashlib
import json
import re
from html import unescape
from importlib.resources import files

import numpy as np
import pytest
import xarray

from coadjoint.errors import ArgumentError
from coadjoint.models.multibody import Body, Joint, Mechanism
from coadjoint.plotting import bodies
from coadjoint.plotting.entries import entries
from coadjoint.plotting.player import page
from coadjoint.plotting.plots import Plots
from coadjoint.plotting.scene import DrawnBody, Member, Scene, plain, quaternions
from coadjoint.plotting.scene_of_runs import scene
from coadjoint.simulation.saved import SavedRun
from made_runs import VEHICLE, dataset

THREE = "56662f375f9ea2a778b9b00d20769783e7898e73e26ab4145f1facfa1df56c3d"
PAGE = files("coadjoint.plotting").joinpath("page")
HARMFUL = "</script><img src=x onerror=alert(1)>"


def held(text: str) -> dict:
    return json.loads(re.search(r'<script type="application/json" id="scene">(.*)</script>', text)[1])


def test_three_js_is_the_file_that_the_page_of_dependencies_names():
    data = PAGE.joinpath("three.min.js").read_bytes()
    assert hashlib.sha256(data).hexdigest() == THREE
    assert len(data) < 1_000_000


def test_a_page_holds_its_licence_and_stays_below_two_megabytes():
    text = page(scene(entries([dataset(60_000), dataset(100)], ["a", "b"])))
    assert PAGE.joinpath("three.LICENSE").read_text() in text
    assert len(text) - len(json.dumps(held(text))) < 700_000
    assert len(text) < 2_000_000


def test_a_page_holds_places_turns_and_readings_of_every_member():
    run = dataset(100)
    first, second = held(page(scene(entries([run, dataset(50_000)], ["a", HARMFUL]))))["members"]
    assert np.allclose(first["bodies"][0]["place"], run.q.values, atol=1e-4)
    assert np.allclose(first["bodies"][0]["turn"], np.tile([0, 0, 0, 1], (100, 1)))
    assert [reading["name"] for reading in first["readings"]][:2] == ["depth", "set point"]
    assert np.allclose(first["current"], [[0.0] * 100, [0.2] * 100, [0.0] * 100])
    assert second["label"] == HARMFUL
    assert second["time"][-1] == 10 and len(second["time"]) <= 4002


def linked(count=2):
    """Two links of a power that turn about their own axes, apart from each other."""
    turns = np.stack([np.tile(np.eye(3), (4, 1, 1)), np.tile(np.diag([1.0, -1, -1]), (4, 1, 1))], axis=1)
    q = np.arange(4.0)[:, None] * np.array([1.0, 0, 0, 0, 0, 2.0]) + np.array([0, 0, 1.0, 0, 0, 0])
    found = {"R": (("time", "link", "row", "column"), turns), "q": (("time", "q_axis"), q)}
    return xarray.Dataset(found, coords={"time": np.arange(4.0)})


def test_links_of_a_power_are_bodies_at_their_own_places():
    first, second = held(page(scene(entries([linked()], None))))["members"][0]["bodies"]
    assert np.allclose(first["place"], [[t, 0, 1] for t in range(4)])
    assert np.allclose(second["place"], [[0, 0, 2 * t] for t in range(4)])
    assert np.allclose(np.abs(second["turn"]), np.tile([1, 0, 0, 0], (4, 1)))


def test_bodies_of_a_mechanism_reach_their_joints_and_wheels_have_their_radius():
    mechanism = Mechanism(
        bodies={
            "arm": Body(mass=1.0, inertia=(1.0, 1.0, 1.0), position=(0.5, 0, 0)),
            "wheel": Body(mass=1.0, inertia=(1.0, 1.0, 1.0), position=(1, 0, 0)),
        },
        joints={
            "hinge": Joint("revolute", "ground", "arm", at=(0, 0, 0), axis=(0, 0, 1)),
            "axle": Joint("revolute", "arm", "wheel", at=(1, 0, 0), axis=(0, 1, 0)),
            "road": Joint("rolling", "ground", "wheel", at=(1, 0, 0), radius=0.3, normal=(0, 0, 1), axis=(0, 1, 0)),
        },
    )
    arm, wheel = bodies.linkage(mechanism)
    rods = [shape for shape in arm.shapes if shape["kind"] == "rod"]
    assert [shape["to"] for shape in rods] == [[-0.5, 0, 0], [0.5, 0, 0]]
    assert {shape["radius"] for shape in rods} == {0.03 * 0.5}
    balls = [shape["axes"] for shape in arm.shapes if shape["kind"] == "ellipsoid"]
    assert balls == [pytest.approx([1.6 * 0.03 * 0.5] * 3)] * 2
    assert wheel.shapes[-1]["axes"] == pytest.approx([0.3, 0.015, 0.3])
    shown = scene(entries([linked()], None), [arm, wheel])
    assert [len(one.shapes) for one in shown.members[0].bodies] == [4, 2]


def test_a_page_opens_with_all_of_a_vehicles_track_and_a_compass_instead_of_axes():
    text = page(scene(entries([dataset(100)], None)))
    found = held(text)
    assert (found["follow"], found["pivot"], found["frames"], found["down"]) == (-1, None, False, True)
    assert '<svg id="compass"' in text and 'part("compass").toggleAttribute("hidden", !given.down)' in text


def test_a_body_that_turns_about_a_fixed_point_has_a_pivot_and_axes():
    time = np.linspace(0.0, 1.0, 9)
    turns = np.array([[[np.cos(t), -np.sin(t), 0], [np.sin(t), np.cos(t), 0], [0, 0, 1]] for t in time])
    run = xarray.Dataset({"R": (("time", "i", "j"), turns)}, {"time": time})
    found = held(page(scene(entries([run], None))))
    assert found["pivot"] == [0, 0, 0] and found["frames"] is True
    solids = [bodies.Solid([bodies.box((1, 1, 1))], place=(0.0, 0.0, 2.0))]
    assert held(page(scene(entries([run], None), solids)))["pivot"] == [0, 0, 2]
    moving = run.assign(x=(("time", "k"), np.outer(time, [1.0, 0, 0])))
    still = xarray.Dataset({"R": (("time", "i", "j"), turns[:1].repeat(9, 0))}, {"time": time})
    for other in (moving, still):
        assert (held(page(scene(entries([other], None))))["pivot"], scene(entries([other], None)).frames) == (
            None,
            False,
        )


def test_a_name_ends_no_script_and_no_title():
    run = dataset()
    run.attrs["system"] = HARMFUL
    text = page(scene(entries([run], None)))
    assert "<img" not in text
    assert held(text)["title"] == HARMFUL


def test_quaternions_are_those_of_the_rotations_without_jumps():
    angle = np.linspace(0, 4 * np.pi, 60)
    c, s, o, i = np.cos(angle), np.sin(angle), 0 * angle, 0 * angle + 1
    found = quaternions(np.moveaxis(np.array([[c, -s, o], [s, c, o], [o, o, i]]), -1, 0))
    assert np.allclose(np.abs(found[:, 2]), np.abs(np.sin(angle / 2)))
    assert np.max(np.abs(np.diff(found, axis=0))) < 0.12


def test_numbers_keep_five_digits_of_their_range():
    place = np.random.default_rng(3).normal(size=(100, 3)) * 1e-4
    body = DrawnBody([{"kind": "box", "size": [1, 1, 1]}], place, np.tile([0, 0, 0, 1.0], (100, 1)), 1e-4)
    told = plain(Scene("a", "", [Member("a", "#000000", np.arange(100.0), [body])]))
    assert np.max(np.abs(np.array(told["members"][0]["bodies"][0]["place"]) - place)) < 2e-5 * np.ptp(place)


def test_a_run_of_one_node_has_no_scene():
    with pytest.raises(ArgumentError, match="one saved node"):
        scene(entries([dataset().isel(time=[0])], ["a"]))


def rotating(nodes: int = 50) -> np.ndarray:
    angle = np.linspace(0, 3, nodes)
    c, s, o, i = np.cos(angle), np.sin(angle), 0 * angle, 0 * angle + 1
    return np.moveaxis(np.array([[c, -s, o], [s, c, o], [o, o, i]]), -1, 0)


def of(**variables):
    return dataset(50, **{**VEHICLE, **dict.fromkeys(("q", "n", "nu", "pi", "euler_angles")), **variables})


@pytest.mark.parametrize(
    ("variables", "places"),
    [
        ({"R": rotating()}, [[0, 0, 0]]),
        ({"R": rotating(), "x": np.ones((50, 3))}, [[1, 1, 1]]),
        ({"R": rotating(), "q": 2 * np.ones((50, 3))}, [[2, 2, 2]]),
        ({"R": rotating(), "q": np.ones((50, 2))}, [[0, 0, 0]]),
        ({"R_1": rotating(), "R_2": rotating()}, [[0, 0, 0], [1.6, 0, 0]]),
        ({"R": rotating()[:, :2, :2], "x": np.ones((50, 2))}, [[1, 1, 0]]),
        ({"euler_angles": np.zeros((50, 3))}, [[0, 0, 0]]),
        ({"q": np.tile(np.arange(6.0), (50, 1))}, [[0, 1, 2], [3, 4, 5]]),
    ],
)
def test_rotations_and_places_of_any_system_are_its_bodies(variables, places):
    found = bodies.poses(entries([of(**variables)], ["a"])[0])
    assert np.array_equal([place[0] for place, _ in found], places)
    assert np.allclose(np.linalg.det([turn for _, turn in found]), 1)
    assert scene(entries([of(**variables)], ["a"])).members[0].bodies[0].shapes[0]["kind"] == "box"


def test_a_body_without_shapes_is_a_box_of_an_eighth_of_the_way_or_of_one_metre():
    way = np.outer(np.linspace(0, 1, 50), [0, 30.0, 40.0])
    for place, size in ((way, 0.12 * 40), (np.ones((50, 3)), 1.0)):
        (body,) = scene(entries([of(R=rotating(), x=place)], ["a"])).members[0].bodies
        assert body.shapes[0]["size"] == pytest.approx([size, 0.6 * size, 0.36 * size]) and body.size == size


def test_bodies_are_where_they_are_said_to_be():
    place = np.linspace([0, 0, 0], [1, 2, 3], 50)
    solids = [bodies.Solid([bodies.ellipsoid((3, 2, 1))], place=place), bodies.Solid([bodies.box((1, 1, 1))])]
    first, second = scene(entries([of(R=rotating())], ["a"]), solids).members[0].bodies
    assert np.array_equal(first.place, place) and first.track and first.size == 6
    assert np.array_equal(second.place, np.zeros((50, 3))) and not second.track


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: bodies.box((1, 2)), "`size` of a shape must be three finite numbers"),
        (lambda: bodies.box((1, np.nan, 2)), "`size` of a shape must be three finite numbers"),
        (lambda: bodies.ellipsoid((1, 0, 1)), "`semi_axes` of a shape must be positive"),
        (lambda: bodies.rod((0, 0, 0), (0, 0, 0), 1), "must differ"),
        (lambda: Plots(of(R=rotating())).scene(bodies=[bodies.Solid([], place=np.zeros((3, 3)))]), r"shape \(50, 3\)"),
        (lambda: Plots(of()).scene(), "give the places of its bodies by `bodies`"),
        (lambda: Plots(of(R=rotating())).scene(path="a.gif"), "must end in .html"),
    ],
)
def test_what_is_no_scene_is_refused(make, words):
    with pytest.raises(ArgumentError, match=words):
        make()


def test_a_notebook_shows_the_certificate_and_the_player():
    run = dataset()
    run.attrs["card"] = "system  <a top>"
    shown = SavedRun(run)._repr_html_()
    table, _, _ = shown.partition('</table><iframe srcdoc="')
    assert ">system</th>" in table and ">&lt;a top&gt;</td>" in table
    assert unescape(re.search('srcdoc="([^"]*)"', shown)[1]) == page(scene(entries([run], None)))
    run = of()
    run.attrs["card"] = "none"
    assert SavedRun(run)._repr_html_().endswith(">none</td></tr></table>")
