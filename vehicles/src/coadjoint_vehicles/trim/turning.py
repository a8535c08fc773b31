"""Steady turns that are not on the branch of the straight course."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.mechanics import State
from coadjoint.stability import Search, SteadyMotion

STARTS = ((0.1, 1.0), (0.3, 0.7))
"""Of starts to either side: |ω| length/speed, and the part of the speed at which the turn is looked for first."""

UPRIGHT = np.cos(np.radians(60.0))
"""The least component of down along the body's third axis, in a turn that counts."""


def turns(guess: State, search: Search, speed: float, vehicle: Any) -> Iterator[SteadyMotion]:
    """Steady turns near a handful of starts, in a fixed order: those to the side of the held actuators first.

    Where a vehicle is unstable in yaw, the straight course lies on a branch of turns against the rudder, which folds at
    a small rudder angle. A turn beyond the fold is reached from a start that turns already, by ω = ±(rate speed/length)
    down, at the speed itself or by way of a slower turn.

    guess: straight ahead with the held actuators where they are held. search: of motions that may turn. speed: m/s.
    Turns that lie on their side or go astern are left out.
    """
    length = float(vehicle.length) if vehicle.length is not None else 2 * float(np.cbrt(vehicle.volume))
    side = 1.0 if search.reduced.slopes(guess).rate[2] >= 0 else -1.0
    for toward in (side, -side):
        for rate, part in STARTS:
            began = _turning(guess, toward * rate * part * speed / length, part)
            found = _found(began, search, part * speed, speed)
            if found is not None:
                yield found


def _turning(guess: State, rate: float, part: float) -> State:
    return guess.replace(xi=rate * np.asarray(guess.a[:3]), nu=part * np.asarray(guess.nu))


def _found(start: State, search: Search, first: float, speed: float) -> SteadyMotion | None:
    """The turn at the speed by way of one at the first speed, if it is upright and goes ahead."""
    try:
        found = search.find(start, first)
        if first != speed:
            found = search.find(found.state, speed)
    except ArgumentError:
        return None
    upright = float(found.state.a[2]) >= UPRIGHT
    return found if upright and float(found.state.nu @ start.nu) > 0 else None
