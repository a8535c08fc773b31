"""A sensor: a pure function of the motion, with a place on the vehicle, a rate, and errors."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint import units as u
from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.extending import evaluate
from coadjoint.groups import SO2
from coadjoint.models.quantities import not_negative, number, positive, vector
from coadjoint.spaces import Named
from coadjoint.spaces.measured import MeasuredSpace
from coadjoint.spaces.measured_spaces import measured_space
from coadjoint_vehicles.axes import body_axes
from coadjoint_vehicles.parts.measured import Measured, angle_within, check_fields, measured, place, share
from coadjoint_vehicles.parts.numbers import Numbers
from coadjoint_vehicles.sensors.errors import Channel, Errors, checked
from coadjoint_vehicles.sensors.kinematics import Kinematics
from coadjoint_vehicles.sensors.message import Message


def _pose(value: object, name: str) -> PyTree:
    return angle_within(2 * np.pi, "a turn, 2π")(vector(value, name), name)


def tilt(value: object, name: str) -> PyTree:
    """A positive angle of at most π, rad; raises ArgumentError."""
    return angle_within(np.pi, "half a turn, π")(positive(value, name), name)


def turn(value: object, name: str) -> PyTree:
    """One angle of at most a turn, rad; raises ArgumentError."""
    return angle_within(2 * np.pi, "a turn, 2π")(number(value, name), name)


def _turned_pose(value: object, axes: PyTree) -> Array:
    """Yaw, pitch and roll from the body's axes, where both, the sensor's and the body's, are other ones."""
    yaw_pitch_roll = np.asarray(value, dtype=float)
    if yaw_pitch_roll.shape != (3,):
        raise ArgumentError(f"Yaw, pitch and roll are three numbers, but there is the shape {yaw_pitch_roll.shape}.")
    return yaw_pitch_roll @ np.diag(np.diag(body_axes(axes))[::-1])


