"""Gauss's quadrature, and the polynomials that its nodes carry."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np


class Gauss(NamedTuple):
    """Nodes c_i and weights b_i on [0, 1], and values of Lagrange's polynomials L_j of the nodes.

    `until` = ∫₀^{c_i} L_j, the a_ij of Butcher; `half` = ∫₀^½ L_j; `centred` = ∫_½^{c_i} L_j;
    `middle` = L_j(½); `ahead` = L_j(1 + c_i).

    All have shapes of s nodes: (s,), and (s, s) those of nodes and polynomials.
    """

    c: np.ndarray
    b: np.ndarray
    until: np.ndarray
    half: np.ndarray
    centred: np.ndarray
    middle: np.ndarray
    ahead: np.ndarray


@lru_cache
def gauss(count: int) -> Gauss:
    """Gauss's quadrature with `count` nodes, exact for polynomials of degree 2·count − 1."""
    x, w = np.polynomial.legendre.leggauss(count)
    c, b = 0.5 * (1 + x), 0.5 * w
    same = np.eye(count, dtype=bool)

    def basis(t: np.ndarray):
        """L_j(t), j along the last axis."""
        ratio = (t[..., None, None] - c) / np.where(same, 1.0, c[:, None] - c)
        return np.prod(np.where(same, 1.0, ratio), axis=-1)

    def integral(end: np.ndarray) -> np.ndarray:
        """∫₀^end L_j, by the quadrature itself."""
        return end[:, None] * (b @ basis(end[:, None] * c))

    middle = np.array([0.5])
    until, half = integral(c), integral(middle)[0]
    # Antisymmetrised about the middle, exact to the last digit.
    centred = 0.5 * ((until - half) - (until - half)[::-1, ::-1])
    return Gauss(c, b, until, half, centred, basis(middle)[0], basis(1 + c))
