"""The spaces of an environment, and its seeds."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Box

from coadjoint import checks
from coadjoint_vehicles.environments.simulated import Simulated

UNIT = ("down", "north", "facing")
"""Observations that are unit vectors."""


def boxes(simulated: Simulated) -> tuple[Box, Box]:
    """The spaces of observations and of actions of one vehicle."""
    low = np.full(simulated.width, -np.inf)
    for name in UNIT:
        if name in simulated.fields:
            low[simulated.fields[name]] = -1.0 - 1e-9
    return Box(low, -low, dtype=np.float64), Box(-1.0, 1.0, (simulated.actions.size,), np.float32)


def varying_from(seed: Any) -> np.random.Generator:
    """The random numbers of parameters, apart from those of starts that have the same seed."""
    return np.random.default_rng([int(seed), 1])


def whole_or_none(seed: object, name: str) -> None:
    """Raise ArgumentError for an invalid seed."""
    if seed is not None:
        checks.whole(seed, name, 0)
