"""MCAP files: what is written, other libraries read, and what they write is read to the bit."""

from __future__ import annotations

import json

import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles as vehicles
import made_runs
from coadjoint.cli.main import main
from coadjoint.errors import FileError
from coadjoint.identification import Log
from coadjoint.identification.channels import VEHICLE
from coadjoint_vehicles import Craft, axes
from coadjoint_vehicles.logs import read_log, write_log, write_mcap
from coadjoint_vehicles.logs.bags.mcap_file import read_mcap
from coadjoint_vehicles.logs.records import VehicleRecords

pytest.importorskip("mcap")

KINDS = {"/odometry": "nav_msgs/msg/Odometry", "/imu": "sensor_msgs/msg/Imu", "/tf": "tf2_msgs/msg/TFMessage"}


def everything(topic, kind):
    return True


@pytest.fixture(scope="module")
def dataset():
    random = np.random.default_rng(1777)
    heading, pitch, roll = random.uniform(-1, 1, (3, 200))
    R = co.attitude.zyx(heading, pitch, roll)
    noise = {name: random.normal(size=(200, 3)) for name in ("n", "nu", "xi")}
    return made_runs.dataset(a_north=np.asarray(R)[:, 0], a_down=np.asarray(R)[:, 2], **noise)


@pytest.fixture(scope="module")
def dive(dataset, tmp_path_factory):
    path = tmp_path_factory.mktemp("mcap") / "dive.mcap"
    write_mcap(dataset, path)
    return path


def test_a_run_is_read_back_as_it_was(dataset, dive):
    log, records = read_log(dive), VehicleRecords(dataset)
    assert np.allclose(log.time, records.time, rtol=0, atol=1e-9) and log.step == dataset.attrs["dt"]
    for names, values in (
        ("north east depth", records.position),
        ("u v w", records.velocity),
        ("p q r", records.rates),
    ):
        for name, column in zip(names.split(), values.T, strict=True):
            assert np.array_equal(log.columns[name], column), name
    for name, column in zip(("roll", "pitch", "heading"), records.attitude.T, strict=True):
        assert np.allclose(log.columns[name], column, rtol=0, atol=1e-14), name
    assert np.array_equal(log.inputs["rudder"], records.actuators["rudder"].command) and log.units["rudder"] == "rad"
    assert np.array_equal(log.actual["rudder"], records.actuators["rudder"].actual)


def test_pressure_and_fixes_tell_the_place(dataset, tmp_path):
    write_mcap(dataset, tmp_path / "dive.mcap", origin=(63.4, 10.4))
    log, position = read_log(tmp_path / "dive.mcap", topics=["/pressure", "/fix"]), VehicleRecords(dataset).position
    assert np.allclose(log.columns["depth"], position[:, 2], rtol=0, atol=1e-9)
    for name, exact in zip(("north", "east"), position.T[:2], strict=True):  # from the first fix
        assert np.allclose(log.columns[name], exact - exact[0], rtol=1e-6, atol=1e-8)


def test_a_log_with_gaps_is_written_and_read_back(tmp_path):
    random = np.random.default_rng(1736)
    columns = {name: random.normal(size=50) for name in (*"uvwpqr", "north", "depth")}
    columns |= {name: random.uniform(-1, 1, 50) for name in ("roll", "pitch", "heading")}
    columns["u"][::3] = np.nan
    columns["depth"][1::2] = np.nan
    for name in ("roll", "pitch", "heading"):
        columns[name][5:9] = np.nan
    inputs = {"rudder": random.normal(size=50), "thrusters": random.normal(size=(50, 3))}
    log = Log(np.arange(50) * 0.1, columns, inputs, {"rudder": "rad", "thrusters": "N"}, step=0.05)
    write_log(log, tmp_path / "log.mcap")
    found = read_log(tmp_path / "log.mcap")
    assert list(found.columns) == [name for name in VEHICLE if name in columns] and found.step == 0.05
    for name, values in columns.items():
        assert np.allclose(found.columns[name], values, rtol=0, atol=1e-14, equal_nan=True), name
    for name, values in inputs.items():
        assert np.array_equal(found.inputs[name], values) and found.units[name] == log.units[name]


def test_other_axes_say_the_same(dataset, dive, tmp_path):
    write_mcap(dataset, tmp_path / "ned.mcap", axes="NED/FRD")
    ned, enu = read_log(tmp_path / "ned.mcap"), read_log(dive)
    with pytest.raises(FileError, match="says that its axes are NED/FRD, not ENU/FLU"):
        read_log(tmp_path / "ned.mcap", axes="ENU/FLU")
    for name, values in enu.columns.items():
        assert np.allclose(ned.columns[name], values, rtol=0, atol=1e-14), name


def test_the_reader_of_mcap_reads_what_is_written(dataset, dive):
    reader = pytest.importorskip("mcap_ros2.reader")
    found = [m.ros_msg for m in reader.read_ros2_messages(str(dive), topics=["/odometry"])]
    records = VehicleRecords(dataset)
    east_north_up = axes.space_vector(records.position, "ENU/FLU")
    places = [[m.pose.pose.position.x, m.pose.pose.position.y, m.pose.pose.position.z] for m in found]
    assert np.array_equal(places, east_north_up)
    assert {m.header.frame_id for m in found} == {"map"} and {m.child_frame_id for m in found} == {"base_link"}
    stamps = [m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec for m in found]
    assert np.allclose(stamps, records.time, rtol=0, atol=1e-9)
    (frame,) = next(iter(reader.read_ros2_messages(str(dive), topics=["/tf"]))).ros_msg.transforms
    assert frame.child_frame_id == "base_link" and frame.transform.translation.x == east_north_up[0, 0]
    thrust = [list(m.ros_msg.data) for m in reader.read_ros2_messages(str(dive), topics=["/actuator/thrusters"])]
    assert np.array_equal(thrust, records.actuators["thrusters"].actual)


