"""The result of a kernel: a part of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.program import Code


@dataclass(frozen=True)
class Chunk:
    """A part of a run, NumPy throughout.

    `records`: states with a leading axis, record j at step j·save_every with the unknowns of the step that starts
    there; `final`: the state after the last good step; `monitors`: name → one row a record; `extrema`: name →
    (minimum, maximum) over every step, for certificates over the stages too; `iterations`: Newton's, over all steps
    and stages; `code`: the outcome of the last step tried.
    """

    records: PyTree
    final: PyTree
    steps: int
    code: Code
    iterations: int
    iterations_max: int
    monitors: Mapping[str, np.ndarray]
    extrema: Mapping[str, tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class EnsembleChunk:
    """A part of the runs of all members: as `Chunk`, with a leading axis of members everywhere.

    Members that failed have fewer records, `rows` (members,) of them; later rows are NaN. `code` (members,) are
    integers of `Code`.
    """

    records: PyTree
    final: PyTree
    steps: np.ndarray
    rows: np.ndarray
    code: np.ndarray
    iterations: np.ndarray
    iterations_max: np.ndarray
    monitors: Mapping[str, np.ndarray]
    extrema: Mapping[str, tuple[np.ndarray, np.ndarray]]
