"""The arrival cost: the information of the measurements before a horizon on its first node.

V(x) = ½ |Rθ + r|² + lᵀθ for the changes y = a + Kθ of a node x̄, by its directions; K has as many independent columns
as the node can change in. Directions outside K are known exactly, and directions that R does not weigh are unknown.

Costs are kept as roots, not as Hessians RᵀR: a direction without information is then one of round-off against R itself.
It is measured in the units of the columns before any cancellation, and values below SMALL of them count as zero.

Source: G. J. Bierman, *Factorization Methods for Discrete Sequential Estimation*, Academic Press (1977), chapter V.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from coadjoint.errors import OptimumError

SMALL = 1e-10
"""The relative size of a singular value that counts as zero."""


class Part(NamedTuple):
    """½ |J w + r|² + lᵀw of w = rows v + offset."""

    cost: Quadratic
    rows: np.ndarray
    offset: np.ndarray


class Quadratic(NamedTuple):
    """½ |Jv + r|² + lᵀv; sizes (nv,): the norms of the columns of J as they were before anything cancelled in them."""

    J: np.ndarray
    r: np.ndarray
    l: np.ndarray
    sizes: np.ndarray

    @staticmethod
    def of_root(J: np.ndarray, r: np.ndarray) -> Quadratic:
        """½ |Jv + r|²."""
        return Quadratic(J, r, np.zeros(J.shape[1]), np.linalg.norm(J, axis=0))

    @staticmethod
    def of_hessian(H: np.ndarray, g: np.ndarray) -> Quadratic:
        """½ vᵀHv + gᵀv, whose negative curvature is left out."""
        require_finite(H, g)
        units = np.sqrt(np.abs(np.diag(H)))
        units = np.where(units > 0, units, 1.0)
        values, vectors = np.linalg.eigh(H / units / units[:, None])
        held = values > 1e-14 * max(float(np.max(values, initial=0.0)), 1e-300)
        roots, across = np.sqrt(values[held]), vectors[:, held]
        r = across.T @ (g / units) / roots
        J = roots[:, None] * across.T * units
        left = g - J.T @ r
        left[np.abs(left) <= 1e-13 * (np.abs(g) + np.abs(J.T) @ np.abs(r))] = 0.0
        return Quadratic(J, r, left, np.linalg.norm(J, axis=0))

    @staticmethod
    def of_parts(size: int, parts: Iterable[Part]) -> Quadratic:
        """The sum of costs, by v (size,)."""
        J, r, left, squares = [np.zeros((0, size))], [np.zeros(0)], np.zeros(size), np.zeros(size)
        for cost, rows, offset in parts:
            left = left + rows.T @ cost.l
            if not len(cost.r):
                continue
            J.append(cost.J @ rows)
            r.append(cost.r + cost.J @ offset)
            squares += cost.sizes**2 @ rows**2
        return Quadratic(np.concatenate(J), np.concatenate(r), left, np.sqrt(squares))

    @property
    def H(self) -> np.ndarray:
        """Its Hessian."""
        return self.J.T @ self.J

    @property
    def g(self) -> np.ndarray:
        """Its gradient at v = 0."""
        return self.J.T @ self.r + self.l

    def least(self) -> np.ndarray:
        """v of the least value, 0 along directions that the cost does not determine."""
        units, left, sizes, right = self._directions()
        found = (left.T @ self.r)[: len(sizes)] / sizes
        found += right[: len(sizes)] @ (self.l / units) / sizes**2
        return -(right[: len(sizes)].T @ found) / units

    def spread(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """S with SSᵀ = H⁻¹ where the cost determines v, the columns of the other directions, and their units."""
        units, _, sizes, right = self._directions()
        return right[: len(sizes)].T / sizes / units[:, None], right[len(sizes) :].T, units

    def _directions(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The units of v, and left, sizes and right of J in them, of the sizes that count."""
        units = _units(self.sizes)
        left, sizes, right = _decomposed(self.J / units)
        return units, left, sizes, right


