"""What the sensors of a mission read is in its bag, stamped when it was measured, and is read back to the bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import CoadjointError, FileError
from coadjoint.identification.log import Log
from coadjoint_vehicles.logs import read_log, write_log, write_mcap
from coadjoint_vehicles.logs.records import VehicleRecords
from coadjoint_vehicles.readings.of_run import readings
from coadjoint_vehicles.sensors import Ahrs, Altimeter, Compass, Depth, Dvl, DvlBeams, Gps, Imu, Usbl

mcap = pytest.importorskip("mcap.reader")

SENSORS = (
    Imu(name="imu", rate=20.0, latency=0.01),
    Ahrs(name="ahrs", rate=10.0),
    Depth(name="pressure", rate=4.0, latency=0.125),
    Dvl(name="dvl", rate=5.0, latency=0.25, position=(0.3, 0, 0.1)),
    Gps(name="gps", rate=1.0, deepest=100.0),
    Compass(name="compass", rate=4.0),
    Altimeter(name="altimeter", rate=2.0),
    DvlBeams(name="beams", rate=2.0, beam_angle=0.5),
    Usbl(name="usbl", rate=1.0, latency=1.5, beacon=(0.0, 0.0, 0.0)),
)


@pytest.fixture(scope="module")
def run():
    craft = co.vehicles.Craft(co.vehicles.load("ellipsoid"))
    begun = craft.start(position=(3, -2, 10), speed=1.0, euler_zyx=(0.4, 0.1, 0.05))
    run = co.simulate(craft.system, begun, dt=0.05, duration=3, monitors=False, progress=False)
    read = readings(run, seed=3, sensors=SENSORS, bottom=30.0, craft=craft)
    read.add_to(run.dataset)
    return run, read


@pytest.fixture(scope="module")
def bags(run, tmp_path_factory):
    folder = tmp_path_factory.mktemp("bags")
    for axes in ("ENU/FLU", "NED/FRD"):
        write_mcap(run[0].dataset, folder / f"{axes[:3]}.mcap", axes=axes, origin=(59.9, 10.7), density=999.0)
    return folder


def columns(path, topic, names):
    log = read_log(path, topics=[topic])
    return log, np.stack([log.columns[name] for name in names], axis=1)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("axes", ["ENU", "NED"])
def test_readings_are_read_back_as_they_were(run, bags, axes):
    read, path = run[1], bags / f"{axes}.mcap"
    log, rates = columns(path, "/sensors/imu", "pqr")
    assert np.array_equal(rates, read["imu"].of("gyroscope"))
    assert np.allclose(log.time, read["imu"].time - read["imu"].time[0], rtol=0, atol=1e-9)
    log, speed = columns(path, "/sensors/dvl", "uvw")
    assert np.array_equal(speed, read["dvl"].of("velocity")) and not {"p", "q", "r"} & set(log.columns)
    assert any("a sensor at 0.3, 0, 0.1 m forward, starboard and down" in note for note in log.notes)
    _, angles = columns(path, "/sensors/ahrs", ("roll", "pitch", "heading"))
    np.testing.assert_allclose(angles, read["ahrs"].values, atol=1e-12)
    _, depth = columns(path, "/sensors/pressure", ("depth",))
    np.testing.assert_allclose(depth, read["pressure"].values, rtol=1e-13)


@pytest.mark.long
def test_the_motion_itself_comes_first_and_water_is_what_the_bag_says(run, bags):
    log, records = read_log(bags / "ENU.mcap"), VehicleRecords(run[0].dataset)
    assert len(log) == len(records.time) and np.array_equal(log.columns["p"], records.rates[:, 0])
    _, depth = columns(bags / "ENU.mcap", "/pressure", ("depth",))
    np.testing.assert_allclose(depth[:, 0], records.depth, rtol=1e-12)


def test_messages_are_stamped_when_measured_and_logged_when_they_were_there(run, bags):
    from mcap_ros2.decoder import DecoderFactory

    read = run[1]
    seen: dict[str, list] = {name: [] for name in read}
    last = 0
    with (bags / "NED.mcap").open("rb") as opened:
        reader = mcap.make_reader(opened, decoder_factories=[DecoderFactory()])
        for _, channel, message, ros in reader.iter_decoded_messages(log_time_order=False):
            assert message.log_time >= last
            last = message.log_time
            if channel.topic.startswith("/sensors/"):
                stamp = ros.header.stamp.sec * 10**9 + ros.header.stamp.nanosec
                seen[channel.topic.removeprefix("/sensors/")].append((stamp, message.log_time, ros))
    for name, rows in seen.items():
        assert len(rows) == len(read[name]) > 0, name
        assert np.array_equal([row[0] for row in rows], np.rint(read[name].time * 1e9)), name
        assert np.array_equal([row[1] for row in rows], np.rint(read[name].arrival * 1e9)), name
    first = {name: rows[0][2] for name, rows in seen.items()}
    force = first["imu"].linear_acceleration
    assert np.array_equal([force.x, force.y, force.z], read["imu"].of("accelerometer")[0])
    assert first["imu"].orientation_covariance[0] == -1 and first["imu"].header.frame_id == "imu"
    assert first["compass"].heading == read["compass"].values[0, 0]
    assert first["altimeter"].range == read["altimeter"].values[0, 0]
    assert [first["usbl"].range, first["usbl"].bearing, first["usbl"].elevation] == read["usbl"].values[0].tolist()
    assert [getattr(first["beams"], f"beam_{i}") for i in range(1, 5)] == read["beams"].values[0].tolist()


def test_fixes_are_latitudes_or_else_positions(run, bags, tmp_path):
    fix = run[1]["gps"].values
    log = read_log(bags / "ENU.mcap", sensors={"sensor": [{"topic": "/sensors/gps", "origin": [59.9, 10.7]}]})
    np.testing.assert_allclose(np.stack([log.columns[n] for n in ("north", "east")], axis=1), fix, atol=1e-7)
    for axes in ("ENU/FLU", "NED/FRD"):
        write_mcap(run[0].dataset, tmp_path / "x.mcap", axes=axes)
        log, place = columns(tmp_path / "x.mcap", "/sensors/gps", ("north", "east"))
        assert np.array_equal(place, fix) and set(log.columns) == {"north", "east"}


def test_water_that_is_none_is_refused(run, tmp_path: Path):
    wrongs: tuple[dict[str, Any], ...] = ({"density": 0.0}, {"surface_pressure": -1.0}, {"density": "salt"})
    for wrong in wrongs:
        with pytest.raises(CoadjointError, match=next(iter(wrong))):
            write_mcap(run[0].dataset, tmp_path / "x.mcap", **wrong)


def test_topics_that_tell_nothing_of_the_motion_and_a_text_of_one_are_told(bags):
    both = r"/sensors/compass \(coadjoint_msgs/msg/Compass, 13\).* `sensors`, and the others are .*/odometry"
    with pytest.raises(co.errors.FileError, match=both) as told:
        read_log(bags / "NED.mcap", topics=["/sensors/compass"])
    assert ", 0)" not in str(told.value)
    text: Any = "/sensors/imu"
    with pytest.raises(co.errors.ArgumentError, match=r"must be a list of topics, such as \['/sensors/imu'\], but is"):
        read_log(bags / "NED.mcap", topics=text)


def test_a_dataset_in_place_of_a_log_is_told_with_what_to_do(tmp_path):
    craft = co.vehicles.Craft(co.vehicles.load("ellipsoid"))
    run = co.simulate(
        craft.system, craft.start(position=(0, 0, 10), speed=1.0), dt=0.05, duration=1, progress=False, monitors=False
    )
    run.save(tmp_path / "run.nc")
    with pytest.raises(
        co.errors.FileError, match=r"run.nc is a dataset, not a log: of a run `co.load` reads it, whose `save`"
    ):
        read_log(tmp_path / "run.nc")
    co.load(tmp_path / "run.nc").save(tmp_path / "run.csv")
    assert len(read_log(tmp_path / "run.csv")) == 21


def test_a_sensor_that_read_nothing_has_an_empty_topic(run, tmp_path):
    """A GPS whose antenna stays below the surface, as on every dive."""
    silent = run[0].dataset.copy()
    silent = silent.isel(sensor_gps_time=slice(0, 0))
    write_mcap(silent, tmp_path / "dive.mcap")
    log = read_log(tmp_path / "dive.mcap")
    assert np.array_equal(log.columns["north"], VehicleRecords(run[0].dataset).position[:, 0])
    with pytest.raises(CoadjointError, match=r"no message that measures a vehicle .* /sensors/gps"):
        read_log(tmp_path / "dive.mcap", topics=["/sensors/gps"])


def test_an_arrival_that_no_message_can_have_is_told(run, tmp_path):
    late = run[0].dataset.assign(sensor_usbl_arrival=run[0].dataset.sensor_usbl_arrival + 1e10)
    with pytest.raises(CoadjointError, match=r"/sensors/usbl are there up to 1e\+10 s, .* give the sensor a shorter"):
        write_mcap(late, tmp_path / "late.mcap")


WRONG = {
    "two numbers": ({"position_m": [1.0, 2.0]}, "position must be three numbers"),
    "a word": ({"position_m": "nose"}, "position_m must hold numbers"),
    "millimetres": ({"position_m": [500, 0, 0]}, "at most 100 m from the origin O"),
    "no number": ({"euler_zyx_deg": [0, 0, float("nan")]}, "Each number of .* euler_zyx must be a number"),
    "another unit": ({"euler_zyx": [0, 0, 1]}, "`euler_zyx` .* needs its unit at its end, as in `euler_zyx_deg`"),
    "a part of a vector": (
        {"columns": {"u_m_s": "twist.twist.linear.x"}, "euler_zyx_deg": [0, 0, 90]},
        "needs u, v, w together, but has u",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_mounting_is_told(bags, case):
    keys, sentence = WRONG[case]
    with pytest.raises(FileError, match=sentence):
        read_log(bags / "NED.mcap", sensors={"sensor": [{"topic": "/sensors/dvl", **keys}]})


def test_a_file_that_cannot_say_where_a_sensor_sits_is_not_written(bags, tmp_path):
    log = read_log(bags / "NED.mcap", topics=["/sensors/dvl"])
    for name in ("log.csv", "log.mcap"):
        with pytest.raises(CoadjointError, match=r"does not say where sensors sit, but `u` .* \[0\.3, 0.*0\.1\] m"):
            write_log(log, tmp_path / name)
    with pytest.raises(CoadjointError, match="`positions` names `p`"):
        Log(log.time, {"p": log.columns["u"]}, positions={"p": (0.3, 0.0, 0.1)})
    with pytest.raises(CoadjointError, match="three finite numbers"):
        Log(log.time, {"u": log.columns["u"]}, positions={"u": (0.0, 1.0)})  # pyright: ignore[reportArgumentType]
