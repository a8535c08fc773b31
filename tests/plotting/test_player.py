"""The page that plays a scene: what is in it, whose work it holds, and that names do no harm."""

from __future__ import annotations

import hashlib
import json
import re
from importlib.resources import files

import numpy as np
import pytest

from coadjoint.errors import ArgumentError
from coadjoint.plotting.entries import entries
from coadjoint.plotting.player import page
from coadjoint.plotting.scene import plain, quaternions
from coadjoint.plotting.staged import scene
from made_runs import dataset

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
    from coadjoint.plotting.scene import Body, Member, Scene

    body = Body([{"kind": "box", "size": [1, 1, 1]}], place, np.tile([0, 0, 0, 1.0], (100, 1)), 1e-4)
    told = plain(Scene("a", "", [Member("a", "#000000", np.arange(100.0), [body])]))
    assert np.max(np.abs(np.array(told["members"][0]["bodies"][0]["place"]) - place)) < 2e-5 * np.ptp(place)


def test_a_run_of_one_node_has_no_scene():
    with pytest.raises(ArgumentError, match="one saved node"):
        scene(entries([dataset().isel(time=[0])], ["a"]))
