"""Bags of every format say the same, and a declaration says which field is what."""

from __future__ import annotations

import numpy as np
import pytest

from coadjoint.errors import FileError
from coadjoint_vehicles.logs import read_bag, read_log
from coadjoint_vehicles.logs.bags.converted import WaterAbove, converted

typesys = pytest.importorskip("rosbags.typesys")
pytest.importorskip("mcap")

BEAM = "float64 range\nbool locked\n"
DVL = (
    "std_msgs/Header header\nstring frame\nmarine_msgs/Beam[] beams\nfloat32 altitude\ngeometry_msgs/Vector3 velocity\n"
)
RANDOM = np.random.default_rng(1687)
VELOCITY, PRESSURE, THRUST = RANDOM.normal(size=(40, 3)), RANDOM.uniform(1e5, 2e5, 40), RANDOM.normal(size=(40, 2))
STAMPS = np.arange(40) * 100_000_000 + 1_700_000_000_000_000_000
DECLARED = {
    "sensor": [
        {
            "topic": "/dvl",
            "columns": {"u_cm_s": "velocity.x", "v_cm_s": "velocity.y", "w_cm_s": "velocity.z"},
            "axes": "NED/FRD",
            "offset_s": -0.05,
        },
        {"topic": "/pressure", "surface_pressure": 1e5, "density": 1000},
    ],
    "command": [{"topic": "/thrusters", "name": "thrusters", "fields": ["data[0]", "data[1]"], "unit": "kN"}],
}


def store_of(stamped):
    store = typesys.get_typestore(stamped)
    for name, text in (("marine_msgs/msg/Beam", BEAM), ("marine_msgs/msg/Dvl", DVL)):
        store.register(typesys.get_types_from_msg(text, name))
    return store


