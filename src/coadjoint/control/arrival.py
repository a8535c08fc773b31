"""What the measurements before a horizon tell of its first node: the arrival cost.

V(x) = ½ θᵀΠθ + βᵀθ for the changes y = a + Kθ of a node x̄, by its directions; K has as many orthonormal columns as the
node can change in at all. What K leaves out is known, and what Π does not weigh is not known.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

SMALL = 1e-11
"""A singular value, of the largest, that counts as none."""


class Quadratic(NamedTuple):
    """½ vᵀHv + gᵀv."""

    H: np.ndarray
    g: np.ndarray

    def plus(self, rows: np.ndarray, offset: np.ndarray, H: np.ndarray, g: np.ndarray) -> Quadratic:
        """With ½ wᵀHw + gᵀw more, for w = rows v + offset."""
        return Quadratic(self.H + rows.T @ H @ rows, self.g + rows.T @ (g + H @ offset))

    def least(self) -> np.ndarray:
        """v of the least value, the shortest one where there are several."""
        return -self.inverse()[0] @ self.g

    def inverse(self) -> tuple[np.ndarray, np.ndarray]:
        """H⁻¹ where H tells v, and the columns of directions of which it tells nothing."""
        units = np.sqrt(np.where(np.diag(self.H) > 0, np.diag(self.H), 1.0))
        values, vectors = np.linalg.eigh(self.H / units / units[:, None])
        known = values > SMALL * max(float(values[-1]), 1.0) if len(values) else np.zeros(0, bool)
        told, blind = vectors[:, known] / units[:, None], vectors[:, ~known] / units[:, None]
        return (told / values[known]) @ told.T, blind


class Arrival(NamedTuple):
    """x̄ (nx,), the inverse of its directions (width, nx), a (width,), K (width, m), and the cost of θ."""

    node: np.ndarray
    inverse: np.ndarray
    offset: np.ndarray
    K: np.ndarray
    cost: Quadratic


def least_to(cost: Quadratic, G: np.ndarray) -> tuple[np.ndarray, Quadratic]:
    """(K, V): the least cost of v as a function of Gv = Kθ, V(θ) = min {cost(v): Gv = Kθ}."""
    left, sizes, right = np.linalg.svd(G, full_matrices=True)
    rank = int(np.sum(sizes > SMALL * max(float(np.max(sizes, initial=0.0)), 1e-300)))
    K, back, free = left[:, :rank], right[:rank].T / sizes[:rank], right[rank:].T
    inner = Quadratic(free.T @ cost.H @ free, free.T @ cost.g).inverse()[0]
    through = cost.H @ free @ inner @ free.T
    H = back.T @ (cost.H - through @ cost.H) @ back
    return K, Quadratic(0.5 * (H + H.T), back.T @ (cost.g - through @ cost.g))
