"""Sensors in a bag: which topic measures which quantities, in which axes, at which times."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from coadjoint.identification.channels import VEHICLE
from coadjoint_vehicles.axes import Axes
from coadjoint_vehicles.logs.bags.converted import SPEEDS, WaterAbove
from coadjoint_vehicles.logs.bags.mounting import Mounting

Stamp = Literal["header", "log"]
"""When a sample was taken: the stamp in the head of its message, or when it was logged."""


class Number(NamedTuple):
    """A number of messages: its path, and the factor to SI units and rad."""

    path: str
    factor: float = 1.0


@dataclass(frozen=True)
class SensorTopic:
    """A topic and its measurements, names of `headers.NAMES` → number.

    mounting: where it sits in the body. water, origin: by which pressures become depths, and fixes north and east.
    stamp: None is that of the head, where messages have one. offset: s, which is added to its times. every: s, of
    which one sample is kept. rank: of the sensors that measure a column the one with the lowest is taken.
    """

    topic: str
    columns: Mapping[str, Number]
    axes: Axes = "ENU/FLU"
    stamp: Stamp | None = None
    offset: float = 0.0
    every: float = 0.0
    rank: Mapping[str, int] = field(default_factory=dict)
    unless: Mapping[str, str] = field(default_factory=dict)
    water: WaterAbove = field(default_factory=WaterAbove)
    origin: tuple[float, float] | None = None
    mounting: Mounting = field(default_factory=Mounting)


@dataclass(frozen=True)
class CommandTopic:
    """A topic with the commands, or actual values, of an actuator: the numbers of the input `name`, and their unit."""

    topic: str
    name: str
    numbers: tuple[Number, ...]
    unit: str = "1"
    stamp: Stamp | None = None
    offset: float = 0.0
    did: bool = False


def _three(names: str, path: str) -> dict[str, str]:
    return {name: f"{path}.{axis}" for name, axis in zip(names.split(), "xyz", strict=True)}


def _quaternion(path: str) -> dict[str, str]:
    return {f"q{axis}": f"{path}.{axis}" for axis in "wxyz"}


TYPES: dict[str, dict[str, str]] = {
    "nav_msgs/Odometry": {
        **_three("x y z", "pose.pose.position"), **_quaternion("pose.pose.orientation"),
        **_three("u v w", "twist.twist.linear"), **_three("p q r", "twist.twist.angular"),
    },
    "sensor_msgs/Imu": {**_quaternion("orientation"), **_three("p q r", "angular_velocity")},
    "geometry_msgs/PoseWithCovarianceStamped": {
        **_three("x y z", "pose.pose.position"), **_quaternion("pose.pose.orientation"),
    },
    "geometry_msgs/PoseStamped": {**_three("x y z", "pose.position"), **_quaternion("pose.orientation")},
    "geometry_msgs/TwistWithCovarianceStamped": {
        **_three("u v w", "twist.twist.linear"), **_three("p q r", "twist.twist.angular"),
    },
    "sensor_msgs/FluidPressure": {"pressure": "fluid_pressure"},
    "sensor_msgs/NavSatFix": {"latitude": "latitude", "longitude": "longitude"},
    "geometry_msgs/TwistStamped": {**_three("u v w", "twist.linear"), **_three("p q r", "twist.angular")},
}  # fmt: skip
"""The measurements of messages of a type without a declaration, by the paths of its numbers."""

UNKNOWN: dict[str, dict[str, str]] = {
    "sensor_msgs/Imu": {
        **dict.fromkeys(("qw", "qx", "qy", "qz"), "orientation_covariance[0]"),
        **dict.fromkeys("pqr", "angular_velocity_covariance[0]"),
    },
    "sensor_msgs/NavSatFix": dict.fromkeys(("latitude", "longitude"), "status.status"),
}
"""The number that is -1 where a sensor does not know a quantity."""

RANKS = {
    "nav_msgs/Odometry": {"p": 2, "q": 2, "r": 2},
    "sensor_msgs/Imu": {"roll": 2, "pitch": 2, "heading": 2},
    "geometry_msgs/PoseWithCovarianceStamped": dict.fromkeys(("north", "east", "depth"), 3)
    | dict.fromkeys(("roll", "pitch", "heading"), 3),
    "geometry_msgs/TwistWithCovarianceStamped": dict.fromkeys("uvw", 3) | dict.fromkeys("pqr", 4),
    "geometry_msgs/PoseStamped": dict.fromkeys(("north", "east", "depth", "roll", "pitch", "heading"), 4),
    "sensor_msgs/FluidPressure": {"depth": 5},
    "sensor_msgs/NavSatFix": {"north": 5, "east": 5},
    "geometry_msgs/TwistStamped": dict.fromkeys("uvw", 4) | dict.fromkeys("pqr", 5),
}
"""The rank of sensors of one column, of which the lowest is taken; 1 by default."""

_DRIVEN = re.compile(r"(?:^|/)(command|actuator)/(\w+)$")
DRIVING = {"std_msgs/Float64": ("data",), "std_msgs/Float32": ("data",)}
SEVERAL = {"std_msgs/Float64MultiArray", "std_msgs/Float32MultiArray"}


_DEGREES = math.pi / 180
_ANGLES = {"roll": Number("Roll", _DEGREES), "pitch": Number("Pitch", _DEGREES), "heading": Number("Yaw", _DEGREES)}
_FILTER = {
    **dict(zip(("north", "east", "depth"), map(Number, ("PN", "PE", "PD")), strict=True)),
    **dict(zip(SPEEDS, map(Number, ("VN", "VE", "VD")), strict=True)),
    **_ANGLES,
}
ARDUPILOT: dict[str, dict[str, Number]] = {
    "XKF1": _FILTER,
    "NKF1": _FILTER,
    "ATT": _ANGLES,
    "IMU": {"p": Number("GyrX"), "q": Number("GyrY"), "r": Number("GyrZ")},
    "ATTITUDE": {
        "roll": Number("roll"),
        "pitch": Number("pitch"),
        "heading": Number("yaw"),
        "p": Number("rollspeed"),
        "q": Number("pitchspeed"),
        "r": Number("yawspeed"),
    },
    "LOCAL_POSITION_NED": {"north": Number("x"), "east": Number("y"), "depth": Number("z")},
}
"""The measurements in ArduPilot's logs and telemetry: the Kalman filter, the attitude and the gyroscopes."""
_ATTITUDES = {name: {"ATT": 3, "NKF1": 2}.get(name, 1) for name in ARDUPILOT}


