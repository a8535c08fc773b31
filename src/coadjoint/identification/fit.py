"""The least-squares problem of a log: residuals over their noise, and their derivatives by all unknowns."""

from __future__ import annotations

from typing import Any

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.identification import rotations
from coadjoint.identification.coloured import neighbours, whitened
from coadjoint.identification.least_squares import Estimates
from coadjoint.identification.problem import Setting
from coadjoint.identification.process_noise import Normal, Wander, likeliest, normal_equations, prediction_errors
from coadjoint.identification.shooting import Prediction, Shooting
from coadjoint.identification.unknowns import Unknown

SETTLING = 3
"""The number of passes of internal states from each segment to the next before least squares begins."""

FARTHEST = 50.0
"""The largest distance of a coordinate from its prior value, in logarithms or multiples of its size."""


LONGEST_TIME = 4.0
"""The longest correlation time of process noise, in lengths of the log: beyond it is a random walk."""


class Fit:
    """Residuals of all samples over their noise.

    `sigma`: standard deviation by channel; `times`: correlation times of their noise, s, 0 where it is white.
    `weights`: of the samples by the loss, 1 without one. `held`: whether biases and delays keep their prior values.
    """

    def __init__(self, shooting: Shooting, asked: Setting, sigma: np.ndarray, held: bool = False):
        self.shooting, self.asked, self.sigma, self.held = shooting, asked, sigma, held
        self.log, self.sensing = asked.log, asked.sensing
        cut, rows = shooting.samples, shooting.samples.rows
        values = np.stack([self.log.columns[name] for name in shooting.channels.names], axis=1)[rows]
        settled = self.log.time[rows] >= self.log.time[0] + asked.settle
        self.there = (settled & (rows >= 0))[..., None] & np.isfinite(values)
        self.late = [i for _, channels in self.sensing.delayed for i in channels]
        self.there[..., self.late] &= ~cut.early[..., None]
        if attitude := list(self.sensing.attitude):
            self.there[..., attitude] = self.there[..., attitude].all(axis=2, keepdims=True)
        self.values = np.where(self.there, values, 0.0)
        if attitude:
            self.rotation = rotations.measured(*np.moveaxis(self.values[..., attitude], -1, 0))
        self.near = neighbours(self.log.time[rows], self.there)
        self.times = np.zeros(self.there.shape[2])
        self.weights = np.ones(self.there.shape)
        self.internal: Any = None
        self.wander: Wander | None = None

    @property
    def blind(self) -> np.ndarray:
        """Which segments have no samples at their start, (segments,)."""
        return ~self.there[:, 0].any(axis=1)

    @property
    def each(self) -> tuple[Unknown, ...]:
        """All that segments share: parameters, biases, delays."""
        return (*self.shooting.unknowns.each, *self.sensing.each)

    @property
    def count(self) -> int:
        return len(self.each)

    @property
    def own(self) -> int:
        """The number of unknowns of each segment."""
        return self.shooting.own

    def split(self, shared: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates of parameters, and those of the sensors."""
        return tuple(np.split(shared, [len(self.shooting.unknowns.each)]))  # type: ignore[return-value]

    def predict(self, place: Estimates) -> Prediction | None:
        """The simulated measurements."""
        parameters, own = self.split(place.shared)
        delays = self.sensing.delay(own)
        if delays is not None and self.sensing.rotation:
            delays = np.concatenate([delays, np.repeat(delays[self.sensing.attitude[0]], 9)])
        found = self.shooting.predict(parameters, place.own, self.internal, delays)
        self.asked.simulated()
        return found

    def simulated(self, found: Prediction, shared: np.ndarray) -> np.ndarray:
        """Of every channel, with its bias: (segments, samples, channels)."""
        return found.values[..., : len(self.sensing.names)] + self.sensing.bias(self.split(shared)[1])

    def shown(self, found: Prediction, shared: np.ndarray) -> np.ndarray:
        """`simulated`, NaN where a delay would need values from before the segment."""
        values = self.simulated(found, shared)
        early = self.shooting.samples.early[..., None] & np.isin(np.arange(values.shape[-1]), self.late)
        return np.where(early, np.nan, values)

    def differences(self, found: Prediction, shared: np.ndarray) -> np.ndarray:
        """y(t_i) − y_i, angles within half a turn, or of attitudes δ of `rotations`; 0 where nothing was measured."""
        off = self.simulated(found, shared) - self.values
        turning = self.shooting.samples.turning
        off[..., turning] = (off[..., turning] + np.pi) % (2 * np.pi) - np.pi
        if attitude := list(self.sensing.attitude):
            bias = self.sensing.bias(self.split(shared)[1])[attitude]
            off[..., attitude] = rotations.difference(self.rotation, self._matrices(found), bias)
        return np.where(self.there, off, 0.0)

    def _matrices(self, found: Prediction) -> np.ndarray:
        """Simulated attitudes, (segments, samples, 3, 3)."""
        R = found.values[..., len(self.sensing.names) :]
        return R.reshape(*R.shape[:-1], 3, 3)

    def at(self, shared: np.ndarray) -> Estimates:
        """Parameters, with every segment starting at its reference."""
        return Estimates(shared, np.zeros((self.shooting.runs, self.own)))

    def finer(self, segment: float | None, parts: int) -> Fit:
        """The same segments on steps that are `parts` times shorter."""
        if parts == 1:
            return self
        shooting = self.asked.shooting(self.shooting.samples.h / parts, segment, self.shooting.knots)
        found = Fit(shooting, self.asked, self.sigma)
        found.internal, found.times, found.wander = self.internal, self.times, self.wander
        found.weights = self.weights
        return found

    def innovations(self, found: Prediction, shared: np.ndarray) -> np.ndarray:
        """`differences` less their prediction from the previous noise, over the noise: (segments, samples,
        channels)."""
        return whitened(self.differences(found, shared), self.near, self.times) / self.sigma

    def residual(self, place: Estimates) -> tuple[np.ndarray, PyTree] | None:
        parameters, own = self.split(place.shared)
        far = not np.all(np.abs(place.shared) < FARTHEST) or not self.sensing.within(own)
        if far or not self.shooting.unknowns.definite(parameters):
            return None
        found = self.predict(place)
        if found is None:
            return None
        r = (np.sqrt(self.weights) * self.innovations(found, place.shared)).reshape(self.shooting.runs, -1)
        return (r if self.wander is None else np.concatenate([r, self._driving(place.own)], axis=1)), found

    def _driving(self, own: np.ndarray) -> np.ndarray:
        """The innovations of the knots, w = L x of every segment: (segments, knots)."""
        knots = self.shooting.knots
        assert knots is not None and self.wander is not None
        return own[:, self.shooting.size :] @ knots.spread(knots.roots(self.wander)).T

    def slopes(self, place: Estimates, way: Prediction) -> np.ndarray:
        """Derivatives of `differences` by starts, parameters, biases and delays: (segments, samples,
        columns, channels)."""
        parts = [self.shooting.slopes(self.split(place.shared)[0], way)]
        if self.sensing.each and not self.held:
            parts.append(self._by_sensors(way, parts[0].shape[-1]))
        elif self.sensing.each:
            parts.append(np.zeros((*self.there.shape[:2], len(self.sensing.each), parts[0].shape[-1])))
        along = np.concatenate(parts, axis=2)
        found = along[..., : len(self.sensing.names)]
        if self.sensing.rotation:
            found = self._turned(found, along, place.shared, way)
        return np.where(self.there[:, :, None, :], found, 0.0)

    def _turned(self, found: np.ndarray, along: np.ndarray, shared: np.ndarray, way: Prediction) -> np.ndarray:
        """`found` with the derivatives of δ of `rotations` in the place of those of Euler angles."""
        parameters, own = self.split(shared)
        attitude = list(self.sensing.attitude)
        bias, R = self.sensing.bias(own)[attitude], self._matrices(way)
        off = rotations.difference(self.rotation, R, bias)
        turned = rotations.slopes(off, R, along[..., len(self.sensing.names) :], bias)
        by_bias, first = rotations.slopes_of_bias(off, bias), self.own + len(parameters)
        for column, i in enumerate(self.sensing.biased):
            if i in attitude and not self.held:
                turned[:, :, first + column] = by_bias[:, :, attitude.index(i)]
        found = found.copy()
        found[..., attitude] = turned
        return found

    def _by_sensors(self, way: Prediction, numbers: int) -> np.ndarray:
        """∂y/∂b = 1 and ∂y/∂τ = −dy/dt, (segments, samples, columns, numbers of the record)."""
        found = np.zeros((*self.there.shape[:2], len(self.sensing.each), numbers))
        for column, i in enumerate(self.sensing.biased):
            found[:, :, column, i] = 1.0
        speeds = self.shooting.speeds(way) if self.sensing.delayed else None
        for column, (_, channels) in enumerate(self.sensing.delayed, start=len(self.sensing.biased)):
            assert speeds is not None
            late = list(channels)
            found[:, :, column, late] = -speeds[..., late]
            if set(self.sensing.attitude) & set(late):
                matrix = slice(len(self.sensing.names), numbers)
                found[:, :, column, matrix] = -speeds[..., matrix]
        return found

    def jacobian(self, place: Estimates, way: Prediction) -> np.ndarray:
        weighted = whitened(self.slopes(place, way), self.near, self.times) / self.sigma
        weighted = weighted * np.sqrt(self.weights)[:, :, None]
        J = weighted.swapaxes(2, 3).reshape(self.shooting.runs, -1, weighted.shape[2])
        knots = self.shooting.knots
        if self.wander is None or knots is None:
            return J
        driving = np.zeros((len(J), knots.size, J.shape[2]))
        driving[:, :, self.shooting.size : self.own] = knots.spread(knots.roots(self.wander))
        return np.concatenate([J, driving], axis=1)

    def find_process_noise(self, place: Estimates) -> float:
        """The most likely s and τ at a place, and the largest relative change of s √(1 + Δ/τ)."""
        knots = self.shooting.knots
        if knots is None:
            return 0.0
        given, old = self.normal_equations(place), self.wander
        if given is None:
            return 0.0
        self.wander = likeliest(given, knots, self.longest_time, old)
        if old is None:
            return np.inf
        roots = [np.linalg.norm(knots.roots(one), axis=(1, 2)) for one in (old, self.wander)]
        return float(np.max(np.abs(np.log(roots[1] / roots[0]))))

    @property
    def longest_time(self) -> float:
        """The longest correlation time of process noise, s."""
        return LONGEST_TIME * self.log.duration

    def normal_equations(self, place: Estimates) -> Normal | None:
        """The normal equations of the measurements at a place, without the innovations of the knots."""
        kept, self.wander = self.wander, None
        found = self.residual(place)
        x = slice(self.shooting.size, self.own)
        given = None
        if found is not None:
            given = normal_equations(self.jacobian(place, found[1]), found[0], place.own[:, x], x, self.own)
        self.wander = kept
        return given

    def surprise(self, place: Estimates, found: Prediction) -> np.ndarray:
        """The innovations of the samples: `innovations`, or with process noise those of a Kalman filter."""
        w, knots = self.innovations(found, place.shared), self.shooting.knots
        if self.wander is None or knots is None:
            return w
        F = (whitened(self.slopes(place, found), self.near, self.times) / self.sigma)[
            :, :, self.shooting.size : self.own
        ]
        L = knots.spread(knots.roots(self.wander))
        return prediction_errors(w - np.einsum("snxc,sx->snc", F, place.own[:, self.shooting.size :]), F, L.T @ L)

    def settle(self, place: Estimates) -> None:
        """Internal states of starts that follow from those of the previous segments."""
        if not self.shooting.handed:
            return
        for _ in range(SETTLING):
            found = self.predict(place)
            if found is None:
                return
            self.accepted(found)

    def accepted(self, way: Prediction) -> None:
        if self.shooting.handed:
            self.internal = self.shooting.internal(way)
