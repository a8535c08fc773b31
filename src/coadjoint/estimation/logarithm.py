"""Elements of groups as exponentials: the coordinates of errors that are not small."""

from __future__ import annotations

from typing import Any

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.groups import SO3, attitude
from coadjoint.kernels.trace.evaluate import evaluate


def logarithms(group: Any, turns: np.ndarray) -> np.ndarray:
    """η, (count, dim G), with exp(η) = turns, matrices (count, k, k); of rotations |η| ≤ π.

    Raises ArgumentError where a matrix has no real logarithm in the algebra.
    """
    if isinstance(group, SO3):
        return attitude.rotation_vector(turns)
    from scipy.linalg import expm, logm  # a tenth of what a set-up takes

    found = np.empty((len(turns), group.dim))
    for i, turn in enumerate(turns):
        algebra = logm(turn)
        if np.max(np.abs(np.imag(algebra))) > 1e-9 or not np.allclose(expm(np.real(algebra)), turn, atol=1e-8):
            raise ArgumentError(
                "An estimate and the truth differ by an element of the group that is no exponential, such as half a "
                "turn: their error has no coordinates."
            )
        found[i] = evaluate(group.vee, np.real(algebra))
    return found
