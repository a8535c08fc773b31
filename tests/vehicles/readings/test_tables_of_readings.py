"""Readings as tables: names, units and arrivals of one sensor, of a dataset, and what a payload or a mission adds."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from coadjoint.errors import ArgumentError
from coadjoint_vehicles.environments import picture
from coadjoint_vehicles.environments.picture import PoseAt
from coadjoint_vehicles.logs import columns, inputs
from coadjoint_vehicles.logs.bags import mounting
from coadjoint_vehicles.missions import water
from coadjoint_vehicles.model import actuators
from coadjoint_vehicles.parts import payload
from coadjoint_vehicles.readings.taken import Readings, SensorReading, read_sensors, sensor_text
from coadjoint_vehicles.water import surface_bottom

CHANNELS = (
    SimpleNamespace(name="velocity", components=("u", "v"), unit="m/s"),
    SimpleNamespace(name="tilt", components=("roll",), unit="rad"),
    SimpleNamespace(name="push", components=("a_x",), unit="m/s²"),
)
SENSOR: Any = SimpleNamespace(
    name="unit", kind="unit", channels=CHANNELS, names=("u", "v", "roll", "a_x"), units=("m/s", "m/s", "rad", "m/s²"),
    rate=2.0, latency=0.1, position=(1.0, 2.0, 3.0), euler_zyx=(0.0, 0.0, 0.0),
)  # fmt: skip
VALUES = np.array([[1.0, 2.0, np.pi, 4.0], [5.0, 6.0, -np.pi / 2, 8.0]])
TIME = np.array([0.5, 1.0])
READ = SensorReading(SENSOR, TIME, TIME + 0.1, VALUES, VALUES, np.arange(2), 3)
TEXT = ["time_s,arrival_s,u_m_s,v_m_s,roll_deg,a_x_m_s2", "0.5,0.6,1,2,180,4", "1,1.1,5,6,-90,8"]


def numbers(text: str) -> list[list[float]]:
    return [[float(one) for one in line.split(",")] for line in text.splitlines()[1:]]


def test_readings_are_columns_with_their_units_and_angles_in_degrees():
    taken = Readings({"unit": READ}, 7)
    made = taken.dataset
    assert len(taken) == 1 and len(READ) == 2 and read_sensors(made) == ["unit"] and made.attrs == {"sensors_seed": 7}
    for text in (READ.text, sensor_text(made, "unit")):
        assert text.splitlines()[0] == TEXT[0]
        np.testing.assert_allclose(numbers(text), numbers("\n".join(TEXT)), rtol=1e-12)
    arrival = made["sensor_unit_arrival"]
    assert arrival.attrs["tried"] == 3 and made["sensor_unit_velocity"].attrs["units"] == "m/s"
    assert made["sensor_unit_tilt"].values.tolist() == VALUES[:, 2:3].tolist()
    assert made["sensor_unit_push"].attrs["latency"] == 0.1 and made["sensor_unit_push"].attrs["rate"] == 2.0


def test_numbers_of_a_sensor_are_found_by_their_names_or_those_of_their_channels():
    assert READ.of("v").tolist() == [2.0, 6.0] and READ.of("push").tolist() == [[4.0], [8.0]]
    assert READ.of("velocity").tolist() == [[1.0, 2.0], [5.0, 6.0]]
    with pytest.raises(ArgumentError, match="`unit` reads no `w`: it reads u, v, roll, a_x"):
        READ.of("w")


# logs


def test_rows_of_a_table_that_say_nothing_new_are_left_out():
    time = np.arange(6.0)
    held = np.array([[1, 0], [1, 0], [1, 2], [3, 2], [3, 2], [3, 2]], float)
    assert inputs._kept(time, held, "held", 0.0).tolist() == [0, 2, 3]
    line = np.array([0.0, 1.0, 2.0, 4.0, 6.0, 8.0])
    assert inputs._kept(time, line, "linear", 0.0).tolist() == [0, 2, 5]
    assert inputs._kept(time, line + 1e-10 * np.array([0, 1, 0, 0, 1, 0]), "linear", 0.0).tolist() == [0, 2, 5]
    assert inputs._kept(2 * time, np.stack([line, -line], 1), "linear", 0.0).tolist() == [0, 2, 5]
    assert inputs._kept(time[:2], line[:2], "linear", 0.0).tolist() == [0, 1]
    assert inputs._kept(time[:3], line[:3], "linear", 0.0).tolist() == [0, 2]
    assert inputs._kept(11 + time, time**2, "linear", 2.5).tolist() == [0, 3, 5]


def test_a_log_of_east_north_up_has_those_axes_and_the_angles_of_them():
    log: Any = SimpleNamespace(
        position=np.array([[1.0, 2.0, 3.0]]), attitude=np.array([[0.1, 0.2, 0.3]]),
        velocity=np.array([[1.0, 2.0, 3.0]]), through_water=np.array([[4.0, 5.0, 6.0]]),
        rates=np.array([[0.1, 0.2, 0.3]]),
    )  # fmt: skip
    assert columns._motion(log, "NED/FRD")[:2] == (log.position, log.attitude)
    position, attitude, velocity, through, rates, names = columns._motion(log, "ENU/FLU")
    assert position.tolist() == [[2.0, 1.0, -3.0]] and names == (
        "east_m",
        "north_m",
        "up_m",
        "roll_deg",
        "pitch_deg",
        "yaw_deg",
    )
    np.testing.assert_allclose(attitude, [[0.1, -0.2, np.pi / 2 - 0.3]], atol=1e-15)
    for found, own in ((velocity, log.velocity), (through, log.through_water), (rates, log.rates)):
        np.testing.assert_allclose(found, own * [1.0, -1.0, -1.0])


def test_a_turned_compass_tells_the_attitude_of_the_body():
    """R_sensor = R_body M, so R_body = R_sensor Mᵀ; samples without an angle have none."""
    M = Rotation.from_euler("ZYX", [0.3, -0.2, 0.1]).as_matrix()
    angles = np.array([[0.5, -1.0, 0.2], [0.2, 0.4, np.nan], [0.1, -0.3, 0.6]])  # heading, pitch, roll
    given = dict(zip(mounting.ATTITUDE[::-1], angles, strict=True))
    turned: Any = SimpleNamespace(euler_zyx=(0.3, -0.2, 0.1), M=M)
    found = mounting.along_the_body(given, turned, "a log")
    expected = (Rotation.from_euler("ZYX", angles[:, :2].T) * Rotation.from_matrix(M).inv()).as_euler("ZYX")
    for k, name in enumerate(mounting.ATTITUDE[::-1]):
        np.testing.assert_allclose(found[name], [*expected[:, k], np.nan], atol=1e-14)


# missions and parts


@pytest.mark.parametrize(
    ("name", "more", "made"),
    [
        ("a.csv", {}, ("csv", "bilinear", {})),
        ("a.nc", {"between": "bicubic"}, ("netcdf", "bicubic", {})),
        (
            "a.TIF",
            {"origin_m": [1.0, 2.0], "positive": "up"},
            ("geotiff", "bilinear", {"origin": [1.0, 2.0], "positive": "up"}),
        ),
    ],
)
def test_the_bottom_of_a_mission_is_read_by_the_ending_of_its_file(name, more, made, monkeypatch):
    from coadjoint_vehicles.water.bottom import Bottom

    for kind in ("csv", "netcdf", "geotiff"):
        monkeypatch.setattr(
            Bottom,
            f"from_{kind}",
            lambda path, between, kind=kind, **more: (
                kind,
                between,
                {k: list(v) if k == "origin" else v for k, v in more.items()},
            ),
        )
    assert water.bottom({"bottom": {"file": name, **more}}, Path) == made
    assert water.bottom({}, Path) is None


def test_deviations_of_a_current_change_places_between_axes_and_keep_their_signs():
    key = next(iter(set(water.VECTORS) - {"deviation", "phases"}))
    assert np.asarray(water._turned(key, [1.0, 2.0, 3.0], "ENU/FLU")).tolist() == [2.0, 1.0, -3.0]
    assert np.asarray(water._turned("deviation", [1.0, 2.0, 3.0], "ENU/FLU")).tolist() == [2.0, 1.0, 3.0]
    assert water._turned("speed", [1.0, 2.0, 3.0], "ENU/FLU") == [1.0, 2.0, 3.0]
    assert water._turned(key, "fast", "ENU/FLU") == "fast" and water._turned(key, [1.0, 2.0], "ENU/FLU") == [1.0, 2.0]


def test_a_payload_that_is_dropped_takes_the_momentum_of_its_place_once(monkeypatch):
    monkeypatch.setattr(payload, "jnp", np)
    monkeypatch.setattr(payload, "jumped", lambda value: value)
    turn = Rotation.from_euler("z", 0.5).as_matrix()
    passing = SimpleNamespace(turn=turn, velocity=np.array([1.0, 0.0, 0.5]), omega=np.array([0.0, 0.2, 0.0]))
    own = SimpleNamespace(mass=3.0, position=np.array([0.5, 0.0, 1.0]))
    part = payload.Payload(name="weight", mass=3.0, position=(0.5, 0.0, 1.0))
    before = np.array([9.0, 9.0, 9.0])
    for dropped, command, expected in (
        (0.0, 0.5, (1.0, None)),
        (0.0, 0.4, (0.0, before)),
        (1.0, 1.0, (1.0, before)),
        (0.5, 1.0, (0.5, before)),
    ):
        actual = SimpleNamespace(dropped=dropped, momentum=before)
        found = part.follow(cast(Any, actual), command, 0.1, cast(Any, own), cast(Any, passing))
        lost = 3.0 * turn @ (passing.velocity + np.cross(passing.omega, own.position))
        assert found["dropped"] == expected[0]
        np.testing.assert_allclose(found["momentum"], lost if expected[1] is None else expected[1])
    assert part.command.unit == "1" and part.units == {"dropped": "1", "momentum": "N s"}
    assert part.at_rest(0.0)["momentum"].tolist() == [0, 0, 0] and part.at_rest(0.5)["dropped"] == 0.5


@pytest.mark.parametrize(
    ("shape", "says"),
    [
        ((), "; in a log or table it is the one column `jets`"),
        ((1,), "; in a log or table these are the columns `jets[1]`"),
        ((3,), "; in a log or table these are the columns `jets[1]` to `jets[3]`"),
        ((2, 2), ""),
    ],
)
def test_columns_of_a_command_are_numbered_from_1(shape, says):
    assert actuators._columns("jets", shape) == says
    assert actuators._shape(shape) == ("one number" if shape == () else f"shape {shape}")


def test_the_first_of_events_is_the_least(monkeypatch):
    state: Any = SimpleNamespace(q=np.array([1.0, 2.0, 3.0]))
    assert surface_bottom.at_surface(0.5)(state) == 2.5 and surface_bottom.at_bottom(10.0, 4.0)(state) == 3.0
    monkeypatch.setattr(surface_bottom, "returned", lambda function, given, shape, what: function(*given))
    monkeypatch.setattr(surface_bottom, "evaluate", lambda function, *given: function(*given))
    assert surface_bottom.altitude(lambda north, east: 10.0 * north + east)(state) == 9.0
    with pytest.raises(ArgumentError, match="at least one event"):
        surface_bottom.first_of()


# the picture of an episode


def test_a_picture_has_track_depth_and_an_arrow_along_the_nose(monkeypatch):
    figures: list[Any] = []
    canvas = picture.canvas
    monkeypatch.setattr(picture, "canvas", lambda *size: figures.append(canvas(*size)) or figures[-1])
    turns = [
        Rotation.from_euler("ZYX", [heading, pitch, 0.0]).as_matrix() for heading, pitch in ((0.0, 0.0), (0.5, -0.2))
    ]
    poses = [PoseAt(1.0, np.array([1.0, 2.0, 3.0]), turns[0]), PoseAt(2.0, np.array([4.0, 12.0, 5.0]), turns[1])]
    found = picture.picture(poses, np.array([[0.0, 0.0, 1.0], [5.0, 6.0, 7.0]]), 9.0)
    assert found.shape == (340, 720, 3) and found.dtype == np.uint8
    above, side = figures[0].axes
    goal, track, arrow = above.lines
    assert goal.get_xydata().tolist() == [[0, 0], [6, 5]] and track.get_xydata().tolist() == [[2, 1], [12, 4]]
    assert arrow.get_xydata().tolist() == [[12, 4]]
    level, depth, nose = side.lines
    assert list(level.get_ydata()) == [7, 7] and depth.get_xydata().tolist() == [[1, 3], [2, 5]]
    assert nose.get_xydata().tolist() == [[2, 5]] and side.get_xlim() == (1, 10)
    for line, angle in ((arrow, -0.5), (nose, -0.2 - np.pi / 2)):
        tip = line._marker.get_user_transform().transform([0.0, 1.0])
        np.testing.assert_allclose(tip, [-np.sin(angle), np.cos(angle)], atol=1e-12)
        shape = line._marker.get_path().vertices
        np.testing.assert_allclose(shape / shape[0, 1] * 1.3, [(0, 1.3), (-0.5, -0.9), (0, -0.55), (0.5, -0.9)])
    assert above.get_xlim() == pytest.approx((6 - 7.2, 6 + 7.2)) and above.get_ylim() == pytest.approx(
        (2.5 - 7.2, 2.5 + 7.2)
    )
    assert side.get_ylim() == pytest.approx((4 + 3.6, 4 - 3.6))
    assert (above.get_xlabel(), above.get_ylabel()) == ("east (m)", "north (m)")
    assert picture._room(np.array([2.0, 2.5])) == (1.25, 3.25)