class Arrival(NamedTuple):
    """x̄ (nx,), the inverse of its directions (width, nx), a (width,), K (width, m), and the cost of θ."""

    node: np.ndarray
    inverse: np.ndarray
    offset: np.ndarray
    K: np.ndarray
    cost: Quadratic


def require_finite(*arrays: np.ndarray) -> None:
    """Raise OptimumError unless all are finite."""
    if not all(np.all(np.isfinite(array)) for array in arrays):
        raise OptimumError(
            "A function of the problem, or a derivative, is not finite about the estimate: `reset` forgets it."
        )


def cleaned(product: np.ndarray, *factors: np.ndarray) -> np.ndarray:
    """A product without the entries that are round-off of its sums."""
    bound = np.abs(factors[0])
    for factor in factors[1:]:
        bound = bound @ np.abs(factor)
    return np.where(np.abs(product) <= 1e-14 * bound, 0.0, product)


def least_to(cost: Quadratic, G: np.ndarray) -> tuple[np.ndarray, Quadratic]:
    """(K, V): the least cost of v as a function of Gv = Kθ, V(θ) = min {cost(v): Gv = Kθ}.

    v is in units of the cost, so that among changes that lead to the same θ the cheapest are taken.
    """
    held = cost.sizes[cost.sizes > 0]
    v_units = np.where(cost.sizes > 0, cost.sizes, np.min(held, initial=np.inf) if len(held) else 1.0)
    scaled = G / v_units
    y_units = np.linalg.norm(scaled, axis=1)
    y_units = np.where(y_units > 0, y_units, 1.0)
    left, sizes, right = np.linalg.svd(scaled / y_units[:, None], full_matrices=True)
    rank = int(np.sum(sizes > 1e-11 * max(float(np.max(sizes, initial=0.0)), 1e-300)))
    K, back = cleaned(y_units[:, None] * left[:, :rank], y_units[:, None] * 10), right[:rank].T / sizes[:rank]
    moving = np.any(G != 0, axis=1)
    if rank == np.sum(moving):
        K, back = np.eye(len(G))[:, moving], (back @ left[:, :rank].T / y_units)[:, moving]
    back, free = back / v_units[:, None], right[rank:].T / v_units[:, None]
    return K, _eliminated(cost, back, free, np.linalg.norm(v_units[:, None] * back, axis=0))


def _eliminated(cost: Quadratic, back: np.ndarray, free: np.ndarray, units: np.ndarray) -> Quadratic:
    """The least cost of v = back θ + free s over s; units: of θ."""
    of_theta, r, left = cost.J @ back, cost.r, back.T @ cost.l
    columns, sizes, right = _decomposed(cost.J @ free)
    columns = columns[:, : len(sizes)]
    left = left - of_theta.T @ columns @ (right[: len(sizes)] @ (free.T @ cost.l) / sizes)
    for _ in range(2):
        of_theta, r = of_theta - columns @ (columns.T @ of_theta), r - columns @ (columns.T @ r)
    units = _units(units)
    columns, sizes, right = _decomposed(of_theta / units)
    root = sizes[:, None] * right[: len(sizes)]
    root[np.abs(root) <= 1e-13] = 0.0
    return Quadratic(root * units, columns[:, : len(sizes)].T @ r, left, units)


def _units(sizes: np.ndarray) -> np.ndarray:
    """Norms of columns as units, none below a thousandth of the largest, and 1 where all are 0."""
    largest = float(np.max(sizes, initial=0.0))
    return np.maximum(sizes, 1e-3 * largest) if largest > 0 else np.ones(len(sizes))


def _decomposed(J: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Singular vectors and values of a matrix, the values without those that count as zero; all right vectors."""
    if len(J) > J.shape[1]:
        Q, R = np.linalg.qr(J)
        left, sizes, right = np.linalg.svd(R)
        left = Q @ left
    else:
        left, sizes, right = np.linalg.svd(J, full_matrices=True)
    return left, sizes[sizes > SMALL * max(1.0, float(np.max(sizes, initial=0.0)))], right
