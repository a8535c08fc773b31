"""Bags whose numbers may mean something else than their types say: read rightly, told, or refused."""

from __future__ import annotations

import numpy as np
import pytest

from coadjoint.errors import FileError
from coadjoint.groups import attitude
from coadjoint_vehicles.logs import read_log
from coadjoint_vehicles.logs.bags.schemas import known, schema
from coadjoint_vehicles.logs.bags.serializing import serialized

mcap = pytest.importorskip("mcap.writer")

SECONDS = np.arange(30)
TWIST, POSE, PLAIN = "geometry_msgs/TwistWithCovarianceStamped", "nav_msgs/Odometry", "std_msgs/Float64"


def bag(path, topics, logged_after=0.0):
    """A bag with rows (topic, kind, values of its fields, seconds of logging)."""
    with path.open("wb") as opened:
        writer = mcap.Writer(opened)
        writer.start()
        for topic, kind, values, seconds in topics:
            number = writer.register_schema(kind.replace("/", "/msg/"), "ros2msg", schema(kind).encode())
            channel = writer.register_channel(topic, "cdr", number)
            stamped = {"header.stamp.sec": np.asarray(seconds) + 1} if kind != PLAIN else {}
            for second, content in zip(
                seconds, serialized(known(kind), len(seconds), {**stamped, **values}), strict=True
            ):
                at = round((second + 1 + logged_after) * 1e9)
                writer.add_message(channel, at, content, at)
        writer.finish()
    return path


def twist(**values):
    return "/twist", TWIST, {"twist.twist.linear.x": SECONDS * 0.1, **values}, SECONDS


def test_speeds_in_space_are_turned_once_whatever_the_axes_of_the_angles(tmp_path):
    """v = Rᵀ(north, east, down speeds), with angles in the axes of ROS and in those of the library."""
    random = np.random.default_rng(5)
    roll, pitch, heading = random.uniform(-0.7, 0.7, (3, 30))
    speeds = random.normal(size=(30, 3))
    R = np.asarray(attitude.zyx(heading, pitch, roll))
    body = np.einsum("kij,ki->kj", R, speeds)
    paths = {"roll_deg": "twist.twist.angular.x", "pitch_deg": "twist.twist.angular.y"}
    names = dict(zip(("north_speed", "east_speed", "down_speed"), "xyz", strict=True))
    for axes, yaw, angles in (
        ("NED/FRD", "heading_deg", (roll, pitch, heading)),
        ("ENU/FLU", "yaw_deg", (roll, -pitch, np.pi / 2 - heading)),
        ("ENU/FLU", "heading_deg", (roll, -pitch, heading)),
    ):
        values = {f"twist.twist.linear.{axis}": speeds[:, i] for i, axis in enumerate("xyz")}
        values |= {f"twist.twist.angular.{axis}": np.degrees(x) for axis, x in zip("xyz", angles, strict=True)}
        path = bag(tmp_path / "x.mcap", [("/twist", TWIST, values, SECONDS)])
        columns = {**paths, yaw: "twist.twist.angular.z", **{n: f"twist.twist.linear.{a}" for n, a in names.items()}}
        log = read_log(path, sensors={"sensor": [{"topic": "/twist", "columns": columns, "axes": axes}]})
        np.testing.assert_allclose(np.stack([log.columns[n] for n in "uvw"], axis=1), body, atol=1e-12)
        np.testing.assert_allclose(log.columns["pitch"], pitch, atol=1e-12)


@pytest.mark.parametrize("frame", ["map", "odom", "rov/world", "world_ned"])
def test_velocities_in_space_are_not_taken_for_those_of_the_body(tmp_path, frame):
    path = bag(tmp_path / "x.mcap", [twist(**{"header.frame_id": frame})])
    with pytest.raises(FileError, match=f"velocities in the frame '{frame}' of space.*north_speed"):
        read_log(path)
    with pytest.raises(FileError, match="of space"):
        read_log(path, sensors={"sensor": [{"topic": "/twist"}]})
    columns = {"u_m_s": "twist.twist.linear.x"}
    assert len(read_log(path, sensors={"sensor": [{"topic": "/twist", "columns": columns}]})) == 30
    assert len(read_log(bag(tmp_path / "y.mcap", [twist(**{"header.frame_id": "rov/base_link"})]))) == 30


def test_a_pose_is_one_in_space_in_the_axes_that_its_frame_says(tmp_path):
    def pose(frame):
        return bag(
            tmp_path / "x.mcap",
            [("/odometry", POSE, {"header.frame_id": frame, "pose.pose.orientation.w": 1.0}, SECONDS)],
        )

    with pytest.raises(FileError, match="a pose in the frame 'base_link' of the body"):
        read_log(pose("base_link"))
    with pytest.raises(FileError, match="a pose in the frame 'world_ned', but its axes are read as ENU/FLU"):
        read_log(pose("world_ned"))
    assert len(read_log(pose("world_ned"), axes="NED/FRD")) == 30 and len(read_log(pose("odom"))) == 30


def test_two_clocks_in_a_bag_are_told_or_refused(tmp_path):
    """Commands have no stamps: they count by the recorder's clock, the rest by that of the vehicle."""
    command = ("/command/rudder", PLAIN, {"data": 0.1 + 0 * SECONDS}, SECONDS)
    same = read_log(bag(tmp_path / "x.mcap", [twist(), command], 0.3))
    assert not any("stamps" in note for note in same.notes)  # less than one sample
    apart = read_log(bag(tmp_path / "y.mcap", [twist(), command], 1.7))
    assert any("logged 1.7 s after their stamps, and /command/rudder has none" in note for note in apart.notes)
    with pytest.raises(FileError, match=r"the clocks of /command/rudder and /twist are 2\.78 h apart"):
        read_log(bag(tmp_path / "z.mcap", [twist(), command], 1e4))
    by_log = {
        "sensor": [{"topic": "/twist", "stamp": "log"}],
        "command": [{"topic": "/command/rudder", "name": "rudder", "field": "data"}],
    }
    assert not any("stamps" in note for note in read_log(tmp_path / "z.mcap", sensors=by_log).notes)


def test_commands_without_a_unit_that_pause_or_end_are_told(tmp_path):
    some = SECONDS[(SECONDS < 4) | ((SECONDS > 15) & (SECONDS < 18))]
    pulses = ("/command/rudder", PLAIN, {"data": 0.1 * some}, some)
    fine = twist()
    log = read_log(bag(tmp_path / "x.mcap", [fine, pulses]))
    assert "Nothing declares the unit of /command/rudder" in log.notes[0]
    assert any("/command/rudder is silent for 13 s from 3 s on" in note for note in log.notes)
    assert any("/command/rudder ends 12 s before the log" in note for note in log.notes)
    begins_late = ("/actuator/rudder", PLAIN, {"data": 0.1 * SECONDS[9:]}, SECONDS[9:])
    whole = ("/command/rudder", PLAIN, {"data": 0.1 * SECONDS}, SECONDS)
    log = read_log(bag(tmp_path / "y.mcap", [fine, whole, begins_late]))
    assert any("/actuator/rudder begins after the first sample" in note for note in log.notes)
    assert not any("is silent" in note or "ends" in note for note in log.notes) and not log.actual
