"""Runs of vehicles as MCAP files, with messages of ROS 2 that Foxglove, Lichtblick and Rerun show."""

from __future__ import annotations

import io
import os
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from coadjoint.disk import atomic_file
from coadjoint.errors import ArgumentError
from coadjoint.groups import attitude
from coadjoint.identification import Log
from coadjoint.identification.channels import ATTITUDE, POSITION, RATES, VELOCITY
from coadjoint.models.quantities import not_negative, positive
from coadjoint_vehicles import axes as border
from coadjoint_vehicles.axes import Axes, space_axes
from coadjoint_vehicles.logs.bags.converted import GRAVITY, WaterAbove, fixes
from coadjoint_vehicles.logs.bags.optional import library
from coadjoint_vehicles.logs.bags.schemas import known, schema
from coadjoint_vehicles.logs.bags.sensor_messages import mounts, sensor_rows
from coadjoint_vehicles.logs.bags.sensors import CURRENT
from coadjoint_vehicles.logs.bags.serializing import serialized
from coadjoint_vehicles.logs.bags.written import Written, quaternion, quaternions, signed, vector
from coadjoint_vehicles.logs.records import VehicleRecords

if TYPE_CHECKING:
    from coadjoint.labelled import AnyDataset

OWN = "coadjoint"
"""The name of the metadata: the axes, the step and the units of commands."""
MAP, BODY = "map", "base_link"
"""The frames of messages, as ROS names them (REP 105)."""
_CHUNK = 4_000_000
LATEST = 2.0**31
"""s; stamps of ROS hold times below this."""


def write_mcap(
    dataset: AnyDataset,
    path: str | os.PathLike[str],
    *,
    axes: Axes = "ENU/FLU",
    origin: tuple[float, float] | None = None,
    density: float = 1025.0,
    surface_pressure: float = 101325.0,
) -> None:
    """A run of a vehicle as an MCAP file, as `run.save("dive.mcap")` writes it; `dataset` is that of the run.

    Topics: `/odometry`, `/tf`, `/imu` (attitude and rates), `/velocity` over ground, `/pressure`, `/command/NAME` and
    `/actuator/NAME` of every actuator, `/set/NAME` of set points, `/current`, in SI units and rad, at the times of the
    records; `/sensors/NAME` of readings, stamped at the time of measurement and logged at the time of arrival.
    axes: of the messages, "ENU/FLU" as in ROS or "NED/FRD". origin: latitude and longitude, °, of north and east 0;
    with it there is `/fix`, the vehicle's position, even below the surface. density: of the water, kg/m³, and
    surface_pressure, Pa, by which depths become pressures; the file keeps both for its reader.
    Raises ArgumentError for invalid water, and for a run without a vehicle, FileError if the file cannot be written.
    """
    content = mcap_bytes(dataset, axes, origin, density, surface_pressure)
    with atomic_file(path) as temporary:
        temporary.write_bytes(content)


def mcap_bytes(
    dataset: AnyDataset,
    axes: str = "ENU/FLU",
    origin: tuple[float, float] | None = None,
    density: float = 1025.0,
    surface_pressure: float = 101325.0,
) -> bytes:
    """The content of such a file; raises ArgumentError."""
    known_axes = cast(Axes, axes)
    space_axes(known_axes)
    records = VehicleRecords(dataset)
    body = (records.position, records.directions, records.velocity, records.rates)
    water = WaterAbove(not_negative(surface_pressure, "surface_pressure"), positive(density, "density"))
    rows = [*_motion(*body, known_axes, water), *_actuators(records)]
    if records.current is not None:
        rows.append(_current(records.current, known_axes))
    if origin is not None:
        latitude, longitude = fixes(records.position, origin)
        fix = {"header.frame_id": BODY, "latitude": latitude, "longitude": longitude, "altitude": -records.depth}
        rows.append(Written("/fix", "sensor_msgs/NavSatFix", fix))
    rows += sensor_rows(dataset, known_axes, origin, water)
    facts = {"density_kg_m3": repr(float(water.density)), "surface_pressure_pa": repr(float(water.surface))}
    return _content(rows, records.time, _facts(dataset, records, axes) | facts | mounts(dataset))


