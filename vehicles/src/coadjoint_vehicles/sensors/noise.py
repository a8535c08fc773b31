"""The errors of a sensor's readings, one after the other, from a seed: bitwise identical for any number of readings."""

from __future__ import annotations

from typing import NamedTuple
from zlib import crc32

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, shown
from coadjoint.extending import evaluate
from coadjoint.groups import attitude
from coadjoint_vehicles.sensors.errors import Channel, Errors
from coadjoint_vehicles.sensors.sensor import Sensor

PURPOSES = ("once", "white", "wander", "walk", "dropout", "outliers", "outlier")
"""Each has independent random numbers, so that leaving it out or changing it does not change the others."""


class Drawn(NamedTuple):
    """Readings with their errors, (k, m), and which of them never come, (k,) of bool."""

    values: np.ndarray
    lost: np.ndarray


class Noise:
    """The errors of the readings of one sensor, in their order.

    sensor: whose. seed: an integer ≥ 0; sensors with different names have independent numbers of one seed. The
    numbers are those of NumPy's PCG64 with a SeedSequence of the seed and the name. Raises ArgumentError.
    """

    def __init__(self, sensor: Sensor, seed: int):
        checks.whole(seed, "seed", 0)
        self.sensor, self.count = sensor, 0
        key = crc32(sensor.name.encode())
        drawing = {
            purpose: np.random.Generator(np.random.PCG64(np.random.SeedSequence(int(seed), spawn_key=(key, place))))
            for place, purpose in enumerate(PURPOSES)
        }
        self._random = drawing
        self._channels = [
            _Channel(channel, sensor.errors(channel), float(sensor.rate), drawing) for channel in sensor.channels
        ]

    def read(self, exact: PyTree) -> Drawn:
        """The next k readings, (k, m): the error-free readings `exact`, (k, m), plus their errors.

        Raises ArgumentError for other shapes and for numbers that are not finite.
        """
        try:
            exact = np.asarray(exact, dtype=float)
        except (TypeError, ValueError):
            raise ArgumentError(f"Argument `exact` must be readings as numbers, but is {shown(exact)}.") from None
        if exact.ndim != 2 or exact.shape[1] != self.sensor.size:
            raise ArgumentError(
                f"Argument `exact` must be readings of {', '.join(self.sensor.names)}, (k, {self.sensor.size}), but "
                f"has the shape {exact.shape}."
            )
        if len(bad := np.flatnonzero(~np.all(np.isfinite(exact), axis=1))):
            raise ArgumentError(
                f"Argument `exact` must be finite readings of `{self.sensor.name}`, but number {bad[0] + 1} of "
                f"{len(exact)} is {exact[bad[0]].tolist()}: give 0 in place of what it does not read, and leave that "
                "reading out behind."
            )
        count, found, begin = len(exact), [], 0
        white, wander, walk, outlier = (
            self._random[name].standard_normal(exact.shape) for name in ("white", "wander", "walk", "outlier")
        )
        lost = self._random["dropout"].random(count) < float(self.sensor.dropout)
        wild = self._random["outliers"].random(count) < float(self.sensor.outliers)
        for one in self._channels:
            columns = slice(begin, begin + one.size)
            numbers = [drawn[:, columns] for drawn in (white, wander, walk)]
            added = np.where(wild[:, None], one.outlier * outlier[:, columns], 0.0)
            found.append(one.read(exact[:, columns], numbers, added, self.count))
            begin += one.size
        self.count += count
        return Drawn(self._composed(exact, np.concatenate(found, axis=1)), lost)

    def _composed(self, exact: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Readings with their errors, where these are not those of each number, as in an attitude or a direction."""
        if self.sensor.coordinates is None or not len(exact):
            return values
        space, off = self.sensor.errors_in(), values - exact
        e = np.where(space.angles, off - 2 * np.pi * np.floor(off / (2 * np.pi) + 0.5), off)
        composed = jax.vmap(lambda y, e: space.numbers(space.moved(space.value(y), e)))
        return np.asarray(evaluate(composed, exact, e))


class _Channel:
    """The errors of a channel: those drawn once, and the current values of its biases."""

    def __init__(self, channel: Channel, errors: Errors, rate: float, drawing: dict[str, np.random.Generator]):
        self.channel, self.errors, self.size = channel, errors, len(channel.components)
        once = drawing["once"]
        of = {
            name: errors.of(name, self.size)
            for name in ("turn_on_bias", "scale", "resolution", "outlier", "random_walk")
        }
        self.bias = of["turn_on_bias"] * once.standard_normal(self.size)
        self.scale = 1.0 + of["scale"] * once.standard_normal(self.size)
        self.turn = self._turn(once.standard_normal(3))
        self.white = errors.white(rate, self.size)
        self.wandering = errors.wandering(self.size)
        self.kept = 0.0 if errors.bias_time is None else float(np.exp(-1 / (rate * errors.bias_time)))
        self.walking = of["random_walk"] / np.sqrt(rate)
        self.resolution, self.outlier = of["resolution"], of["outlier"]
        self.wander, self.walk = np.zeros(self.size), np.zeros(self.size)

    def _turn(self, normal: np.ndarray) -> np.ndarray | None:
        """C, (3, 3): by small angles about each axis; None without a misalignment."""
        if self.errors.misalignment is None:
            return None
        return attitude.from_rotation_vector(self.errors.of("misalignment", 3) * normal).T

    def read(self, exact: np.ndarray, normal: list[np.ndarray], added: np.ndarray, before: int) -> np.ndarray:
        """The readings (k, size), of which there were `before`; normal: numbers for n, b and w. added: outliers."""
        if not len(exact):
            return exact
        white, wander, walk = normal
        turned = exact if self.turn is None else np.sum(self.turn * exact[:, None, :], axis=-1)
        value = self.scale * turned + self.bias + self._wandered(wander, before) + self._walked(walk, before)
        value = value + self.white * white + added
        step = np.where(self.resolution > 0, self.resolution, 1.0)
        value = np.where(self.resolution > 0, step * np.round(value / step), value)
        return value - 2 * np.pi * np.floor(value / (2 * np.pi) + 0.5) if self.channel.angle else value

    def _wandered(self, normal: np.ndarray, before: int) -> np.ndarray:
        """b_0 = σζ_0, b_k = φ b_{k−1} + σ√(1 − φ²) ζ_k, the exact law of the Gauss–Markov process."""
        from scipy.signal import lfilter  # its import takes a tenth of the set-up time

        driven = self.wandering * np.sqrt(1 - self.kept**2) * normal
        if before == 0:
            driven[0] = self.wandering * normal[0]
        found, _ = lfilter([1.0], [1.0, -self.kept], driven, axis=0, zi=self.kept * self.wander[None])
        self.wander = found[-1]
        return found

    def _walked(self, normal: np.ndarray, before: int) -> np.ndarray:
        """w_0 = 0, w_k = w_{k−1} + K√Δ ζ_k."""
        moved = self.walking * normal
        if before == 0:
            moved[0] = 0.0
        found = np.cumsum(np.concatenate([self.walk[None], moved]), axis=0)[1:]
        self.walk = found[-1]
        return found
