"""Readings of a run as messages of ROS 2: stamped at the time of measurement, logged at the time of arrival."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from coadjoint.groups import attitude
from coadjoint.texts import Table
from coadjoint_vehicles import axes as border
from coadjoint_vehicles.axes import Axes
from coadjoint_vehicles.files.kinds import kinds
from coadjoint_vehicles.logs.bags.converted import GRAVITY, WaterAbove, fixes
from coadjoint_vehicles.logs.bags.schemas import PACKAGE, stamped
from coadjoint_vehicles.logs.bags.written import Written, quaternion, quaternions, signed, vector
from coadjoint_vehicles.sensors.message import Message
from coadjoint_vehicles.sensors.sensor import Sensor

if TYPE_CHECKING:
    from coadjoint.labelled import AnyDataset

FOLDER = "/sensors/"
"""The prefix of the topics of sensors."""
_PREFIX = "sensor_"
_UNKNOWN = np.r_[-1.0, np.zeros(8)]


def sensor_rows(
    dataset: AnyDataset, axes: Axes, origin: tuple[float, float] | None, water: WaterAbove
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
        message = declared(kind)
        if message is None:
            type_, body, values = _own(name, kind, channels)
        else:
            (type_, values), body = _Writer(axes, origin, water).message(message, numbers), None
        time, arrival = np.asarray(dataset[key].values), np.asarray(dataset[text].values)
        found.append(Written(f"{FOLDER}{name}", type_, {"header.frame_id": name} | values, time, arrival, body))
    return found


def mounts(dataset: AnyDataset) -> dict[str, str]:
    """Where sensors sit: "position.NAME", m, and "euler_zyx.NAME", rad, as texts, of those that are not at O."""
    found = {}
    for values in dataset.data_vars.values():
        name = str(values.dims[0])[len(_PREFIX) : -len("_time")] if values.dims else ""
        for key in ("position", "euler_zyx"):
            place = values.attrs.get(key)
            if place is not None and np.any(np.asarray(place) != 0):
                found[f"{key}.{name}"] = " ".join(repr(float(x)) for x in np.ravel(place))
    return found


def declared(kind: str) -> Message | None:
    """The message that sensors of a kind declare, the library's or a user's; None if they declare none."""
    known = kinds("sensors")
    if kind in known:
        return known[kind].message
    pending: list[type[Sensor]] = [Sensor]
    while pending:
        one = pending.pop()
        if kind and one.kind == kind:
            return one.message
        pending += one.__subclasses__()
    return None


class _Writer(NamedTuple):
    """The numbers of channels in a message: in these axes, about this origin, under this water."""

    axes: Axes
    origin: tuple[float, float] | None
    water: WaterAbove

    def vector(self, path: str, along: np.ndarray) -> Table:
        return vector(path, signed(along, border.body_axes(self.axes)))

    def attitude(self, path: str, tilt: np.ndarray, heading: np.ndarray) -> Table:
        (roll, pitch), yaw = tilt.T, heading[:, 0]
        return quaternion(path, quaternions(np.asarray(attitude.zyx(yaw, pitch, roll)), self.axes))

    def pressure(self, path: str, depth: np.ndarray) -> dict[str, object]:
        return {path: self.water.surface + self.water.density * GRAVITY * depth[:, 0]}

    def fix(self, path: str, place: np.ndarray) -> dict[str, object]:
        """Latitude and longitude where an origin is known."""
        assert self.origin is not None
        latitude, longitude = fixes(np.pad(place, ((0, 0), (0, 1))), self.origin)
        return {"latitude": latitude, "longitude": longitude}

    def place(self, place: np.ndarray) -> tuple[str, Table]:
        """A position with no attitude, where no origin is known."""
        unknown, gone = np.full((len(place), 4), np.nan), np.full((len(place), 1), np.nan)
        along = signed(np.concatenate([place, gone], axis=1), border.space_axes(self.axes))
        return "geometry_msgs/PoseWithCovarianceStamped", {
            "header.frame_id": "map",
            **vector("pose.pose.position", along),
            **quaternion("pose.pose.orientation", unknown),
        }

    def message(self, message: Message, numbers: Mapping[str, np.ndarray]) -> tuple[str, Table]:
        """Type and fields of a sensor's message."""
        found: Table = dict.fromkeys(message.unknown, _UNKNOWN)
        found |= {f"{path}.{axis}": np.nan for path in message.silent for axis in "xyz"}
        for field in message.fields:
            channels = [numbers[name] for name in field.channels]
            if field.as_ == "fix" and self.origin is None:
                return self.place(*channels)
            found |= getattr(self, field.as_)(field.path, *channels)
        return message.type, found


def _own(name: str, kind: str, channels: Mapping[str, object]) -> tuple[str, str, Table]:
    """Type, definition and fields of a sensor that declares no message: its numbers by their names."""
    parts = [(str(one), column) for values in channels.values() for one, column in _columns(values)]
    fields = {_word(one, f"value_{place}"): column for place, (one, column) in enumerate(parts)}
    if len(fields) < len(parts):
        fields = {f"value_{place}": column for place, (_, column) in enumerate(parts)}
    title = "".join(part.capitalize() for part in _word(kind or name, "sensor").split("_"))
    return f"{PACKAGE}/{title}", stamped(fields), fields


def _columns(values: Any) -> list[tuple[str, np.ndarray]]:
    names = values[values.dims[1]].values
    return list(zip(names, np.asarray(values.values, float).T, strict=True))


def _word(text: str, other: str) -> str:
    """A word that ROS takes for the name of a field: small letters, numbers and single underscores."""
    found = re.sub("[^a-z0-9]+", "_", text.lower()).strip("_")
    return found if found[:1].isalpha() else other