def log_bytes(log: Log, axes: Axes = "ENU/FLU") -> bytes:
    """The content of an MCAP file of a measured log, NaN where sensors were silent; raises ArgumentError.

    Its columns are in `/odometry`, an attitude if roll, pitch and heading are known; its inputs in `/command/NAME`, the
    actual values of actuators in `/actuator/NAME`.
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
    if log.current:
        water = np.stack([log.current.get(name, silent) for name in ("north", "east", "down")], axis=1)
        rows.append(_current(water, axes))
    facts = {"axes": axes} | ({} if log.step is None else {"dt_s": repr(log.step)})
    facts |= {f"unit.{name}": log.units.get(name, "1") for name in log.inputs}
    return _content(rows, log.time, facts)


def _current(velocity: np.ndarray, axes: Axes) -> Written:
    """The velocity of the water, (nodes, 3) m/s along north, east and down."""
    return Written(*CURRENT, {"header.frame_id": MAP} | vector("vector", border.space_vector(velocity, axes)))


def _content(rows: list[Written], time: np.ndarray, facts: dict[str, str]) -> bytes:
    """The content of a file; raises ArgumentError for times that ROS cannot say."""
    writer = library("mcap.writer", "Writing MCAP")
    stamps = np.rint(time * 1e9).astype(np.int64)
    if len(stamps) and (stamps[0] < 0 or stamps[-1] >= LATEST * 1e9 or np.any(np.diff(stamps) <= 0)):
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
    logged: list[np.ndarray] = []
    schemas: dict[tuple[str, str | None], int] = {}
    channels: list[int] = []
    contents: list[list[bytes]] = []
    for row in rows:
        package, name = row.type.split("/")
        if (kind := (row.type, row.body)) not in schemas:
            text = schema(*kind).encode()
            schemas[kind] = to.register_schema(f"{package}/msg/{name}", "ros2msg", text)
        channels.append(to.register_channel(row.topic, "cdr", schemas[kind]))
        if row.logged is not None and np.max(row.logged, initial=0.0) >= LATEST:
            raise ArgumentError(
                f"Messages of {row.topic} are there up to {np.max(row.logged):.3g} s, but MCAP is written up to "
                f"{LATEST:.3g} s: give the sensor a shorter `latency`, in seconds."
            )
        own = stamps if row.time is None else np.rint(row.time * 1e9).astype(np.int64)
        logged.append(own if row.logged is None else np.rint(row.logged * 1e9).astype(np.int64))
        seconds = {"sec": own // 1_000_000_000, "nanosec": own % 1_000_000_000}
        stamped = {
            f"{head}.stamp.{part}": n for head in ("header", "transforms[0].header") for part, n in seconds.items()
        }
        contents.append(serialized(known(row.type, row.body), len(own), {**stamped, **row.values}))
    times = np.concatenate([np.zeros(0, np.int64), *logged])
    which = np.repeat(np.arange(len(rows)), [len(one) for one in logged])
    number = np.concatenate([np.zeros(0, int), *(np.arange(len(one)) for one in logged)])
    for at in np.argsort(times, kind="stable").tolist():
        row, k, time = int(which[at]), int(number[at]), int(times[at])
        to.add_message(channels[row], time, contents[row][k], time, k)


def _facts(dataset: AnyDataset, records: VehicleRecords, axes: str) -> dict[str, str]:
    found = {"axes": axes, "system": str(dataset.attrs.get("system", ""))}
    if "dt" in dataset.attrs:
        found["dt_s"] = repr(float(dataset.attrs["dt"]))
    units = {name: actuator.unit for name, actuator in records.actuators.items()}
    units |= {name: unit for name, (_, unit) in records.set_points.items()}
    return found | {f"unit.{name}": unit for name, unit in units.items()}


def _motion(
    place: np.ndarray,
    directions: np.ndarray,
    velocity: np.ndarray,
    rates: np.ndarray,
    axes: Axes,
    water: WaterAbove | None = None,
) -> list[Written]:
    """Pose and velocities; `place` and `directions` in north, east, down."""
    water = WaterAbove() if water is None else water
    pressure = water.surface + water.density * GRAVITY * place[:, 2]
    position = signed(place, border.space_axes(axes))
    turn = quaternions(directions, axes)
    velocity, rates = (signed(v, border.body_axes(axes)) for v in (velocity, rates))
    unknown = np.r_[-1.0, np.zeros(8)]
    return [
        Written(
            "/odometry",
            "nav_msgs/Odometry",
            {"header.frame_id": MAP, "child_frame_id": BODY}
            | vector("pose.pose.position", position)
            | quaternion("pose.pose.orientation", turn)
            | vector("twist.twist.linear", velocity)
            | vector("twist.twist.angular", rates),
        ),
        Written(
            "/tf",
            "tf2_msgs/TFMessage",
            {"transforms": 1, "transforms[0].header.frame_id": MAP, "transforms[0].child_frame_id": BODY}
            | vector("transforms[0].transform.translation", position)
            | quaternion("transforms[0].transform.rotation", turn),
        ),
        Written(
            "/imu",
            "sensor_msgs/Imu",
            {"header.frame_id": BODY, "linear_acceleration_covariance": unknown}
            | quaternion("orientation", turn)
            | vector("angular_velocity", rates),
        ),
        Written(
            "/velocity",
            "geometry_msgs/TwistWithCovarianceStamped",
            {"header.frame_id": BODY} | vector("twist.twist.linear", velocity) | vector("twist.twist.angular", rates),
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
