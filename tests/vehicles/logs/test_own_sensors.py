"""Sensors of one's own in logs: a message with their numbers by their names, or the one that they declare."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import pytest
import xarray

from coadjoint import units as u
from coadjoint_vehicles.logs.bags import sensor_messages
from coadjoint_vehicles.logs.bags.bag import Bag
from coadjoint_vehicles.logs.bags.converted import WaterAbove
from coadjoint_vehicles.logs.bags.mcap_file import read_mcap
from coadjoint_vehicles.logs.bags.sensor_messages import declared, sensor_rows
from coadjoint_vehicles.logs.bags.writing import _content
from coadjoint_vehicles.readings.taken import Readings, SensorReading
from coadjoint_vehicles.sensors import Altimeter, Channel, Depth, Errors, Sensor
from coadjoint_vehicles.sensors.message import Message, MessageField

WATER = WaterAbove(101325.0, 1025.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class SpeedLog(Sensor):
    """The speed ahead, and how far the wheel has turned."""

    kind: ClassVar[str] = "speed_log"
    channels: ClassVar[tuple[Channel, ...]] = (
        Channel("speed", ("Speed ahead",), u.SPEED, "m/s"),
        Channel("wheel", ("wheel",), u.ANGLE, "rad", angle=True),
    )
    speed: Errors = field(default_factory=Errors)
    wheel: Errors = field(default_factory=Errors)

    def reading(self, motion, own):
        return jnp.stack([motion.velocity_at(own.position)[0], 0.0])


@dataclass(frozen=True, eq=False, kw_only=True)
class Log(SpeedLog):
    """The same without a word for vehicle files."""

    kind: ClassVar[str] = ""


@dataclass(frozen=True, eq=False, kw_only=True)
class Gauge(Depth):
    """A depth gauge that declares another message than that of the library."""

    kind: ClassVar[str] = "gauge"
    message: ClassVar[Message | None] = Message(
        "sensor_msgs/FluidPressure", (MessageField("fluid_pressure", "pressure", ("depth",)),)
    )


def read_by(sensor: Sensor, count: int = 4) -> xarray.Dataset:
    """A dataset with numbers 0, 1, 2, … as readings of a sensor."""
    values = np.arange(float(count * sensor.size)).reshape(count, sensor.size)
    times = np.arange(float(count))
    dataset = xarray.Dataset()
    Readings(
        {sensor.name: SensorReading(sensor, times, times + 0.5, values, values, np.arange(count), count)}, 0
    ).add_to(dataset)
    return dataset


def messages_of(tmp_path, *sensors: Sensor) -> Bag:
    rows = [row for sensor in sensors for row in sensor_rows(read_by(sensor), "NED/FRD", None, WATER)]
    file = tmp_path / "x.mcap"
    file.write_bytes(_content(rows, np.arange(4.0), {"axes": "NED/FRD"}))
    return read_mcap(file, lambda *_: True)


@pytest.mark.parametrize(
    ("kind", "type_"), [(SpeedLog, "coadjoint_msgs/msg/SpeedLog"), (Log, "coadjoint_msgs/msg/Way")]
)
def test_a_sensor_of_ones_own_sends_its_numbers_by_their_names(tmp_path, kind, type_):
    pytest.importorskip("mcap")
    bag = messages_of(tmp_path, kind(name="way", rate=1.0))
    assert bag.topics() == {"/sensors/way": (type_, 4)}
    found = bag.topic("/sensors/way").numbers(["speed_ahead", "wheel"])
    np.testing.assert_array_equal(found["speed_ahead"], [0, 2, 4, 6])
    np.testing.assert_array_equal(found["wheel"], [1, 3, 5, 7])


def test_a_sensor_of_ones_own_may_declare_a_message_of_ros(tmp_path):
    pytest.importorskip("mcap")
    bag = messages_of(tmp_path, Gauge(name="gauge", rate=1.0))
    assert bag.topics()["/sensors/gauge"][0] == "sensor_msgs/msg/FluidPressure"
    pressure = bag.topic("/sensors/gauge").numbers(["fluid_pressure"])["fluid_pressure"]
    np.testing.assert_allclose(pressure, 101325 + 1025 * 9.80665 * np.arange(4.0), rtol=1e-12)


def test_names_that_ros_does_not_take_become_words():
    for text, word in (("Speed ahead", "speed_ahead"), ("3D", "value"), ("_x__y_", "x_y"), ("ν", "value")):
        assert sensor_messages._word(text, "value") == word


def test_kinds_of_the_library_declare_their_messages_and_what_they_need():
    types = {"imu": "sensor_msgs/Imu", "ahrs": "sensor_msgs/Imu", "depth": "sensor_msgs/FluidPressure",
             "dvl": "geometry_msgs/TwistWithCovarianceStamped", "gps": "sensor_msgs/NavSatFix"}  # fmt: skip
    found = {
        kind: declared(kind) for kind in ("imu", "ahrs", "depth", "dvl", "gps", "compass", "usbl", "dvl_beams", "no")
    }
    assert {kind: one.type for kind, one in found.items() if one is not None} == types
    assert Altimeter.required == ("bottom",) and Depth.required == ()
