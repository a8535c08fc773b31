"""Runs of vehicles as MCAP files, with messages of ROS 2 that Foxglove, Lichtblick and Rerun show."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.groups import attitude
from coadjoint.identification.channels import ATTITUDE, POSITION, RATES, VELOCITY
from coadjoint.identification.log import Log
from coadjoint.plotting.whole_file import whole_file
from coadjoint.vehicles import axes as border
from coadjoint.vehicles.axes import Axes, space_axes
from coadjoint.vehicles.logs.bags.converted import GRAVITY, WaterAbove, fixes
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


def write_mcap(
    dataset: xarray.Dataset,
    path: str | os.PathLike[str],
    *,
    axes: Axes = "ENU/FLU",
    origin: tuple[float, float] | None = None,
) -> None:
    """A run of a vehicle as an MCAP file, as `run.save("dive.mcap")` writes it; `dataset` is that of the run.

    Topics: `/odometry`, `/tf`, `/imu` (attitude and rates), `/velocity` over ground, `/pressure`, `/command/NAME` and
    `/actuator/NAME` of every actuator, `/set/NAME` of set points, `/current`, in SI units and rad, at the times of the
    records. axes: of the messages, "ENU/FLU" as in ROS or "NED/FRD". origin: latitude and longitude, °, of north and
    east 0; with it there is `/fix`, which tells where the vehicle is even below the surface.
    Raises ArgumentError for a run of what is no vehicle, FileError where the file cannot be written.
    """
    content = mcap_bytes(dataset, axes, origin)
    with whole_file(path) as temporary:
        temporary.write_bytes(content)


def mcap_bytes(dataset: xarray.Dataset, axes: str = "ENU/FLU", origin: tuple[float, float] | None = None) -> bytes:
    """The content of such a file; raises ArgumentError."""
    known_axes = cast(Axes, axes)
    space_axes(known_axes)
    records = VehicleRecords(dataset)
    body = (records.position, records.directions, records.velocity, records.rates)
    rows = [*_motion(*body, known_axes), *_actuators(records)]
    if records.current is not None:
        current = _vector("vector", border.space_vector(records.current, known_axes))
        rows.append(Written("/current", "geometry_msgs/Vector3Stamped", {"header.frame_id": MAP} | current))
    if origin is not None:
        latitude, longitude = fixes(records.position, origin)
        fix = {"header.frame_id": BODY, "latitude": latitude, "longitude": longitude, "altitude": -records.depth}
        rows.append(Written("/fix", "sensor_msgs/NavSatFix", fix))
    return _content(rows, records.time, _facts(dataset, records, axes))


def log_bytes(log: Log, axes: Axes = "ENU/FLU") -> bytes:
    """The content of an MCAP file of a measured log, NaN where sensors were silent; raises ArgumentError.

    Its columns are in `/odometry`, an attitude where roll, pitch and heading are told; its inputs in `/command/NAME`,
    what actuators did in `/actuator/NAME`.
    """
    silent = np.full(len(log), np.nan)
    position, angles, velocity, rates = (
        np.stack([log.columns.get(name, silent) for name in names], axis=1)
        for names in (POSITION, ATTITUDE, VELOCITY, RATES)
    )
    directions = np.full((len(log), 3, 3), np.nan)
    told = np.isfinite(angles).all(axis=1)
    directions[told] = np.asarray(attitude.zyx(*angles[told].T[::-1]))
    rows = _motion(position, directions, velocity, rates, axes)[:1]
    both = [*(("command", *pair) for pair in log.inputs.items()), *(("actuator", *pair) for pair in log.actual.items())]
    rows += [_number(f"/{what}/{name}", values) for what, name, values in both]
    facts = {"axes": axes} | ({} if log.step is None else {"dt_s": repr(log.step)})
    facts |= {f"unit.{name}": log.units.get(name, "1") for name in log.inputs}
    return _content(rows, log.time, facts)


def _content(rows: list[Written], time: np.ndarray, facts: dict[str, str]) -> bytes:
    """The content of a file; raises ArgumentError for times that ROS cannot say."""
    writer = library("mcap.writer", "Writing MCAP")
    stamps = np.rint(time * 1e9).astype(np.int64)
    if len(stamps) and (stamps[0] < 0 or stamps[-1] >= 2**31 * 10**9 or np.any(np.diff(stamps) <= 0)):
        raise ArgumentError("A run is written to MCAP at times from 0 on, at least 1 ns apart: begin it at 0.")
    content = io.BytesIO()
    to = writer.Writer(content, chunk_size=_CHUNK)
    to.start(profile="ros2", library="coadjoint")
    to.add_metadata(OWN, facts)
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


def _motion(
    place: np.ndarray, directions: np.ndarray, velocity: np.ndarray, rates: np.ndarray, axes: Axes
) -> list[Written]:
    """Pose and velocities; `place` and `directions` in north, east, down."""
    water = WaterAbove()
    pressure = water.surface + water.density * GRAVITY * place[:, 2]
    position = _signed(place, border.space_axes(axes))
    turn = _quaternions(directions, axes)
    velocity, rates = (_signed(v, border.body_axes(axes)) for v in (velocity, rates))
    unknown = np.r_[-1.0, np.zeros(8)]
    return [
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
        Written("/pressure", "sensor_msgs/FluidPressure", {"header.frame_id": BODY, "fluid_pressure": pressure}),
    ]


def _actuators(records: VehicleRecords) -> list[Written]:
    found: list[tuple[str, np.ndarray]] = []
    for name, actuator in records.actuators.items():
        found.append((f"/actuator/{name}", actuator.actual))
        if actuator.command is not None:
            found.append((f"/command/{name}", actuator.command))
    found += [(f"/set/{name}", values) for name, (values, _) in records.set_points.items()]
    return [_number(topic, values) for topic, values in found]


def _number(topic: str, values: np.ndarray) -> Written:
    kinds = ("std_msgs/Float64", "std_msgs/Float64MultiArray")
    return Written(topic, kinds[values.ndim > 1], {"data": values})


def _signed(vectors: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Vectors by a matrix that permutes axes and changes signs; a component that is missing leaves the others alone."""
    source = np.argmax(np.abs(turn), axis=0)
    return vectors[:, source] * turn[source, np.arange(3)]


def _quaternions(directions: np.ndarray, axes: Axes) -> np.ndarray:
    """(n, 4), NaN where an attitude is missing."""
    found = np.full((len(directions), 4), np.nan)
    good = np.isfinite(directions).all(axis=(1, 2))
    if good.any():
        found[good] = attitude.to_quaternion(border.rotation(directions[good], axes))
    return found


def _vector(path: str, values: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{path}.{axis}": values[:, i] for i, axis in enumerate("xyz")}


def _quaternion(path: str, values: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{path}.{axis}": values[:, i] for i, axis in enumerate("wxyz")}
