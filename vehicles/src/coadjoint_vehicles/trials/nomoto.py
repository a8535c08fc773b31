"""Nomoto's first-order model of steering."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from coadjoint.errors import ArgumentError


class Nomoto(NamedTuple):
    """T ṙ + r = K (δ + δ₀): gain (1/s), time_constant T (s), neutral δ₀ (rad), and `deviation`, rad, of the heading.

    T < 0 where the vehicle is unstable on a straight course.
    """

    gain: float
    time_constant: float
    neutral: float
    deviation: float


def nomoto(time: np.ndarray, heading: np.ndarray, rate: np.ndarray, integral: np.ndarray, *, held: bool) -> Nomoto:
    """K, T and δ₀ of a manoeuvre by least squares on the integral of the model,

        ψ(t) − ψ(t₀) = K ∫ δ dt + K δ₀ (t − t₀) − T (r(t) − r(t₀)),

    which needs no derivative of the rate. The arguments, (n,) each: s, rad, rad/s, and ∫ δ dt, rad s. held: whether one
    order is held throughout, which says nothing about δ₀: it counts as 0. Raises ArgumentError where the rudder does
    not move the heading.
    Source: Nomoto, Taguchi, Honda and Hirano (1957); ITTC 7.5-04-02-01.
    """
    columns = np.stack([integral - integral[0], -(rate - rate[0]), time - time[0]][: 2 if held else 3], axis=1)
    wanted = heading - heading[0]
    scale = np.linalg.norm(columns, axis=0)
    if np.any(scale == 0):
        raise ArgumentError("K and T need a rudder that is put over and a heading that answers: both stay at 0.")
    found, *_ = np.linalg.lstsq(columns / scale, wanted, rcond=None)
    gain, constant, *drift = found / scale
    residual = columns @ (found / scale) - wanted
    neutral = float(drift[0] / gain) if drift else 0.0
    return Nomoto(float(gain), float(constant), neutral, float(np.sqrt(np.mean(residual**2))))
