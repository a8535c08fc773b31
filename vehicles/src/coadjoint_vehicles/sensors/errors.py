"""The errors of a sensor's channel, in the numbers of data sheets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from coadjoint import checks
from coadjoint import units as u
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError
from coadjoint.models.quantities import not_negative, positive
from coadjoint.units import Dimension, per_root

ALLAN_PEAK = 0.61736
"""The highest point of the Allan deviation of a Gauss–Markov process over its standard deviation, at 1.89 τ."""


class Channel(NamedTuple):
    """Components of a reading with one unit and one set of errors.

    name: that of the field with its errors. components: their names. dimension, unit: of the components. vector: a
    vector of the body (3,), which a misalignment turns. angle: angles, equal modulo 2π.
    """

    name: str
    components: tuple[str, ...]
    dimension: Dimension
    unit: str
    vector: bool = False
    angle: bool = False


@dataclass(frozen=True, kw_only=True)
class Errors:
    """The errors of a channel whose unit is U, each a standard deviation; missing values are 0.

        reading = (1 + s)·C·measured + b₀ + b(t) + w + n

    noise: of n, of one reading, U; or noise_density: N, U/√Hz, of which n has N√rate: white noise up to half the rate.
    turn_on_bias: of b₀, which is drawn once, U. bias_instability: B, U: the Allan deviation of the Gauss–Markov process
    b has its highest point B, at 1.89 bias_time (s), and b itself the deviation B/0.617. random_walk: K, U/√s, of w,
    which begins at 0 and has K√t. scale: of s, one for each component, drawn once. misalignment: rad, of the angles by
    which C turns a vector, drawn once. resolution: U, the step of the numbers that it gives. outlier: U, of the error
    added to the share of readings that are outliers. Each is a number of at least 0, or one for each component.
    """

    noise: Any = None
    noise_density: Any = None
    turn_on_bias: Any = None
    bias_instability: Any = None
    bias_time: Any = None
    random_walk: Any = None
    scale: Any = None
    misalignment: Any = None
    resolution: Any = None
    outlier: Any = None

    def of(self, name: str, size: int) -> np.ndarray:
        """One of the fields, (size,), 0 where it is left out."""
        value = getattr(self, name)
        return np.broadcast_to(np.asarray(0.0 if value is None else value, dtype=float), (size,))

    def white(self, rate: float, size: int) -> np.ndarray:
        """The standard deviation of n, (size,)."""
        return self.of("noise", size) + self.of("noise_density", size) * np.sqrt(rate)

    def wandering(self, size: int) -> np.ndarray:
        """The standard deviation of the Gauss–Markov process b, (size,)."""
        return self.of("bias_instability", size) / ALLAN_PEAK


def dimensions(channel: Channel) -> dict[str, Dimension]:
    """The dimensions of the fields of a channel's errors, by name."""
    own = channel.dimension
    return {
        **dict.fromkeys(("noise", "turn_on_bias", "bias_instability", "resolution", "outlier"), own),
        "noise_density": per_root(own, "Hz"),
        "bias_time": u.TIME,
        "random_walk": per_root(own, "s"),
        "scale": u.NUMBER,
        "misalignment": u.ANGLE,
    }


def checked(errors: object, channel: Channel, whose: str) -> Errors:
    """The errors of a channel as float64 numbers; raises ArgumentError, naming the field and `whose` it is."""
    checks.instance(errors, f"Argument `{channel.name}` of the {whose}", Errors, "Errors(…)")
    found: dict[str, PyTree] = {}
    for name in dimensions(channel):
        value = getattr(errors, name)
        if value is not None:
            found[name] = _checked(value, f"{channel.name}.{name}` of the {whose}", name, channel)
    if "noise" in found and "noise_density" in found:
        raise ArgumentError(
            f"Argument `{channel.name}` of the {whose} has `noise`, of one reading, and `noise_density`, which are the "
            "same error: give one of them."
        )
    if ("bias_instability" in found) != ("bias_time" in found):
        raise ArgumentError(
            f"Argument `{channel.name}` of the {whose} needs `bias_instability` and `bias_time` together: the height "
            "of the bias and how long it lasts."
        )
    if "misalignment" in found and not channel.vector:
        raise ArgumentError(
            f"Argument `{channel.name}.misalignment` of the {whose} turns vectors, but this channel is none: leave it "
            "out."
        )
    return Errors(**found)


def _checked(value: Any, title: str, name: str, channel: Channel) -> Any:
    check = positive if name == "bias_time" else not_negative
    if np.ndim(value) == 0 or name == "bias_time":
        return check(value, title.removesuffix("`"))
    size = 3 if name == "misalignment" else len(channel.components)
    checks.shape(value, f"Argument `{title}", (), (size,))
    return np.array([check(one, title.removesuffix("`")) for one in np.asarray(value)], dtype=float)
