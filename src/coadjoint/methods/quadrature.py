"""Gauss's quadrature, the polynomials that its nodes carry, and those through Lobatto's points."""

from __future__ import annotations

from functools import lru_cache
from math import prod
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


class Lobatto(NamedTuple):
    """Lobatto's points p_0 = 0, …, p_s = 1, and polynomials of degree s through them, M_j, at Gauss's s nodes c_i.

    value = M_j(c_i) and slope = M_j′(c_i), (s, s + 1). reach = ∫₀^{p_j} L_i for j = 1, …, s, (s, s), with Gauss's L_i:
    the points follow from velocities at the nodes.
    """

    value: np.ndarray
    slope: np.ndarray
    reach: np.ndarray


@lru_cache
def lobatto(degree: int) -> Lobatto:
    """The points of a polynomial of a degree s at Gauss's s nodes."""
    inner = np.polynomial.legendre.Legendre.basis(degree).deriv().roots() if degree > 1 else np.zeros(0)
    points = 0.5 * (1 + np.concatenate([[-1.0], np.sort(np.real(inner)), [1.0]]))
    nodes, through = gauss(degree).c, _basis(points)
    return Lobatto(
        value=np.stack([M(nodes) for M in through], axis=1),
        slope=np.stack([M.deriv()(nodes) for M in through], axis=1),
        reach=np.stack([L.integ()(points[1:]) for L in _basis(nodes)], axis=1),
    )


def _basis(points: np.ndarray) -> list[np.polynomial.Polynomial]:
    """Lagrange's polynomials of points."""
    others = [[np.polynomial.Polynomial([-q, 1.0]) / (p - q) for q in points if q != p] for p in points]
    return [prod(factors, start=np.polynomial.Polynomial([1.0])) for factors in others]
