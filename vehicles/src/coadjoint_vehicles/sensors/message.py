"""The places of a sensor's readings in a message of ROS 2."""

from __future__ import annotations

from typing import Literal, NamedTuple

As = Literal["vector", "attitude", "pressure", "fix"]


class MessageField(NamedTuple):
    """The place of channels in a message: `path` of the field, `as_` the name of its writer.

    channels: their names. "vector": one channel along the axes of the sensor. "attitude": roll and pitch, and heading,
    as a quaternion. "pressure": a depth, as that of the water there. "fix": north and east of a satellite's fix.
    """

    path: str
    as_: As
    channels: tuple[str, ...]


class Message(NamedTuple):
    """The message of a sensor: the type, `pkg/Name`, and its fields; unmeasured fields are marked as in ROS.

    unknown: covariances whose first number, −1, says that the field is not measured. silent: vectors that are NaN.
    A sensor without one sends a custom message, with its numbers by their names in SI units and rad.
    """

    type: str
    fields: tuple[MessageField, ...]
    unknown: tuple[str, ...] = ()
    silent: tuple[str, ...] = ()
