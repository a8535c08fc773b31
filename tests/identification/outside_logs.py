"""Logs of vehicles that were simulated without the library, by sensors with bias, delay, coloured noise and drop-outs;
what is identified in them, and how narrow an interval can be.

The bound is that of Cramér and Rao of the whole log: F = Σ_c S_cᵀ V_c⁻¹ S_c with the derivatives S of what the sensors
of column c say by parameters, biases, the delay and all twelve numbers of the start, and with the covariance V of its
noise at the samples that are there. Parameters of V do not change it, because F of a normal law has no terms across.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import cho_factor, cho_solve, expm
from tests.identification.outside import BlueRov, Body, Remus, columns, hat
from tests.identification.test_coloured import markov
from tests.torpedo import NOISE

from coadjoint.identification import Identification, Log, identify
from coadjoint_vehicles import Craft, load

INTERVAL, TIME, LOST = 0.1, 0.6, 0.1
"""Between samples, and of the noise of velocities and rates, s; the part of values that is missing."""

DELAY, BIASES = 0.08, {"u": 0.03, "r": 0.005}
POSITION, SLOW = ("north", "east", "depth"), ("u", "v", "w", "p", "q", "r")


@dataclass(frozen=True)
class Experiment:
    """`truth`: what is sought of the vehicle, with the values of its file; `guess`: what the search begins with, times
    the truth. `dt`, `segment`: step and segments of the fit, s. `begun`: state at t = 0. `inputs`: commands by the
    names of the log."""

    body: Callable[..., Body]
    vehicle: str
    truth: Mapping[str, float]
    guess: Mapping[str, float]
    commands: np.ndarray
    begun: np.ndarray
    dt: float
    segment: float | None

    @property
    def time(self) -> np.ndarray:
        return INTERVAL * np.arange(len(self.commands))

    @property
    def all(self) -> dict[str, float]:
        """Everything that is sought, with its true value."""
        return {**self.truth, **{f"bias.{name}": value for name, value in BIASES.items()}, "delay.position": DELAY}

    @property
    def inputs(self) -> dict[str, np.ndarray]:
        names, ends = [name for name, _ in self.actuated], np.cumsum([count for _, count in self.actuated])
        parts = zip(names, np.split(self.commands, ends[:-1], axis=1), strict=True)
        return {name: part[:, 0] if part.shape[1] == 1 else part for name, part in parts}

    @property
    def actuated(self) -> tuple[tuple[str, int], ...]:
        return self.body().actuated

    @cached_property
    def exact(self) -> dict[str, np.ndarray]:
        return self.simulated()

    def simulated(self, body: Body | None = None, begun: Any = None, pushes: Any = None) -> dict[str, np.ndarray]:
        """What sensors without bias and noise say, positions DELAY late."""
        start = self.begun if begun is None else begun
        states, before = (body or self.body()).run(start, self.time, self.commands, DELAY, pushes)
        late = columns(before)
        return columns(states) | {name: late[name] for name in POSITION}

    def log(self, seed: int, exact: Mapping[str, np.ndarray] | None = None) -> Log:
        random, n, seen = np.random.default_rng(seed), len(self.commands), {}
        for name, values in (exact or self.exact).items():
            noise = (
                markov(random, n, NOISE[name], INTERVAL, TIME) if name in SLOW else NOISE[name] * random.normal(size=n)
            )
            seen[name] = values + noise + BIASES.get(name, 0.0)
            seen[name][random.random(n) < LOST] = np.nan
        return Log(self.time, seen, self.inputs)

    @cached_property
    def craft(self) -> Craft:
        return Craft(load(self.vehicle))

    @cached_property
    def start(self) -> Any:
        ends = np.cumsum([count for _, count in self.actuated])
        parts = zip(self.actuated, np.split(self.begun[18:], ends[:-1]), strict=True)
        actuators = {name: part[0] if count == 1 else part for (name, count), part in parts}
        return self.craft.start(position=tuple(self.begun[:3]), speed=float(self.begun[12]), actuators=actuators)

    def identified(self, log: Log, **options: Any) -> Identification:
        """With the search begun off the truth."""
        system: Any = self.craft.system
        for name, factor in self.guess.items():
            path, _, index = name.rstrip("]").partition("[")
            section, _, key = path.rpartition(".")
            old = getattr(getattr(system.parameters, section) if section else system.parameters, key)
            new, where = np.array(old), tuple(map(int, index.split(","))) if index else ()
            new[where] *= factor
            system = system.replace(**{section: {key: new}} if section else {key: new})
        given = {"coloured": ["velocity", "rates"], "dt": self.dt, "segment": self.segment} | options
        return identify(
            system, log, start=self.start, parameters=list(self.truth), biases=list(BIASES), delays=["position"],
            longest_delay=0.2, **given,
        )  # fmt: skip

    @cached_property
    def slopes(self) -> dict[str, np.ndarray]:
        """S of every column, (samples, unknowns), by central differences of DOP853; the unknowns of `all` first."""
        along = []
        for name, value in self.truth.items():
            h = 1e-3 * abs(value)
            pair = [self.simulated(self.body({name: value + sign * h})) for sign in (1, -1)]
            along.append({c: turned(pair[0][c] - pair[1][c]) / (2 * h) for c in pair[0]})
        zero = {c: np.zeros(len(self.time)) for c in self.exact}
        along += [{**zero, name: np.ones(len(self.time))} for name in BIASES]
        along.append(zero | {name: -np.gradient(self.exact[name], INTERVAL) for name in POSITION})
        for k in range(12):
            pair = [self.simulated(begun=self._moved(k, sign * 1e-4)) for sign in (1, -1)]
            along.append({c: turned(pair[0][c] - pair[1][c]) / 2e-4 for c in pair[0]})
        return {c: np.stack([one[c] for one in along], axis=1) for c in self.exact}

    def _moved(self, k: int, by: float) -> np.ndarray:
        """The start with one of position, attitude, velocity and rates moved."""
        x, begun = np.zeros(12), self.begun.copy()
        x[k] = by
        begun[:3] += x[:3]
        begun[3:12] = (begun[3:12].reshape(3, 3) @ expm(hat(x[3:6]))).ravel()
        begun[12:18] += x[6:]
        return begun

    def bound(self, log: Log) -> dict[str, float]:
        """The least standard error of each unknown."""
        count = next(iter(self.slopes.values())).shape[1]
        F = np.zeros((count, count))
        for name, S in self.slopes.items():
            there = np.isfinite(log.columns[name])
            t, S = self.time[there], S[there]
            V = NOISE[name] ** 2 * (np.exp(-np.abs(t[:, None] - t) / TIME) if name in SLOW else np.eye(len(t)))
            F += S.T @ cho_solve(cho_factor(V), S)
        size = np.sqrt(np.diag(F))
        covariance = np.linalg.inv(F / np.outer(size, size)) / np.outer(size, size)
        return dict(zip(self.all, np.sqrt(np.diag(covariance))[: len(self.all)], strict=True))


def turned(small: np.ndarray) -> np.ndarray:
    """Differences, of angles some of which are a turn apart."""
    return (small + np.pi) % (2 * np.pi) - np.pi


def zigzag(t: np.ndarray, period: float, size: float) -> np.ndarray:
    return size * np.sign(np.sin(2 * np.pi * t / period) + 1e-12)


def remus(duration: float = 60.0) -> Experiment:
    """Zigzags of fins and propeller."""
    t = INTERVAL * np.arange(round(duration / INTERVAL))
    commands = np.stack(
        [zigzag(t, 16, 0.14) + zigzag(t, 7, 0.07), zigzag(t, 11, 0.10) + zigzag(t, 5, 0.08),
         18 + zigzag(t, 23, 5) + zigzag(t, 9, 2)], 1,
    )  # fmt: skip
    begun = np.concatenate([[0, 0, 20.0], np.eye(3).ravel(), [1.5, 0, 0, 0, 0, 0], [0.0, 0, 18]])
    truth = {"hull.axial_drag": 0.42, "hull.crossflow_drag": 1.1, "added_mass[1,1]": 29.4376, "added_mass[5,5]": 3.4262}
    guess = {"hull.axial_drag": 1.3, "hull.crossflow_drag": 0.73, "added_mass[1,1]": 1.3, "added_mass[5,5]": 1.3}
    return Experiment(Remus, "remus_100", truth, guess, commands, begun, 0.0125, None)


def bluerov(duration: float = 60.0) -> Experiment:
    """Each thruster at random, anew every 1.5 s, those that push up and down by a third as much."""
    random, n = np.random.default_rng(3), round(duration / INTERVAL)
    most = np.array([180.0] * 4 + [60.0] * 4)
    widths = 1500 + random.uniform(35, most, (n // 15 + 1, 8)) * random.choice([-1, 1], (n // 15 + 1, 8))
    commands = np.repeat(widths, 15, axis=0)[:n]
    begun = np.concatenate([[0, 0, 20.0], np.eye(3).ravel(), np.zeros(6), commands[0]])
    drag = {"damping.quadratic[0]": 141.0, "damping.quadratic[1]": 217.0, "damping.quadratic[5]": 1.5}
    added = {"added_mass[0,0]": 6.3567, "added_mass[1,1]": 7.1206, "added_mass[5,5]": 0.2215}
    truth = drag | {"damping.linear[2]": 33.0} | added
    guess = dict(zip(truth, (0.7, 0.7, 0.7, 1.4, 1.3, 1.3, 1.3), strict=True))
    return Experiment(BlueRov, "bluerov2_heavy_von_benzon", truth, guess, commands, begun, 0.0125, 20.0)
