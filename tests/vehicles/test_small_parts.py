"""Small parts of missions, imports, water and serving, each against a closed form or its sentence."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import jax
import numpy as np
import pytest
import xarray

from coadjoint.errors import ArgumentError, FileError
from coadjoint_vehicles.commands import vehicles as commands
from coadjoint_vehicles.commands.identify import Identify
from coadjoint_vehicles.controllers.line_of_sight import LineOfSight
from coadjoint_vehicles.figures import scenes
from coadjoint_vehicles.files import check_parts
from coadjoint_vehicles.importing import flying, gazebo_actuators, gazebo_damping, uuv
from coadjoint_vehicles.importing.arithmetic import value_of
from coadjoint_vehicles.logs.bags.reading import _parts
from coadjoint_vehicles.logs.records import VehicleRecords
from coadjoint_vehicles.missions import provenance, summary
from coadjoint_vehicles.missions.results import tilted
from coadjoint_vehicles.model.changed import _same
from coadjoint_vehicles.parts.thrusters import Thrusters
from coadjoint_vehicles.readings import of_run
from coadjoint_vehicles.sensors.errors import Errors
from coadjoint_vehicles.serving.frames import _noticeable
from coadjoint_vehicles.serving.loop import Loop
from coadjoint_vehicles.trials import page
from coadjoint_vehicles.water.bottom import Bottom
from made_runs import dataset

# Missions.


def test_the_distance_from_a_leg_is_that_of_its_nearest_point():
    points = np.array([[1.0, 2.0], [-3.0, 4.0], [9.0, 3.0]])
    assert summary._distance(points, np.zeros(2), np.array([5.0, 0.0])) == pytest.approx([2.0, 5.0, 5.0])
    assert summary._distance(points, np.ones(2), np.ones(2)) == pytest.approx([1.0, 5.0, np.hypot(8, 2)])


def test_the_figures_of_a_mission_are_those_of_its_path():
    run = dataset(12)
    found, q = cast(Any, summary.mission_summary(run)), run["q"].values
    length = np.linalg.norm(np.diff(q, axis=0), axis=1).sum()
    assert (found["path_length"], found["speed_mean"]) == pytest.approx((length, length / 10.0))
    assert found["depth_max"] == q[:, 2].max() and found["position_final"] == pytest.approx(q[-1])
    assert found["energy_put_in"] == pytest.approx({"drag": -3.0, "thrust": 3.0 + 0.1 * np.sin(10.0)})


def test_numbers_of_a_vehicle_have_their_source_and_say_what_the_run_file_changes(monkeypatch):
    told = {name: SimpleNamespace(value=2.0, unit="kg", source=name, note="n") for name in ("body.mass", "fin.area")}
    vehicle = SimpleNamespace(provenance=told, sources={"fin.area": "a book"}, name="boat")
    monkeypatch.setattr(provenance, "_vehicle", lambda *given: vehicle)
    ((title, rows),) = provenance.numbers(cast(Any, None), {"vehicle": {}, "parameters": {"mass": 3.0}}).items()
    assert title == "of the vehicle boat" and [row.source for row in rows] == ["body.mass", "a book"]
    assert [row.note for row in rows] == ["changed by [parameters] of the run file; n", "n"]


@pytest.mark.parametrize("members", [False, True])
def test_a_craft_that_tilts_is_told_with_the_time_and_the_member(members):
    angle = np.radians([[10.0, 0.0, 30.0], [70.0, 0.0, 61.0], [20.0, 5.0, 80.0]])
    down = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1)
    dims = ("time", "member", "axis") if members else ("time", "axis")
    run = xarray.Dataset({"a_down": (dims, down if members else down[:, 0])}, coords={"time": [0.0, 2.5, 5.0]})
    level: Any = SimpleNamespace(keeps_level=True)
    (told,) = tilted(run, level)
    whose = "2 of 3 members, member 2 the most, tilt by up to 80°" if members else "The vehicle tilts by up to 70°"
    assert told.startswith(f"{whose}, from t = 2.5 s on beyond 60°")
    assert tilted(run, None) == [] == tilted(run, cast(Any, SimpleNamespace(keeps_level=False)))
    assert tilted(run.isel(time=[0, 0, 0]), level) == []


def test_a_run_in_words_goes_from_its_first_place_to_its_last():
    shown = dataset(12)
    q = np.add(shown["q"].values, [1.0, 2.0, 3.0])
    entry: Any = SimpleNamespace(dataset=dataset(12, q=q), time=shown["time"].values)
    north, east, depth = q[-1] - q[0]
    told = scenes._words(entry, cast(Any, SimpleNamespace(label="dive")))
    assert told.startswith(
        f"dive: from t = 0 s to 10 s it goes {north:.4g} m north, {east:.4g} m east and {depth:.4g} m"
    )


# Models.

WAY = [[0.0, 0.0, 1.0], [9.0, 0.0, 1.0]]


def test_the_mass_matrix_of_an_imported_vehicle_is_that_of_its_kinetic_energy(monkeypatch):
    """½m|ν + ω × c|² + ½ω·Iω, of (ν, ω)."""
    c, inertia, added = np.array([0.3, -0.2, 0.5]), np.diag([2.0, 3.0, 4.0]), np.arange(1.0, 7.0)
    vehicle = SimpleNamespace(mass=5.0, center_of_mass=c, inertia=[2.0, 3.0, 4.0], added_mass=added)
    monkeypatch.setattr(flying, "accelerations", lambda jets, M: M)
    monkeypatch.setattr(flying, "lacking", lambda jets, M, needed: M)
    M = np.asarray(flying._lacking(cast(Any, vehicle), cast(Any, None), []))
    nu, omega = np.array([0.7, -0.4, 0.2]), np.array([0.5, 0.9, -1.1])
    speed, both = nu + np.cross(omega, c), np.concatenate([nu, omega])
    expected = 2.5 * speed @ speed + 0.5 * omega @ inertia @ omega + 0.5 * added @ both**2
    assert 0.5 * both @ M @ both == pytest.approx(expected) and np.array_equal(M, M.T)


def test_a_number_that_is_traced_is_never_known_to_be_the_same():
    seen: list[bool] = []
    jax.eval_shape(lambda x: seen.append(_same(1.0, x)) or x, 1.0)
    assert seen == [False] and _same(np.ones(2), [1, 1]) and not _same(1.0, [1.0]) and not _same(1.0, 2.0)


@pytest.mark.parametrize(("limit", "fits"), [([[-1, -2], [1, 2]], True), ([[-1, 2], [1, 3]], False), ([1, 2], False)])
def test_the_limits_of_each_thruster_are_about_the_neutral_command(limit, fits):
    part: Any = SimpleNamespace(limit=limit, curve=SimpleNamespace(neutral=0.0), count=2)
    if fits:
        assert np.array_equal(Thrusters._limits(part, ""), limit)
    else:
        with pytest.raises(ArgumentError, match=r"`limit` must be the largest command, .*about the neutral command 0"):
            Thrusters._limits(part, "")


def test_a_helm_is_among_the_parameters_of_a_line_of_sight():
    alone, steered = LineOfSight(way_points=WAY), LineOfSight(way_points=WAY, helm=LineOfSight(way_points=WAY))
    assert "helm" not in alone.parameters() and {*steered.parameters()} == {*alone.parameters(), "helm"}


def test_records_of_every_step_are_read_in_blocks_of_one_size(monkeypatch):
    monkeypatch.setattr(of_run, "BLOCK", 3)
    run: Any = SimpleNamespace(steps_saved=np.arange(5), records={"x": 10 * np.arange(5)})
    blocks = [(rows["x"].tolist(), count) for rows, count in of_run._blocks(run)]
    assert blocks == [([0, 10, 20], 3), ([30, 40, 40], 2)]


# Files.


@pytest.mark.parametrize("text", ["1 +", "2 * (3 -"])
def test_arithmetic_that_ends_early_is_told(text):
    with pytest.raises(ArgumentError, match="ends where a number is expected"):
        value_of(text, lambda name: None)


def test_the_hydrodynamics_are_those_of_the_base_link_or_of_the_first():
    def plugin(*names: str) -> Any:
        links = [SimpleNamespace(tag="link", attributes={"name": name}, taken=False) for name in names]
        return SimpleNamespace(children=[SimpleNamespace(tag="other"), *links], fail=ValueError)

    assert uuv._model(plugin("a", "b/base_link")).attributes == {"name": "b/base_link"}
    assert uuv._model(plugin("a", "b")).attributes == {"name": "a"} and uuv._model(plugin("a")).taken
    with pytest.raises(ValueError, match="names no <link>"):
        uuv._model(plugin())


def test_the_files_of_a_bag_are_in_the_order_of_their_numbers_and_packed_ones_are_told(tmp_path):
    (tmp_path / "metadata.yaml").touch()
    with pytest.raises(FileError, match=r"it holds no \.mcap and no \.db3\."):
        _parts(tmp_path)
    (tmp_path / "log_0.mcap.zstd").touch()
    with pytest.raises(FileError, match="but compressed files: unpack them"):
        _parts(tmp_path)
    for number in (10, 9, 2):
        (tmp_path / f"log_{number}.db3").touch()
    assert [part.name for part in _parts(tmp_path)] == ["log_2.db3", "log_9.db3", "log_10.db3"]
    with pytest.raises(FileError, match="There is no log"):
        _parts(tmp_path / "gone.mcap")


def test_an_identification_without_a_home_for_its_figure_reads_nothing(tmp_path):
    asked = object.__new__(Identify)
    object.__setattr__(asked, "out", tmp_path / "gone" / "figure.png")
    with pytest.raises(FileError, match="gone"):
        asked()


# Water and serving.


@pytest.mark.parametrize("between", ["bilinear", "bicubic"])
def test_a_mirrored_bottom_has_the_same_depth_at_mirrored_places(between):
    north, east = np.arange(4.0), np.arange(3.0)
    depth = 5.0 + np.random.default_rng(1).uniform(size=(4, 3))
    bottom, turned = (Bottom(north, east, rows, between) for rows in (depth, depth[::-1, ::-1]))
    for x, y in ((0.3, 0.2), (2.9, 1.8), (1.5, 1.0), (0.1, 1.9), (3.0, 2.0)):
        assert float(bottom(x, y)) == pytest.approx(float(turned(3.0 - x, 2.0 - y)), rel=1e-6)  # float32


def test_entries_of_thrusters_count_next_to_the_largest_force_or_torque():
    matrix = np.zeros((6, 2))
    matrix[0], matrix[2], matrix[3], matrix[4], matrix[5] = [1.0, 0.04], [0.06, -2.0], [10.0, 0.0], [0.4, -0.6], [0, 2]
    expected = matrix.copy()
    expected[0, 1] = expected[2, 0] = expected[4, 0] = 0.0
    assert np.array_equal(_noticeable(matrix), expected)


def test_a_loop_ends_when_nothing_has_arrived_for_as_long_as_asked():
    calls = iter(range(3))

    def silent(size: int):
        next(calls)
        raise TimeoutError

    loop = object.__new__(Loop)
    loop.__dict__.update(answers=0, _socket=SimpleNamespace(recvfrom=silent, close=lambda: None))
    loop.run(cast(Any, None), idle=-1.0)
    assert next(calls) == 1


@pytest.mark.parametrize("controller", [None, "a law"])
def test_a_vehicle_without_a_controller_has_no_line_of_one(controller, monkeypatch):
    summary = {"terminal_speed": 1.0, "metacentric_height": 0.1, "mass": 2.0, "displaced_mass": 2.0, "net_weight": 0.0}
    found = {"summary": summary, "controller": controller, "parts": [], "sensors": []}
    monkeypatch.setattr(commands, "described", lambda vehicle: found)
    for name in ("_net", "_height", "_terminal", "_passivity"):
        monkeypatch.setattr(commands, name, lambda *given: "")
    monkeypatch.setattr(commands, "_told_controller", lambda one: f"by {one}")
    shown: list[Any] = []
    terminal = SimpleNamespace(fields=shown.extend, line=lambda text: None, table=lambda *given: None)
    monkeypatch.setattr(commands, "terminal", terminal)
    words = {
        "name": "boat",
        "description": "",
        "note": "",
        "licence": "",
        "gravity": 9.81,
        "provenance": {},
        "sources": {},
        "warnings": (),
    }
    commands.show(cast(Any, SimpleNamespace(**words)))
    assert [name for name, _ in shown] == ["name", "mass"] + ["controller"] * bool(controller)
    assert not controller or shown[-1] == ("controller", "by a law")


def test_fins_are_in_front_of_the_centre_of_buoyancy_or_behind_it(monkeypatch):
    monkeypatch.setattr(check_parts, "Fin", SimpleNamespace)

    def told(*places: float, centre: float) -> list[str]:
        fins = [
            SimpleNamespace(name=f"fin {x:g}", area=1.0, lift_slope=3.0, normal=(0.0, 1.0, 0.0), position=(x, 0.0, 0.0))
            for x in places
        ]
        vehicle = SimpleNamespace(parts=fins, center_of_buoyancy=(centre, 0.0, 0.0))
        return [*check_parts._fins_together(cast(Any, vehicle))]

    assert told(-0.5, -0.3, centre=0.1) == [] == told(0.2, -0.5, centre=0.0)
    (yaw,) = told(-0.5, -0.9, centre=-0.8)
    assert "its fins `fin -0.5` stand in front" in yaw and "in yaw" in yaw


def test_damping_that_drives_some_motion_is_told_by_the_symmetric_part_of_its_matrix():
    told: list[str] = []
    draft: Any = SimpleNamespace(differs=told.append)
    plugin: Any = SimpleNamespace(place="here")
    turning = np.eye(6)
    turning[0, 1], turning[1, 0] = 3.0, -3.0  # x·Dx = |x|²
    gazebo_damping._told(draft, plugin, turning, np.eye(6))
    assert told == []
    turning[1, 0] = 3.0
    gazebo_damping._told(draft, plugin, turning, -np.eye(6))
    assert [sentence[:20] for sentence in told] == ["here: its linear dam", "here: its quadratic "]


def test_records_of_an_ensemble_are_of_no_vehicle():
    with pytest.raises(ArgumentError, match=r"A log is of one run: choose a member .*isel\(member=0\)"):
        VehicleRecords(dataset(3).expand_dims(member=2))


@pytest.mark.parametrize(("depth", "told"), [(9.0, 1), (13.0, 0)])
def test_a_depth_is_missed_by_more_than_half_of_the_largest_way_to_it(depth, told, monkeypatch):
    """From 0 m to 20 m, where the first set point is 1 m."""
    wanted = np.array([1.0, *[20.0] * 8])
    monkeypatch.setattr(summary, "errors", lambda log: {"depth": log.set_points["depth"][0] - log.depth})
    log: Any = SimpleNamespace(set_points={"depth": (wanted,)}, depth=np.array([0.0, *[depth] * 8]))
    found = summary.missed(log)
    assert len(found) == told and all("does not follow `depth`" in one and "11 m at the end" in one for one in found)


@pytest.mark.parametrize(
    ("ends", "limit", "notes"), [((-0.3, 0.5), 0.5, 1), ((-0.4, 0.4), 0.4, 0), ((-9.0, 9.0), 1.5708, 0)]
)
def test_a_foil_turns_as_far_as_its_joint_on_the_side_where_that_is_more(ends, limit, notes):
    told, axis = [], np.array([0.0, 1.0, 0.0])
    draft: Any = SimpleNamespace(differs=told.append, take=lambda key, value, *given: value, flip=np.ones(3), parts=[])
    joint: Any = SimpleNamespace(axis=axis, lower=ends[0], upper=ends[1], element=SimpleNamespace(place="joint"))
    given = np.array([-1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), joint
    kinds = {"area": 0.1, "lift_slope": 3.0, "stall": 0.3}
    made: list[Any] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gazebo_actuators, "Airfoil", lambda word, **taken: made.append((word, taken)))
        pose: Any = SimpleNamespace(R=np.eye(3))
        gazebo_actuators.add_foil(draft, cast(Any, None), "body/2nd", *given, pose, 0.05, kinds, lag=0.2)
    ((word, taken),) = made
    assert word == "foil_2nd" and taken["limit"] == pytest.approx(limit, abs=1e-4) and len(told) == notes
    assert taken["lag"] == 0.2 and taken["chord"][0] == 1.0 and abs(taken["normal"][2]) == 1.0
    side = np.cross(axis, given[1]) @ given[2]
    assert taken["zero_lift"] == -np.sign(side) * 0.05 and taken["normal"][2] == -np.sign(side)


def test_white_noise_of_a_reading_is_given_or_grows_as_the_root_of_the_rate():
    assert Errors(noise_density=[0.1, 0.2]).white(25.0, 2) == pytest.approx([0.5, 1.0])
    assert Errors(noise=0.3).white(25.0, 2).tolist() == [0.3, 0.3] and Errors().white(25.0, 1).tolist() == [0.0]
    assert Errors(bias_instability=0.617).wandering(1) == pytest.approx([1.0], rel=2e-3)


@pytest.mark.parametrize(("manoeuvre", "drawn"), [("zigzag", "heading"), ("turn", "rate of turn")])
def test_the_course_of_a_trial_is_that_of_its_heading_or_its_rate_of_turn_in_degrees(manoeuvre, drawn, monkeypatch):
    time, lines, said = np.arange(3.0), dict[str, Any](), list[str]()

    def draw(t, y, label, **look):
        lines[label] = y

    axes: Any = SimpleNamespace(plot=draw, step=draw)
    monkeypatch.setattr(page, "_timed", lambda axes, track, label: said.append(label))
    track: Any = SimpleNamespace(
        manoeuvre=manoeuvre, turned=np.radians(time), rate=np.radians(2 * time), time=time, rudder=np.radians(-time),
        order=np.radians(5 + time),
    )  # fmt: skip
    page._draw_course(axes, track)
    assert lines[drawn] == pytest.approx(time if manoeuvre == "zigzag" else 2 * time) and drawn in said[0]
    assert lines["rudder"] == pytest.approx(-time) and lines["order"] == pytest.approx(5 + time) and len(lines) == 3