@dataclass(frozen=True, eq=False, kw_only=True)
class Sensor(Numbers, ABC):
    """A sensor of a vehicle: its error-free reading is a pure function of the motion, traced by JAX.

    name: a word, unique on a vehicle. rate: readings in a second, 1/s; the k-th is taken k/rate after it is switched
    on. latency: s from the time of a reading until it is there. position: r in the body, (3,) m. euler_zyx: yaw, pitch
    and roll of its axes in those of the body, (3,) rad. dropout: the share of readings that never come. outliers: the
    share of those that come with the error `outlier` of their channel. Fields that hold numbers are its parameters:
    `measured(motion, own)` takes others. Raises ArgumentError for impossible values.
    """

    kind: ClassVar[str] = ""
    """Its word in vehicle files."""
    channels: ClassVar[tuple[Channel, ...]] = ()
    """Its channels, in the order of a reading."""
    message: ClassVar[Message | None] = None
    """Its message in logs of ROS 2; None for a custom message, which has its numbers by their names."""
    required: ClassVar[tuple[str, ...]] = ()
    """Fields of the motion that may be None and without which it cannot read, such as the depth of the `bottom`."""
    name: str
    rate: Measured = measured(u.FREQUENCY, positive)
    latency: Measured = measured(u.TIME, not_negative, default=0.0)
    position: Measured = place(default=(0.0, 0.0, 0.0))
    euler_zyx: Measured = measured(u.ANGLE, _pose, turn=_turned_pose, default=(0.0, 0.0, 0.0))
    dropout: Measured = measured(u.NUMBER, share, default=0.0)
    outliers: Measured = measured(u.NUMBER, share, default=0.0)

    def __post_init__(self) -> None:
        fits = isinstance(self.name, str) and self.name.isidentifier()
        checks.expect(fits, self.name, "The name of a sensor", "a word such as 'imu'")
        check_fields(self, self.title)
        lowest, highest = (getattr(self, name, None) for name in ("lowest", "highest"))
        if lowest is not None and highest is not None and not lowest < highest:
            raise ArgumentError(
                f"Argument `lowest` of the {self.title}` must be below `highest`, {float(highest):g} m, but is "
                f"{float(lowest):g} m: so it would never read."
            )
        for channel in self.channels:
            object.__setattr__(self, channel.name, checked(self.errors(channel), channel, f"{self.title}`"))

    @property
    def title(self) -> str:
        """Its description in messages, without the closing quote."""
        return f"sensor `{self.name}"

    def errors(self, channel: Channel) -> Errors:
        """The errors of one of its channels."""
        return getattr(self, channel.name)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the m numbers of a reading."""
        return tuple(name for channel in self.channels for name in channel.components)

    @property
    def units(self) -> tuple[str, ...]:
        """The units of the m numbers of a reading."""
        return tuple(channel.unit for channel in self.channels for _ in channel.components)

    @property
    def size(self) -> int:
        """m, how many numbers a reading has."""
        return len(self.names)

    @property
    def space(self) -> PyTree:
        """The space of a reading as of `co.estimation.Measurement`, of several channels a tuple of theirs."""
        found = [SO2() if channel.angle else None for channel in self.channels]
        return tuple(found) if len(found) > 1 else found[0]

    @property
    def coordinates(self) -> PyTree:
        """What its numbers are in the space, as of `co.estimation.Measurement`."""
        return None

    def value(self, motion: Kinematics, own: Named) -> PyTree:
        """Its error-free reading as a value of `space`; jax.numpy only."""
        return self._split(self.reading(motion, own))

    def _split(self, reading: Array) -> PyTree:
        ends = np.cumsum([0, *(len(channel.components) for channel in self.channels)]).tolist()
        found = [reading[a:b] for a, b in pairwise(ends)]
        return tuple(found) if len(found) > 1 else found[0]

    def errors_in(self) -> MeasuredSpace:
        """The space of its readings with their errors: of an attitude in its axes, of a direction on the sphere."""
        return measured_space(self.space, self._shapes(), "body", self.coordinates, f"the {self.title}`")

    def _shapes(self) -> PyTree:
        """A value like those of the space."""
        return self._split(np.zeros(self.size))

    @property
    def deviation(self) -> np.ndarray:
        """The standard deviations of the white noise of one reading, (m,), with that of rounding, resolution/√12."""
        found = []
        for channel in self.channels:
            errors, size = self.errors(channel), len(channel.components)
            found.append(np.hypot(errors.white(float(self.rate), size), errors.of("resolution", size) / np.sqrt(12)))
        return np.concatenate(found)

    @property
    def covariance(self) -> np.ndarray:
        """The covariance of the white noise of one reading, (m, m); biases and outliers are not in it."""
        return np.diag(self.deviation**2)

    def measured(self, motion: Kinematics, own: PyTree = None) -> Array:
        """Its error-free reading of a motion, (m,) in `units`; differentiable, and traced inside jit and grad.

        own: its numbers, by name as `parameters()` gives them; by default those that it has. Raises ArgumentError for a
        motion without the fields that it reads.
        """
        return self._evaluated(self.reading, motion, own)

    def available(self, motion: Kinematics, own: PyTree = None) -> Array:
        """Whether it reads at all in a motion, one truth value: whether that is within its limits."""
        return self._evaluated(self.within, motion, own)

    def _evaluated(self, function: Any, motion: Any, own: PyTree) -> PyTree:
        checks.instance(motion, "motion", Kinematics, "Kinematics(…)")
        own = Named(**self.parameters()) if own is None else own
        own = Named(**own) if isinstance(own, dict) else own
        return evaluate(lambda motion, own: function(_as_arrays(motion), own), motion, own)

    def residual(self, reading: object, expected: object) -> Array:
        """The error e (m,) of a reading from the expected one, both (m,): their difference, of angles by the shorter
        way; of an attitude log(R⁻¹R_read), and of a direction the way to it on the sphere. Raises ArgumentError for
        other shapes."""
        space = self.errors_in()
        given = vector(reading, "reading", self.size), vector(expected, "expected", self.size)
        return evaluate(lambda y, h: -space.difference(space.value(h), y), *given)

    @abstractmethod
    def reading(self, motion: Kinematics, own: Named) -> Array:
        """Its reading, (m,), of a motion and with its numbers; jax.numpy only."""

    def within(self, motion: Kinematics, own: Named) -> Array:
        """Whether the motion is within its limits; jax.numpy only."""
        return jnp.asarray(True)


def needs(motion: Kinematics, name: str, who: str) -> PyTree:
    """A field of the motion that may be None; raises ArgumentError."""
    value = getattr(motion, name)
    if value is None:
        raise ArgumentError(f"The {who} needs `{name}` of the motion, but it has none: give Kinematics({name}=…).")
    return value


def different(sensors: Sequence[PyTree]) -> tuple[Sensor, ...]:
    """Sensors with names of their own; raises ArgumentError."""
    names: set[str] = set()
    for one in sensors:
        checks.instance(one, "Each of `sensors`", Sensor, "a sensor such as Imu or Depth")
        if one.name in names:
            raise ArgumentError(f"Two sensors are named `{one.name}`: give each its own name.")
        names.add(one.name)
    return tuple(sensors)


def _as_arrays(motion: Kinematics) -> Kinematics:
    return Kinematics(*(None if value is None else jnp.asarray(value, dtype=float) for value in motion))


def along_beams(directions: object, vector: Array) -> Array:
    """The components of a vector (3,) along unit vectors (k, 3)."""
    return jax.vmap(lambda direction: direction @ vector)(jnp.asarray(directions))
