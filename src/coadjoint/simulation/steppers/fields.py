"""Named arrays in one row of numbers: what a stepper calls commands, observations, states and parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from coadjoint.paths import respelled


class Fields(NamedTuple):
    """Names and shapes, one after the other in a row. Knows NumPy only: a saved stepper is without JAX."""

    shapes: tuple[tuple[str, tuple[int, ...]], ...]

    @classmethod
    def of(cls, shapes: Mapping[str, tuple[int, ...]]) -> Fields:
        """From name → shape, in its order."""
        return cls(tuple((name, tuple(shape)) for name, shape in shapes.items()))

    @property
    def names(self) -> tuple[str, ...]:
        """The names, in the order of the row."""
        return tuple(name for name, _ in self.shapes)

    @property
    def size(self) -> int:
        """How many numbers a row has."""
        return sum(math.prod(shape) for _, shape in self.shapes)

    @property
    def scalar(self) -> bool:
        """Whether every field is one number."""
        return all(shape == () for _, shape in self.shapes)

    def places(self) -> Iterator[tuple[str, tuple[int, ...], slice]]:
        """Name, shape and place of each field in the row."""
        start = 0
        for name, shape in self.shapes:
            end = start + math.prod(shape)
            yield name, shape, slice(start, end)
            start = end

    def place(self, name: str) -> slice:
        """The place of one field in the row."""
        return next(place for known, _, place in self.places() if known == name)

    def views(self, rows: np.ndarray) -> dict[str, np.ndarray]:
        """Name → view (*lead, *shape) of rows (*lead, size)."""
        return {name: rows[..., place].reshape((*rows.shape[:-1], *shape)) for name, shape, place in self.places()}

    def unknown(self, name: Any, what: str) -> str:
        """The sentence about a name that is none."""
        if path := respelled(str(name), self.names):
            return f"There is no {what} `{name}`: it is `{path}`."
        return f"There is no {what} `{name}`; there is: {', '.join(self.names) or 'none'}."
