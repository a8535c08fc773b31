"""Runs of vehicles as MCAP files, with messages of ROS 2 that Foxglove, Lichtblick and Rerun show."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.groups import attitude
from coadjoint.plotting.whole_file import whole_file
from coadjoint.vehicles import axes as border
from coadjoint.vehicles.axes import Axes, space_axes
from coadjoint.vehicles.logs.bags.optional import library
from coadjoint.vehicles.logs.bags.schemas import known, schema
from coadjoint.vehicles.logs.bags.serializing import serialized
from coadjoint.vehicles.logs.records import VehicleRecords

if TYPE_CHECKING:
    import xarray

OWN = "coadjoint"
"""The name of the metadata: the axes, the step and the units of commands."""
MAP, BODY = "map", "base_link"
"""The frames of messages, as ROS names them (REP 105)."""
_CHUNK = 4_000_000


class Written(NamedTuple):
    """Messages of one topic: the type, `pkg/Name`, and the values of its fields."""

    topic: str
    type: str
    values: Mapping[str, Any]


def write_mcap(dataset: xarray.Dataset, path: str | os.PathLike[str], *, axes: Axes = "ENU/FLU") -> None:
    """A run of a vehicle as an MCAP file, as `run.save("dive.mcap")` writes it; `dataset` is that of the run.

    Topics: `/odometry`, `/tf`, `/imu` (attitude and rates), `/velocity` over ground, `/command/NAME` and
    `/actuator/NAME` of every actuator, `/set/NAME` of set points, `/current`, in SI units and rad, at the times of the
    records. axes: of the messages, "ENU/FLU" as in ROS or "NED/FRD".
    Raises ArgumentError for a run of what is no vehicle, FileError where the file cannot be written.
    """
    content = mcap_bytes(dataset, axes)
    with whole_file(path) as temporary:
        temporary.write_bytes(content)


def mcap_bytes(dataset: xarray.Dataset, axes: str = "ENU/FLU") -> bytes:
    """The content of such a file; raises ArgumentError."""
    writer = library("mcap.writer", "Writing MCAP")
    space_axes(axes)  # pyright: ignore[reportArgumentType]
    records = VehicleRecords(dataset)
    rows = [*_motion(records, axes), *_actuators(records)]  # pyright: ignore[reportArgumentType]
    stamps = np.rint(records.time * 1e9).astype(np.int64)
    if len(stamps) and (stamps[0] < 0 or np.any(np.diff(stamps) <= 0)):
        raise ArgumentError("A run is written to MCAP at times from 0 on, at least 1 ns apart: begin it at 0.")
    content = io.BytesIO()
    to = writer.Writer(content, chunk_size=_CHUNK)
    to.start(profile="ros2", library="coadjoint")
    to.add_metadata(OWN, _facts(dataset, records, axes))
    _messages(to, rows, stamps)
    to.finish()
    return content.getvalue()


def _messages(to: Any, rows: list[Written], stamps: np.ndarray) -> None:
    """All messages, in the order of their times."""
    seconds = {"sec": stamps // 1_000_000_000, "nanosec": stamps % 1_000_000_000}
    schemas: dict[str, int] = {}
    channels: list[int] = []
    contents: list[list[bytes]] = []
    for row in rows:
        package, name = row.type.split("/")
        if row.type not in schemas:
            schemas[row.type] = to.register_schema(f"{package}/msg/{name}", "ros2msg", schema(row.type).encode())
        channels.append(to.register_channel(row.topic, "cdr", schemas[row.type]))
        stamped = {
            f"{head}.stamp.{part}": n for head in ("header", "transforms[0].header") for part, n in seconds.items()
        }
        contents.append(serialized(known(row.type), len(stamps), {**stamped, **row.values}))
    for k, time in enumerate(stamps.tolist()):
        for channel, content in zip(channels, contents, strict=True):
            to.add_message(channel, time, content[k], time, k)


def _facts(dataset: xarray.Dataset, records: VehicleRecords, axes: str) -> dict[str, str]:
    found = {"axes": axes, "system": str(dataset.attrs.get("system", ""))}
    if "dt" in dataset.attrs:
        found["dt_s"] = repr(float(dataset.attrs["dt"]))
    units = {name: actuator.unit for name, actuator in records.actuators.items()}
    units |= {name: unit for name, (_, unit) in records.set_points.items()}
    return found | {f"unit.{name}": unit for name, unit in units.items()}


def _motion(records: VehicleRecords, axes: Axes) -> list[Written]:
    position = border.space_vector(records.position, axes)
    turn = attitude.to_quaternion(border.rotation(records.directions, axes))
    velocity, rates = (border.body_vector(v, axes) for v in (records.velocity, records.rates))
    unknown = np.r_[-1.0, np.zeros(8)]
    found = [
        Written(
            "/odometry",
            "nav_msgs/Odometry",
            {"header.frame_id": MAP, "child_frame_id": BODY}
            | _vector("pose.pose.position", position)
            | _quaternion("pose.pose.orientation", turn)
            | _vector("twist.twist.linear", velocity)
            | _vector("twist.twist.angular", rates),
        ),
        Written(
            "/tf",
            "tf2_msgs/TFMessage",
            {"transforms": 1, "transforms[0].header.frame_id": MAP, "transforms[0].child_frame_id": BODY}
            | _vector("transforms[0].transform.translation", position)
            | _quaternion("transforms[0].transform.rotation", turn),
        ),
        Written(
            "/imu",
            "sensor_msgs/Imu",
            {"header.frame_id": BODY, "linear_acceleration_covariance": unknown}
            | _quaternion("orientation", turn)
            | _vector("angular_velocity", rates),
        ),
        Written(
            "/velocity",
            "geometry_msgs/TwistWithCovarianceStamped",
            {"header.frame_id": BODY} | _vector("twist.twist.linear", velocity) | _vector("twist.twist.angular", rates),
        ),
    ]
    if records.current is not None:
        current = _vector("vector", border.space_vector(records.current, axes))
        found.append(Written("/current", "geometry_msgs/Vector3Stamped", {"header.frame_id": MAP} | current))
    return found


def _actuators(records: VehicleRecords) -> list[Written]:
    found: list[tuple[str, np.ndarray]] = []
    for name, actuator in records.actuators.items():
        found.append((f"/actuator/{name}", actuator.actual))
        if actuator.command is not None:
            found.append((f"/command/{name}", actuator.command))
    found += [(f"/set/{name}", values) for name, (values, _) in records.set_points.items()]
    kinds = ("std_msgs/Float64", "std_msgs/Float64MultiArray")
    return [Written(topic, kinds[values.ndim > 1], {"data": values}) for topic, values in found]


def _vector(path: str, values: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{path}.{axis}": values[:, i] for i, axis in enumerate("xyz")}


def _quaternion(path: str, values: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{path}.{axis}": values[:, i] for i, axis in enumerate("wxyz")}
