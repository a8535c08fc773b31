"""A finished run: its records, its certificate, its dataset and plots."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from coadjoint.kernels.chunk import Chunk
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method
from coadjoint.simulation.card import card
from coadjoint.simulation.recording import Recording

if TYPE_CHECKING:
    import xarray


class Run(Recording):
    """What `co.simulate` returns; `print` it for the certificate.

    `records` are the saved states with a leading axis, `final` the last of them, `monitors` one row a record,
    `extrema` the (minimum, maximum) of every monitored scalar over all steps, saved or not.
    """

    def __init__(
        self,
        system: System,
        method: Method,
        start: State,
        dt: float,
        steps: int,
        save_every: int,
        warnings: list[str],
    ):
        self.system, self.method, self.start = system, method, start
        self.dt, self.steps, self.save_every, self.warnings = dt, steps, save_every, warnings
        self.good_steps = 0
        self.iterations = 0
        self.iterations_max = 0
        self.seconds = 0.0
        self.set_up_seconds = 0.0
        self.extrema: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._chunks: list[Chunk] = []
        self._indices: list[np.ndarray] = []

    def add(self, chunk: Chunk, save_every: int) -> None:
        """Append a stretch that starts at the step where the last one ended."""
        rows = len(np.asarray(chunk.records.t))
        self._indices.append(self.good_steps + save_every * np.arange(rows))
        self._chunks.append(chunk)
        self.good_steps += chunk.steps
        self.iterations += chunk.iterations
        self.iterations_max = max(self.iterations_max, chunk.iterations_max)
        self._watch(chunk)

    def close(self, chunk: Chunk) -> None:
        """Append the last node, whose chunk is one step more than the run."""
        if chunk.steps:
            self._indices.append(np.array([self.good_steps]))
            self._chunks.append(chunk)
            self._watch(chunk)

    def _watch(self, chunk: Chunk) -> None:
        if chunk.steps == 0:
            return
        for name, (low, high) in chunk.extrema.items():
            before = self.extrema.get(name, (low, high))
            self.extrema[name] = np.minimum(before[0], low), np.maximum(before[1], high)

    @property
    def title(self) -> str:
        """The system and the method in words."""
        return f"{self.system.name}, {self.method.title}"

    @property
    def count(self) -> int:
        """The number of records."""
        return sum(len(indices) for indices in self._indices)

    @cached_property
    def steps_saved(self) -> np.ndarray:
        """The step index of every record."""
        return np.concatenate(self._indices) if self._indices else np.zeros(0, dtype=int)

    @cached_property
    def records(self) -> State:
        """The saved states, every leaf with a leading axis."""
        rows = [chunk.records for chunk in self._chunks]
        return jax.tree.map(lambda *parts: np.concatenate(parts), *rows)

    @cached_property
    def monitors(self) -> dict[str, np.ndarray]:
        """Every monitored scalar, one row a record."""
        names = self._chunks[0].monitors
        return {name: np.concatenate([chunk.monitors[name] for chunk in self._chunks]) for name in names}

    @property
    def final(self) -> State:
        """The last record."""
        return jax.tree.map(lambda rows: rows[-1], self.records)

    @property
    def newton_iterations_mean(self) -> float:
        """Newton iterations a step."""
        return self.iterations / max(self.good_steps, 1)

    @cached_property
    def dataset(self) -> xarray.Dataset:
        """The records as a labelled xarray dataset."""
        from coadjoint.simulation.dataset import dataset

        return dataset(self)

    def relative_change(self, name: str) -> float:
        """max_k |X_k − X₀| / |X₀| over every step, for a monitored X; absolute if X₀ = 0."""
        low, high = self.extrema[name]
        first = self.monitors[name][0]
        size = float(np.linalg.norm(first))
        change = float(np.linalg.norm(np.maximum(np.abs(high - first), np.abs(first - low))))
        return change / size if size > 0 else change

    def largest(self, name: str) -> float:
        """The largest value of a monitored scalar over every step."""
        return float(np.max(self.extrema[name][1]))

    def __str__(self) -> str:
        return card(self)

    def __repr__(self) -> str:
        return f"<Run of {self.title}: {self.good_steps} of {self.steps} steps; print it for the certificate>"

    def summary(self) -> dict[str, Any]:
        """The certificate as plain numbers."""
        from coadjoint.simulation.card import certificate

        return certificate(self)
