"""What a system with a closed-form answer gives: its system, its start, and the exact state at any time."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np

import coadjoint as co


class Problem:
    """A system whose motion is known; a class carries the parameters.

    `dt` is a step at which all methods are in their range of convergence, `duration` a time over which their errors
    do not yet overlap with the size of the motion.
    """

    dt: float
    duration: float

    @property
    def title(self) -> str:
        raise NotImplementedError

    @cached_property
    def system(self) -> co.System:
        raise NotImplementedError

    @cached_property
    def start(self) -> co.State:
        raise NotImplementedError

    @property
    def energy(self) -> float:
        """The exact energy, from a formula of its own."""
        raise NotImplementedError

    def exact(self, t: np.ndarray) -> Mapping[str, np.ndarray]:
        """Attributes of the state (g, q, mu, pi) at the times t, each with a leading axis of times."""
        raise NotImplementedError

    def error(self, run: co.State, t: np.ndarray) -> float:
        """The largest deviation of the records from the exact state, each attribute relative to its largest entry."""
        worst = 0.0
        for name, values in self.exact(t).items():
            scale = max(float(np.max(np.abs(values))), 1e-300)
            worst = max(worst, float(np.max(np.abs(np.asarray(getattr(run, name)) - values))) / scale)
        return worst


def turn_about(axis: int, angle: np.ndarray) -> np.ndarray:
    """Rotations by the angles (T,) about a coordinate axis, (T, 3, 3)."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.zeros((len(angle), 3, 3))
    R[:, axis, axis] = 1.0
    R[:, i, i] = R[:, j, j] = np.cos(angle)
    R[:, j, i], R[:, i, j] = np.sin(angle), -np.sin(angle)
    return R
