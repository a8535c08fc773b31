"""Many starts that a method has begun at once, so that members go to them by copying numbers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Prepared(NamedTuple):
    """Rows of numbers: states (k, size), and parameters (k, size), None where they stay those of the stepper."""

    states: np.ndarray
    parameters: np.ndarray | None

    def __len__(self) -> int:
        return len(self.states)