def messages(store, ros1):
    """Time, topic, type and message: a DVL of one's own, with sequences of several lengths, a pressure, commands."""
    make = {name.rpartition("/")[2]: kind for name, kind in store.types.items()}
    make["Time"] = store.types["builtin_interfaces/msg/Time"]
    for i, t in enumerate(STAMPS.tolist()):
        stamp = make["Time"](t // 10**9, t % 10**9)
        head = make["Header"](*((i,) if ros1 else ()), stamp, "dvl")
        beams = [make["Beam"](float(k), True) for k in range(i % 4)]
        dvl = make["Dvl"](head, "x" * (i % 3), beams, 1.5, make["Vector3"](*VELOCITY[i]))
        layout = make["MultiArrayLayout"]([], 0)
        yield t, "/dvl", "marine_msgs/msg/Dvl", dvl
        yield t, "/pressure", "sensor_msgs/msg/FluidPressure", make["FluidPressure"](head, PRESSURE[i], 0.0)
        yield t, "/thrusters", "std_msgs/msg/Float64MultiArray", make["Float64MultiArray"](layout, THRUST[i])


def written(folder, kind):
    """A bag that rosbags writes, or the writer of mcap."""
    from rosbags import rosbag1, rosbag2

    ros1 = kind.startswith("ros1")
    store = store_of(typesys.Stores.ROS1_NOETIC if ros1 else typesys.Stores.ROS2_JAZZY)
    path = folder / ("dive.bag" if ros1 else "dive")
    if ros1:
        writer = rosbag1.Writer(path)
        if kind != "ros1":
            writer.set_compression(rosbag1.Writer.CompressionFormat[kind[5:].upper()])
    else:
        plugin = rosbag2.StoragePlugin.MCAP if kind == "mcap" else rosbag2.StoragePlugin.SQLITE3
        writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
    with writer:
        channels = {}
        for t, topic, name, message in messages(store, ros1):
            if topic not in channels:
                channels[topic] = writer.add_connection(topic, name, typestore=store)
            raw = store.serialize_ros1(message, name) if ros1 else store.serialize_cdr(message, name)
            writer.write(channels[topic], t, raw)
    return path


@pytest.mark.cases(3)
@pytest.mark.parametrize("kind", ["mcap", "sqlite", "ros1", "ros1_bz2", "ros1_lz4"])
def test_a_bag_of_any_format_is_read_to_the_bit_as_it_is_declared(tmp_path, kind):
    log = read_log(written(tmp_path, kind), sensors=DECLARED)
    there = np.isfinite(log.columns["u"])
    assert np.array_equal(np.stack([log.columns[name][there] for name in "uvw"], axis=1), (VELOCITY * 0.01)[1:])
    deep = np.isfinite(log.columns["depth"])
    assert np.array_equal(log.columns["depth"][deep], (PRESSURE - 1e5) / (1000 * 9.80665))
    assert np.array_equal(log.inputs["thrusters"][deep], THRUST * 1000) and log.units["thrusters"] == "N"
    assert log.time[there][0] - log.time[deep][0] == pytest.approx(0.05, abs=1e-12)
    assert any("The first 0.05 s are left out" in note for note in log.notes)


def test_a_declaration_is_a_file_too(tmp_path):
    path = tmp_path / "sensors.toml"
    path.write_text('[[sensor]]\ntopic = "/pressure"\nevery_s = 0.5\n')
    log = read_log(written(tmp_path, "sqlite"), sensors=path)
    assert list(log.columns) == ["depth"] and len(log) == 8
    assert log.notes[0].endswith(": 101325 Pa above, 1025 kg/m³.")


def test_fixes_count_north_and_east_from_the_first_or_from_an_origin():
    """One minute of latitude at 45° is 1852.2 m, of longitude 1314.2 m, on WGS 84."""
    given = {"latitude": 45 + np.array([0.0, 1 / 60]), "longitude": np.array([0.0, 1 / 60])}
    found, notes = converted(given, WaterAbove(), None, "/fix")
    assert found["north"] == pytest.approx([0, 1852.2], abs=0.5) and found["east"] == pytest.approx(
        [0, 1314.2], abs=0.5
    )
    assert notes == ["North and east of /fix count from its first fix, 45.0000000°, 0.0000000°."]
    found, notes = converted(given, WaterAbove(), (45.0, 359.99), "/fix")
    assert notes == [] and found["east"][0] == pytest.approx(0.01 * 60 * 1314.2, rel=1e-3)


def declare(**row):
    return {"sensor": [{"topic": "/dvl", **row}]}


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "declares nothing"),
        ({"sensors": []}, "no key `sensors`: did you mean `sensor`"),
        ({"sensor": "dvl"}, "must be tables, each under"),
        ({"sensor": [{}]}, "needs `topic`"),
        (declare(topic="/dlv", columns={"u_m_s": "velocity.x"}), "has no topic `/dlv`: did you mean `/dvl`"),
        (declare(), "what /dvl .marine_msgs/Dvl. measures is not known: declare its `columns`"),
        (declare(columns={"u_m_s": "velocity.q"}), "has no number `velocity.q`; near to it are velocity"),
        (declare(columns={"u_m_s": "beams"}), "has no number `beams`"),
        (declare(columns={"u_m_s": "frame"}), "has no number `frame`"),
        (declare(columns={"u_m": "velocity.x"}), "is in m, but `u` is measured in m/s"),
        (declare(columns={"u": "velocity.x"}), "has no known unit at its end"),
        (declare(columns={"speed_m_s": "velocity.x"}), "is not a quantity of a vehicle, the nearest is"),
        (declare(columns={"u_m_s": "velocity.x", "u_cm_s": "velocity.y"}), "`u` is given twice"),
        (declare(columns={"u_m_s": 3}), "`u_m_s` must be a text, but is 3"),
        (declare(columns={"depth_m": "altitude", "pressure": "altitude"}), "`pressure` says again what `depth` says"),
        (declare(columns={"latitude": "altitude"}), "needs latitude and longitude, but has latitude alone"),
        (declare(columns={"latitude": "velocity.x", "longitude": "velocity.y"}, origin=[80, 0]), "km from 80°"),
        (declare(axes="ENU"), 'must be "NED/FRD"'),
        (declare(stamp="receive"), 'stamp must be "header" or "log"'),
        (declare(offset_s="1"), "offset_s must hold numbers, .* but holds '1'"),
        (declare(every_s=-1), "every must be a number from 0 to"),
        (declare(origin=[1]), "must be .latitude, longitude."),
        ({"sensor": [{"topic": "/thrusters", "columns": {"u_m_s": "data[0]"}, "stamp": "header"}]}, 'stamp="log"'),
        ({"command": [{"topic": "/thrusters", "name": "t"}]}, "needs `field` or `fields`"),
        ({"command": [{"topic": "/thrusters", "name": "t", "field": "data[0]", "unit": "Nm/q"}]}, "`Nm` is not known"),
        ({"command": [{"topic": "/thrusters", "name": "t", "field": "data[2]"}]}, "lack numbers of a command"),
    ],
)  # fmt: skip
def test_a_declaration_that_does_not_fit_is_refused(bag, given, words):
    with pytest.raises(FileError, match=words):
        read_bag(bag, sensors=given)


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return written(tmp_path_factory.mktemp("declared"), "mcap")


def test_a_value_that_some_messages_lack_is_missing_there(bag):
    log = read_bag(bag, sensors=declare(columns={"u_m_s": "beams[1].range", "v_m_s": "velocity.y"}))
    assert np.array_equal(np.isfinite(log.columns["u"]), np.arange(40) % 4 > 1)
    assert np.array_equal(log.columns["v"], -VELOCITY[:, 1])
