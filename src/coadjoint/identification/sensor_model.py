"""The unknowns of the sensors: biases and delays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from coadjoint import checks
from coadjoint.errors import ArgumentError
from coadjoint.identification.channels import ATTITUDE, POSITION, RATES, VELOCITY
from coadjoint.identification.log import Log
from coadjoint.identification.unknowns import Unknown

GROUPS = {"position": POSITION, "attitude": ATTITUDE, "velocity": VELOCITY, "rates": RATES}
"""Names that stand for three columns of a vehicle."""

Attitude = Literal["angles", "rotation"]
"""The comparison of a measured attitude: each Euler angle, or log of R_measuredᵀR_simulated, along the body axes."""

STEEP = np.radians(60.0)
"""The pitch from which on a log is compared by rotations by default: at 90° Euler angles are singular."""

SENSORS = ("bias.", "delay.")
"""The prefixes of the names of the unknowns of sensors."""

AT_BOUND = 0.99
"""The part of the longest delay from which on its bound has stopped the search."""

TOGETHER = 0.9
"""Rotations need all three angles in this part of the rows that have one of them."""


@dataclass(frozen=True)
class Sensing:
    """y(t) = h(state(t − τ)) + b + noise for every channel: the unknown biases b and delays τ.

    `names`: the channels. `biased`: those with a bias. `delayed`: groups of channels with a delay each, none longer
    than `longest` s. `coloured`: those with coloured noise, a Gauss–Markov process of the first order.
    `rotation`: whether attitude is compared as a rotation.
    """

    names: tuple[str, ...]
    biased: tuple[int, ...] = ()
    delayed: tuple[tuple[str, tuple[int, ...]], ...] = ()
    coloured: tuple[int, ...] = ()
    longest: float = 0.5
    rotation: bool = False

    @property
    def each(self) -> tuple[Unknown, ...]:
        """The unknowns in their order: biases, in the unit of the column, then delays, s."""
        biases = [Unknown(f"bias.{self.names[i]}", (), 0.0, False) for i in self.biased]
        return (*biases, *(Unknown(f"delay.{name}", (), 0.0, False) for name, _ in self.delayed))

    @property
    def reach(self) -> float:
        """The time before and after a sample for which the simulation must give the state, s."""
        return self.longest if self.delayed else 0.0

    @property
    def attitude(self) -> tuple[int, ...]:
        """The places of roll, pitch and heading, if attitude is compared as a rotation."""
        return tuple(self.names.index(name) for name in ATTITUDE) if self.rotation else ()

    def bias(self, own: np.ndarray) -> np.ndarray:
        """b of all channels."""
        found = np.zeros(len(self.names))
        found[list(self.biased)] = own[: len(self.biased)]
        return found

    def delay(self, own: np.ndarray) -> np.ndarray | None:
        """τ of all channels, s; None if none is estimated."""
        if not self.delayed:
            return None
        found = np.zeros(len(self.names))
        for (_, channels), value in zip(self.delayed, own[len(self.biased) :], strict=True):
            found[list(channels)] = value
        return found

    def at_bound(self, own: np.ndarray) -> list[str]:
        """The names of delays at the longest."""
        late = zip(self.each[len(self.biased) :], own[len(self.biased) :], strict=True)
        return [unknown.label for unknown, value in late if abs(value) > AT_BOUND * self.longest]

    def within(self, own: np.ndarray) -> bool:
        """Whether no delay is longer than the longest."""
        return bool(np.all(np.abs(own[len(self.biased) :]) <= self.longest))


def sensing(
    log: Log,
    names: tuple[str, ...],
    *,
    biases: Sequence[str] = (),
    delays: Sequence[str] | Mapping[str, Sequence[str]] = (),
    longest_delay: float = 0.5,
    coloured: Sequence[str] = (),
    attitude: Attitude | None = None,
) -> Sensing:
    """The unknowns of the sensors from the checked arguments; raises ArgumentError."""
    if delays and not (np.isfinite(longest_delay) and 0 < longest_delay < log.duration / 4):
        raise ArgumentError(
            f"Argument `longest_delay` must be positive and below a quarter of the log's {log.duration:g} s, but is "
            f"{longest_delay:g} s."
        )
    pairs = delays.items() if isinstance(delays, Mapping) else [(name, (name,)) for name in _listed("delays", delays)]
    delayed = tuple((name, _channels(f"delays[{name!r}]", members, names)) for name, members in pairs)
    taken: dict[int, str] = {}
    for group, channels in delayed:
        for i in channels:
            if i in taken:
                raise ArgumentError(
                    f"Argument `delays` has {names[i]} in `{taken[i]}` and in `{group}`: a column has one delay."
                )
            taken[i] = group
    found = Sensing(
        names,
        _channels("biases", biases, names),
        delayed,
        _channels("coloured", coloured, names),
        float(longest_delay),
        _rotation(log, names, attitude),
    )
    if found.rotation and len({taken.get(i) for i in found.attitude}) > 1:
        raise ArgumentError(
            "Attitude that is compared as a rotation has one delay: give roll, pitch and heading in one group of "
            '`delays`, or attitude="angles".'
        )
    return found


def _listed(argument: str, given: Sequence[str]) -> Sequence[str]:
    checks.expect(not isinstance(given, str), given, argument, f"a list of names, such as [{given!r}]")
    return given


def _channels(argument: str, given: Sequence[str], names: tuple[str, ...]) -> tuple[int, ...]:
    """The places of the named columns, alone or as a group; raises ArgumentError if none exists."""
    found: dict[int, None] = {}
    known = [*names, *GROUPS]
    for name in _listed(argument, given):
        members = [one for one in GROUPS.get(name, (name,)) if one in names]
        if not members:
            near = checks.nearest(name, known, 0.0)
            raise ArgumentError(
                f"Argument `{argument}` names `{name}`, which the log does not hold; the nearest is `{near}`."
            )
        found |= dict.fromkeys(names.index(one) for one in members)
    return tuple(found)


def _rotation(log: Log, names: tuple[str, ...], attitude: Attitude | None) -> bool:
    """Whether attitude is compared as a rotation: on request, or if the log pitches steeply."""
    if attitude is not None:
        checks.choice(attitude, "attitude", ("angles", "rotation"))
    complete = all(name in names for name in ATTITUDE)
    if attitude == "rotation" and not complete:
        missing = ", ".join(name for name in ATTITUDE if name not in names)
        raise ArgumentError(f'attitude="rotation" needs roll, pitch and heading, but the log holds no {missing}.')
    if attitude is not None or not complete:
        return attitude == "rotation"
    there = np.stack([np.isfinite(log.columns[name]) for name in ATTITUDE])
    if there.all(axis=0).sum() < TOGETHER * there.any(axis=0).sum():
        return False
    return bool(np.nanmax(np.abs(log.columns["pitch"])) > STEEP)
