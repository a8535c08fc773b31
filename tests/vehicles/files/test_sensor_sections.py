"""Sensors in vehicle files: read, turned, written as they were read, and mistakes told in a sentence each."""
# ruff: noqa: E501 — a mistake a line

import warnings
from dataclasses import fields

import numpy as np
import pytest

from coadjoint.errors import ArgumentError
from coadjoint_vehicles.files.file import vehicle_from_text
from coadjoint_vehicles.files.registry import vehicle_text
from coadjoint_vehicles.files.writing import vehicle_to_toml
from coadjoint_vehicles.sensors import Dvl, Errors, Imu, Usbl

SECTIONS = """
[sensors.imu]
kind = "imu"
note = "in the nose"
rate = { value = 100, unit = "Hz", source = "PVS" }
latency = { value = 5, unit = "ms", source = "PVS" }
position = { value = [300, 10, -20], unit = "mm", source = "PVS" }
euler_zyx = { value = [90, 10, 5], unit = "deg", source = "PVS" }
[sensors.imu.gyroscope]
noise_density = { value = 0.005, unit = "deg/s/√Hz", source = "PVS", note = "typical of its class" }
bias_instability = { value = 10, unit = "deg/h", source = "PVS" }
bias_time = { value = 300, unit = "s", source = "PVS" }
[sensors.imu.accelerometer]
noise_density = { value = 0.1, unit = "m/s/√h", source = "PVS" }
scale = { value = [1, 1, 2], unit = "%", source = "PVS" }
misalignment = { value = 0.1, unit = "deg", source = "PVS" }

[sensors.log]
kind = "dvl"
track = "water"
rate = { value = 5, unit = "Hz", source = "PVS" }
highest = { value = 50, unit = "m", source = "PVS" }
dropout = { value = 2, unit = "%", source = "PVS" }

[sensors.fix]
kind = "usbl"
seen_from = "beacon"
rate = { value = 30, unit = "1/min", source = "PVS" }
beacon = { value = [10, 20, 30], unit = "m", source = "PVS" }
"""
REMUS = vehicle_text("remus_100").split("[sensors", maxsplit=1)[0].partition("[controller]")[0]


def read(sections=SECTIONS, whole=REMUS):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return vehicle_from_text(whole + sections)


def test_sensors_are_read_in_si_units_with_the_source_of_every_number():
    vehicle = read()
    imu, log, fix = vehicle.sensors
    assert isinstance(imu, Imu) and isinstance(log, Dvl) and isinstance(fix, Usbl)
    assert (imu.name, imu.rate, imu.latency, log.track, log.highest, fix.seen_from) == (
        "imu",
        100,
        0.005,
        "water",
        50,
        "beacon",
    )
    np.testing.assert_allclose(imu.position, [0.3, 0.01, -0.02])
    np.testing.assert_allclose(imu.euler_zyx, np.radians([90, 10, 5]))
    gyroscope, accelerometer = imu.gyroscope, imu.accelerometer
    assert gyroscope.noise_density == pytest.approx(np.radians(0.005))
    assert gyroscope.bias_instability == pytest.approx(np.radians(10) / 3600)
    assert accelerometer.noise_density == pytest.approx(0.1 / 60) and log.dropout == 0.02 and fix.rate == 0.5
    np.testing.assert_allclose(accelerometer.scale, [0.01, 0.01, 0.02])
    told = vehicle.provenance["sensors.imu.gyroscope.noise_density"]
    assert (told.value, told.unit, told.source, told.note) == (0.005, "deg/s/√Hz", "PVS", "typical of its class")
    assert vehicle.sensor("log") is log
    with pytest.raises(ArgumentError, match="no sensor `sonar`: it knows fix, imu, log"):
        vehicle.sensor("sonar")


def test_poses_in_other_axes_are_turned():
    there = read(SECTIONS.replace('kind = "imu"', 'kind = "imu"\naxes = "FLU"')).sensor("imu")
    np.testing.assert_allclose(there.position, [0.3, -0.01, 0.02])
    np.testing.assert_allclose(there.euler_zyx, np.radians([-90, -10, 5]))


def same(ours, theirs):
    for field in fields(ours):
        a, b = getattr(ours, field.name), getattr(theirs, field.name)
        if isinstance(a, Errors):
            same(a, b)
        elif a is None or isinstance(a, str):
            assert a == b, field.name
        else:
            np.testing.assert_allclose(a, b, rtol=1e-15)


def test_a_vehicle_with_sensors_that_is_written_reads_as_itself():
    vehicle = read()
    again = vehicle_from_text(vehicle_to_toml(vehicle))
    assert [type(one) for one in again.sensors] == [type(one) for one in vehicle.sensors]
    for ours, theirs in zip(vehicle.sensors, again.sensors, strict=True):
        same(ours, theirs)
    assert again.provenance["sensors.imu.gyroscope.noise_density"].note == "typical of its class"


