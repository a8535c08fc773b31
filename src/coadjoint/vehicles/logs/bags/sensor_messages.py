"""What the sensors of a run read as messages of ROS 2: stamped when it was measured, logged when it was there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.groups import attitude
from coadjoint.vehicles import axes as border
from coadjoint.vehicles.axes import Axes
from coadjoint.vehicles.logs.bags.converted import GRAVITY, WaterAbove, fixes
from coadjoint.vehicles.logs.bags.schemas import OWN_NAMES, OWN_TYPES
from coadjoint.vehicles.logs.bags.written import Written, quaternion, quaternions, signed, vector

if TYPE_CHECKING:
    import xarray

FOLDER = "/sensors/"
"""What the topics of sensors begin with."""
_PREFIX = "sensor_"
_UNKNOWN = np.r_[-1.0, np.zeros(8)]


def sensor_rows(
    dataset: xarray.Dataset, axes: Axes, origin: tuple[float, float] | None, water: WaterAbove
) -> list[Written]:
    """The messages `/sensors/NAME` of every sensor whose readings a dataset has.

    Vectors are along the axes of the sensor, turned as those of the body are: forward, port, up in "ENU/FLU". origin:
    latitude and longitude, °, of north and east 0, without which fixes of satellites are positions with no attitude.
    """
    found = []
    for variable in dataset.data_vars:
        text = str(variable)
        if not (text.startswith(_PREFIX) and text.endswith("_arrival")):
            continue
        name = text[len(_PREFIX) : -len("_arrival")]
        key = f"{_PREFIX}{name}_time"
        channels = {
            str(one)[len(_PREFIX) + len(name) + 1 :]: values
            for one, values in dataset.data_vars.items()
            if values.dims[:1] == (key,) and values.ndim == 2
        }
        kind = str(next(iter(channels.values())).attrs.get("kind", ""))
        numbers = {channel: np.asarray(values.values, float) for channel, values in channels.items()}
        type_, values = _message(kind, numbers, axes, origin, water)
        time, arrival = np.asarray(dataset[key].values), np.asarray(dataset[text].values)
        found.append(Written(f"{FOLDER}{name}", type_, {"header.frame_id": name} | values, time, arrival))
    return found


def mounts(dataset: xarray.Dataset) -> dict[str, str]:
    """Where sensors sit: "position.NAME", m, and "euler_zyx.NAME", rad, as texts, of those that are not at O."""
    found = {}
    for values in dataset.data_vars.values():
        name = str(values.dims[0])[len(_PREFIX) : -len("_time")] if values.dims else ""
        for key in ("position", "euler_zyx"):
            place = values.attrs.get(key)
            if place is not None and np.any(np.asarray(place) != 0):
                found[f"{key}.{name}"] = " ".join(repr(float(x)) for x in np.ravel(place))
    return found


def _message(
    kind: str, numbers: Mapping[str, np.ndarray], axes: Axes, origin: tuple[float, float] | None, water: WaterAbove
) -> tuple[str, dict[str, Any]]:
    """Type and fields of a kind of sensor."""
    body = border.body_axes(axes)
    if kind == "imu":
        return "sensor_msgs/Imu", {
            "orientation_covariance": _UNKNOWN,
            **vector("angular_velocity", signed(numbers["gyroscope"], body)),
            **vector("linear_acceleration", signed(numbers["accelerometer"], body)),
        }
    if kind == "ahrs":
        (roll, pitch), heading = numbers["tilt"].T, numbers["heading"][:, 0]
        turn = quaternions(np.asarray(attitude.zyx(heading, pitch, roll)), axes)
        silent = {"angular_velocity_covariance": _UNKNOWN, "linear_acceleration_covariance": _UNKNOWN}
        return "sensor_msgs/Imu", {**silent, **quaternion("orientation", turn)}
    if kind == "depth":
        pressure = water.surface + water.density * GRAVITY * numbers["depth"][:, 0]
        return "sensor_msgs/FluidPressure", {"fluid_pressure": pressure}
    if kind == "dvl":
        speed = signed(numbers["velocity"], body)
        unknown = dict.fromkeys((f"twist.twist.angular.{axis}" for axis in "xyz"), np.nan)
        return "geometry_msgs/TwistWithCovarianceStamped", {**vector("twist.twist.linear", speed), **unknown}
    if kind == "gps":
        place = np.concatenate([numbers["fix"], np.zeros((len(numbers["fix"]), 1))], axis=1)
        if origin is not None:
            latitude, longitude = fixes(place, origin)
            return "sensor_msgs/NavSatFix", {"latitude": latitude, "longitude": longitude}
        unknown = np.full((len(place), 4), np.nan)
        place = signed(np.where([True, True, False], place, np.nan), border.space_axes(axes))
        return "geometry_msgs/PoseWithCovarianceStamped", {
            "header.frame_id": "map",
            **vector("pose.pose.position", place),
            **quaternion("pose.pose.orientation", unknown),
        }
    fields = [line.split()[1] for line in OWN_TYPES[kind].splitlines()[1:]]
    table = np.concatenate([numbers[channel] for channel in numbers], axis=1)
    return OWN_NAMES[kind], dict(zip(fields, table.T, strict=True))