def test_the_reader_of_rosbags_reads_what_is_written(dataset, dive):
    highlevel = pytest.importorskip("rosbags.highlevel")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    with highlevel.AnyReader([dive], default_typestore=store) as reader:
        assert {c.topic: c.msgtype for c in reader.connections}.items() >= KINDS.items()
        chosen = [c for c in reader.connections if c.topic == "/imu"]
        found = [reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages(chosen)]
    rates = axes.body_vector(VehicleRecords(dataset).rates, "ENU/FLU")
    assert np.array_equal([[m.angular_velocity.x, m.angular_velocity.y, m.angular_velocity.z] for m in found], rates)
    assert {m.linear_acceleration_covariance[0] for m in found} == {-1.0}


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd", "unchunked"])
def test_every_number_that_rosbags_writes_is_read_to_the_bit(tmp_path, compression):
    """Odometry with texts of several lengths, in chunks of several compressions."""
    typesys, writer = pytest.importorskip("rosbags.typesys"), pytest.importorskip("mcap.writer")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    random = np.random.default_rng(1750)
    values, covariance = random.normal(size=(50, 13)), random.normal(size=(50, 36))
    make = {name.rpartition("/")[2]: kind for name, kind in store.types.items()}
    kind = {"none": writer.CompressionType.NONE, "lz4": writer.CompressionType.LZ4}
    to = writer.Writer(
        str(tmp_path / "x.mcap"),
        compression=kind.get(compression, writer.CompressionType.ZSTD),
        chunk_size=4000,
        use_chunking=compression != "unchunked",
    )
    to.start()
    name = "nav_msgs/msg/Odometry"
    schema = to.register_schema(name, "ros2msg", store.generate_msgdef(name, ros_version=2)[0].encode())
    channel = to.register_channel("/odom", "cdr", schema)
    for i, (x, C) in enumerate(zip(values, covariance, strict=True)):
        head = make["Header"](make["Time"](i, 5), "a" * (i % 7))
        pose = make["Pose"](make["Point"](*x[:3]), make["Quaternion"](*x[3:7]))
        twist = make["Twist"](make["Vector3"](*x[7:10]), make["Vector3"](*x[10:]))
        whole = make["Odometry"](
            head, "b" * (i % 3), make["PoseWithCovariance"](pose, C), make["TwistWithCovariance"](twist, C)
        )
        to.add_message(channel, i, bytes(store.serialize_cdr(whole, name)), i)
    to.finish()
    topic = read_mcap(tmp_path / "x.mcap", everything).topic("/odom")
    paths = [f"pose.pose.position.{a}" for a in "xyz"] + [f"pose.pose.orientation.{a}" for a in "xyzw"]
    paths += [f"twist.twist.{part}.{a}" for part in ("linear", "angular") for a in "xyz"]
    found = topic.numbers([*paths, "pose.covariance[0]", "twist.covariance[35]", "header.stamp.sec"])
    assert np.array_equal(np.stack([found[path] for path in paths], axis=1), values)
    assert np.array_equal(found["pose.covariance[0]"], covariance[:, 0])
    assert np.array_equal(found["twist.covariance[35]"], covariance[:, 35])
    assert np.array_equal(found["header.stamp.sec"], np.arange(50)) and np.array_equal(topic.times, np.arange(50))


@pytest.mark.long
def test_a_mission_writes_a_bag_and_a_vehicle_is_identified_from_it(tmp_path, capsys):
    remus = Craft(vehicles.load("remus_100"))
    t = np.arange(0.0, 12.0, 0.1)
    rudder = 0.14 * np.sign(np.sin(t) + 1e-12)
    start = remus.start(position=(0, 0, 20), speed=1.5, actuators={"propeller": 18.0})
    inputs = {"rudder": co.Held(t, rudder), "stern_planes": co.Held([0.0], [0.02]), "propeller": co.Held([0.0], [18.0])}
    run = co.simulate(remus.system, start, dt=0.05, duration=12, inputs=inputs, save_every=2)
    path = run.save(tmp_path / "dive.mcap")
    assert main(["identify", "remus_100", str(path), "--json", "--parameters", "hull.axial_drag"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["dt"] == 0.05
    assert found["parameters"]["hull.axial_drag"]["value"] == pytest.approx(0.42, rel=1e-6)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: b"", "is not an MCAP file: it is empty"),
        (lambda c: b"time_s,u_m_s\n", "is not an MCAP file: it begins with 74 69"),
        (lambda c: c[: len(c) // 2], "was not closed: it ends after"),
        (lambda c: c[:8], "was not closed"),
        (lambda c: c[:20_000] + bytes(64) + c[20_064:], "damaged at byte"),
    ],
)
def test_a_damaged_file_is_refused(dive, tmp_path, change, words):
    path = tmp_path / "bad.mcap"
    path.write_bytes(change(dive.read_bytes()))
    with pytest.raises(FileError, match=words):
        read_log(path)