RATE = 'rate = { value = 100, unit = "Hz", source = "PVS" }'
MISTAKES = {
    "a kind that is none": ('kind = "imu"', 'kind = "inu"', r"\[sensors.imu\] kind must be one of .*Did you mean 'imu'\?"),
    "no kind": ('kind = "imu"\n', "", r"\[sensors.imu\] needs `kind = "),
    "no rate": (RATE, "", r"\[sensors.imu\] needs rate = \{ value"),
    "a misspelt rate": (RATE, RATE.replace("rate", "rat"), r"needs rate = .*but has `rat`: did you mean `rate`\?"),
    "a rate of zero": (RATE, RATE.replace("100", "0"), r"cannot be as it is given: .*`rate` of the sensor `imu` must be positive"),
    "a rate in seconds": (RATE, RATE.replace("Hz", "s"), r'rate measures 1/s, but its unit is "s"'),
    "a bare rate": (RATE, "rate = 100", r"rate must say its unit"),
    "an unknown key": ('note = "in the nose"', "noice = 3", r"\[sensors.imu\] has no key `noice`: did you mean"),
    "a negative latency": ("value = 5, unit", "value = -5, unit", r"`latency` of the sensor `imu` must be at least 0, but is -0.005"),
    "a pose of two angles": ("[90, 10, 5]", "[90, 10]", r"euler_zyx must hold rows of three"),
    "a place in kilometres": ("[300, 10, -20], unit = \"mm\"", "[300, 10, -20], unit = \"km\"", r"sensor `imu` must be a point of the vehicle"),
    "a density without the root": ("deg/s/√Hz", "deg/s", r'gyroscope\] noise_density measures rad/s/√Hz, but its unit is "deg/s"'),
    "a root of nothing": ("deg/s/√Hz", "deg/s/√Hx", r"`√Hx` is not known"),
    "a noise twice": ("bias_instability = { value = 10", 'noise = { value = 1, unit = "deg/s" }\nbias_instability = { value = 10', r"`noise`, of one reading, and `noise_density`.*give one of them"),
    "a bias without its time": ('bias_time = { value = 300, unit = "s", source = "PVS" }\n', "", r"needs `bias_instability` and `bias_time` together"),
    "an error that is none": ("misalignment = {", "missalignment = {", r"\[sensors.imu.accelerometer\] has no key `missalignment`: did you mean `misalignment`"),
    "a channel that is none": ("[sensors.imu.gyroscope]", "[sensors.imu.gyro]", r"\[sensors.imu\] has no key `gyro`: did you mean `gyroscope`"),
    "a channel as a number": ("[sensors.log]", '[sensors.depth]\nkind = "depth"\n' + RATE + '\ndepth = { value = 1, unit = "m" }\n[sensors.log]', r"depth has several errors, each with its name: write depth.noise"),
    "an error of four": ("[1, 1, 2]", "[1, 1, 2, 2]", r"`accelerometer.scale` of the sensor `imu` must be one number or have shape .3,."),
    "a track that is none": ('track = "water"', 'track = "weather"', r"track must be one of 'bottom', 'water', but is 'weather'. Did you mean 'water'\?"),
    "a share beyond one": ('value = 2, unit = "%"', 'value = 200, unit = "%"', r"`dropout` of the sensor `log` must be at most 1, but is 2"),
    "no beacon": ('beacon = { value = [10, 20, 30], unit = "m", source = "PVS" }', "", r"\[sensors.fix\] needs beacon = "),
    "a beacon in the plane": ("[10, 20, 30]", "[10, 20]", r"`beacon` of the sensor `fix` must have shape \(3,\)"),
    "a name of two words": ("[sensors.fix]", '[sensors."my fix"]', r"the name of a sensor must be one word"),
    "a source that is none": (RATE, RATE.replace("PVS", "PVC"), r"source 'PVC', which \[sources\] does not have"),
    "a list of sensors": (SECTIONS, '\n[[sensors]]\nkind = "imu"\n', r"sections with names of their own, as in \[sensors.imu\]"),
    "a sensor that is none": (SECTIONS, "\n[sensors]\nimu = 3\n", r"\[sensors.imu\] must be a section with keys, but is 3"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_in_a_sensor_is_told_in_one_sentence_with_its_place(name):
    old, new, sentence = MISTAKES[name]
    assert old in SECTIONS
    with pytest.raises(ArgumentError, match=sentence) as told:
        read(SECTIONS.replace(old, new, 1))
    assert str(told.value).startswith("vehicle.toml: ") and "\n" not in str(told.value)


def test_a_sensor_far_off_the_hull_is_doubtful():
    said = read(SECTIONS.replace('[300, 10, -20], unit = "mm"', '[3, 0, 0], unit = "m"')).warnings
    assert any("`imu` sits 3 m from the origin" in sentence for sentence in said)
    assert not any("sits" in sentence for sentence in read().warnings)