IN_BODY = ("geometry_msgs/TwistWithCovarianceStamped", "geometry_msgs/TwistStamped")
IN_SPACE = ("geometry_msgs/PoseWithCovarianceStamped", "geometry_msgs/PoseStamped", "nav_msgs/Odometry")
"""Types whose `header.frame_id` must be a frame of the body, and such as must have one of space."""
_OF_SPACE = re.compile(r"^(map|odom|world|earth|local_origin|utm|enu|ned)(_(ned|enu))?$")


def strange_frame(kind: str, frame: str, axes: Axes) -> str:
    """The fault in the frame of a message whose meaning follows from its type alone; "" if there is none."""
    name = frame.strip().rpartition("/")[2].lower()
    if kind in IN_BODY and _OF_SPACE.match(name):
        return f"velocities in the frame {frame!r} of space, but those of the body are read"
    if kind in IN_SPACE and name.startswith("base_link"):
        return f"a pose in the frame {frame!r} of the body, but one in space is read"
    said = name.rpartition("_")[2] if kind in IN_SPACE else ""
    if said in ("ned", "enu") and said != axes[:3].lower():
        return f"a pose in the frame {frame!r}, but its axes are read as {axes}"
    return ""


def usual(topic: str, kind: str, axes: Axes, asked: bool = False) -> SensorTopic | None:
    """The sensor of a topic by its type; None for other types, and for later instances of one unless `asked`."""
    if kind in ARDUPILOT:
        if topic not in (kind, f"{kind}[0]") and not asked:
            return None
        return SensorTopic(topic, ARDUPILOT[kind], axes, rank=dict.fromkeys(VEHICLE, _ATTITUDES[kind]))
    if kind not in TYPES:
        return None
    columns = {name: Number(path) for name, path in TYPES[kind].items()}
    return SensorTopic(topic, columns, axes, rank=RANKS[kind], unless=UNKNOWN.get(kind, {}))


CURRENT = "/current", "geometry_msgs/Vector3Stamped"
"""The topic and type by which bags of this library say how the water moves."""


def water(axes: Axes) -> SensorTopic:
    """The velocity of the water as a bag of this library has it, by the names of positions."""
    return SensorTopic(CURRENT[0], {name: Number(f"vector.{name}") for name in "xyz"}, axes)


def driven(topic: str, kind: str) -> tuple[str, bool] | None:
    """The actuator of a topic `…/command/NAME` or `…/actuator/NAME` of plain numbers, and whether it is the latter."""
    match = _DRIVEN.search(topic)
    return (match[2], match[1] == "actuator") if match and (kind in DRIVING or kind in SEVERAL) else None
