"""Statistics of members that are merged shard by shard: moments, extremes, quantiles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from coadjoint.texts import Table

CENTROIDS = 256
"""The number of centroids that a shard keeps for each number; of fewer members it keeps all values."""
FIELDS = ("count", "mean", "square", "low", "high", "middles", "weights")


@dataclass(frozen=True)
class Sketch:
    """Of some numbers over `count` members: mean, Σ(x − mean)², extremes, and centroids for quantiles.

    mean, square, low, high: (…). middles: (k, …), means of neighbours in order; weights: (k,), of how many.
    """

    count: int
    mean: np.ndarray
    square: np.ndarray
    low: np.ndarray
    high: np.ndarray
    middles: np.ndarray
    weights: np.ndarray

    @classmethod
    def of(cls, values: np.ndarray, centroids: int = CENTROIDS) -> Sketch:
        """That of values (members, …), all of them finite.

        Centroids have equal steps of k = arccos(1 − 2q)/π in the quantile q, finer at both ends, as those of
        Dunning and Ertl, Computing extremely accurate quantiles using t-digests (2019), eq. (3).
        """
        count, shape = len(values), values.shape[1:]
        if not count:
            nothing = np.zeros(shape)
            return cls(0, nothing, nothing, nothing + np.inf, nothing - np.inf, np.zeros((0, *shape)), np.zeros(0))
        mean = values.mean(axis=0)
        ordered = np.sort(values, axis=0)
        edges = np.arange(count)
        if count > centroids:
            edges = np.unique((count * (1 - np.cos(np.pi * np.arange(centroids) / centroids)) / 2).astype(int))
        weights = np.diff(edges, append=count).astype(float)
        middles = np.add.reduceat(ordered, edges, axis=0) / weights.reshape(-1, *(1 for _ in shape))
        square = ((values - mean) ** 2).sum(axis=0)
        return cls(count, mean, square, ordered[0], ordered[-1], middles, weights)

    def numbers(self, name: str) -> dict[str, np.ndarray]:
        """Its contents in a file."""
        return {f"{name}/{key}": np.asarray(getattr(self, key)) for key in FIELDS}

    @classmethod
    def read(cls, found: Mapping[str, np.ndarray], name: str) -> Sketch:
        """That of a file."""
        kept: Table = {key: found[f"{name}/{key}"] for key in FIELDS}
        return cls(**{**kept, "count": int(kept["count"])})

    @property
    def deviation(self) -> np.ndarray:
        """The standard deviation, with N − 1."""
        return np.sqrt(self.square / (self.count - 1)) if self.count > 1 else np.full_like(self.mean, np.nan)

    def quantile(self, q: float) -> np.ndarray:
        """The quantile q, linear between the middles of centroids; exact where these are single values."""
        if not self.count:
            return np.full(self.mean.shape, np.nan)
        middles = np.concatenate([self.low[None], self.middles, self.high[None]])
        flat = middles.reshape(len(middles), -1)
        found = np.empty(flat.shape[1])
        for place, column in enumerate(flat.T):
            order = np.argsort(column[1:-1], kind="stable")
            heavy = self.weights[order]
            ranks = np.concatenate([[0.0], np.cumsum(heavy) - (heavy + 1) / 2, [self.count - 1.0]])
            found[place] = np.interp(
                q * (self.count - 1), ranks, np.concatenate([[column[0]], column[1:-1][order], [column[-1]]])
            )
        return found.reshape(self.mean.shape)

    def table(self, quantiles: Sequence[float]) -> np.ndarray:
        """Mean, standard deviation, extremes and quantiles, (statistic, …)."""
        if not self.count:
            return np.full((4 + len(quantiles), *self.mean.shape), np.nan)
        rows = [self.mean, self.deviation, self.low, self.high, *(self.quantile(q) for q in quantiles)]
        return np.stack(rows)


def merged(parts: Sequence[Sketch]) -> Sketch:
    """That of the members of all parts, taken in their order: the same parts give the same bits.

    Moments as Chan, Golub and LeVeque, Updating formulae and a pairwise algorithm (1979), eq. (2.1).
    """
    parts = [part for part in parts if part.count] or list(parts[:1])
    count, mean, square = parts[0].count, parts[0].mean, parts[0].square
    for part in parts[1:]:
        total, gap = count + part.count, part.mean - mean
        mean = mean + gap * (part.count / total)
        square = square + part.square + gap**2 * (count * part.count / total)
        count = total
    return Sketch(
        count,
        mean,
        square,
        np.min([part.low for part in parts], axis=0),
        np.max([part.high for part in parts], axis=0),
        np.concatenate([part.middles for part in parts]),
        np.concatenate([part.weights for part in parts]),
    )
