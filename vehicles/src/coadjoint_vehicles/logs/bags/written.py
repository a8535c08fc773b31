"""Messages of one topic that are to be written, and the paths of vectors and quaternions in them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from coadjoint.arrays import Array
from coadjoint.groups import attitude
from coadjoint_vehicles import axes as border
from coadjoint_vehicles.axes import Axes


class Written(NamedTuple):
    """Messages of one topic: the type, `pkg/Name`, and the values of its fields.

    time, logged: when each was stamped and logged, (messages,) s; None at the times of the run. body: the definition of
    a type that is not in ROS.
    """

    topic: str
    type: str
    values: Mapping[str, Any]
    time: np.ndarray | None = None
    logged: np.ndarray | None = None
    body: str | None = None


def signed(vectors: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Vectors by a matrix that permutes axes and changes signs; a missing component does not affect the others."""
    source = np.argmax(np.abs(turn), axis=0)
    return vectors[:, source] * turn[source, np.arange(3)]


def quaternions(directions: np.ndarray, axes: Axes) -> np.ndarray:
    """(n, 4), NaN where an attitude is missing."""
    found = np.full((len(directions), 4), np.nan)
    good = np.isfinite(directions).all(axis=(1, 2))
    if good.any():
        found[good] = attitude.to_quaternion(border.rotation(directions[good], axes))
    return found


def vector(path: str, values: Array) -> dict[str, Array]:
    """Fields x, y, z of columns."""
    return {f"{path}.{axis}": values[:, i] for i, axis in enumerate("xyz")}


def quaternion(path: str, values: np.ndarray) -> dict[str, np.ndarray]:
    """Fields w, x, y, z of columns."""
    return {f"{path}.{axis}": values[:, i] for i, axis in enumerate("wxyz")}
