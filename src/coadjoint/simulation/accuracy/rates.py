"""The fastest rate of the linearised motion that is excited: an eigenvalue of the flow over a very short step."""

from __future__ import annotations

from typing import Any

import numpy as np

from coadjoint.simulation.accuracy.doubling import Doubling

SHORT = 1e-3
"""The part of a step over which the flow is linearised: its rates are those of the equations, not of the method."""

NUDGE = 1e-6
"""The difference, relative to each kind of coordinate, by which it is linearised."""

SLOWEST = 1e-9
"""Rates below this, over that part of a step, are round-off."""

EXCITED = 1e-3
"""How far a mode is from where it rests, relative to the state, to count as excited."""

LARGEST = 24
"""The most coordinates (μ, n, π, a) of a system whose rates are given."""


def fastest_rate(doubling: Doubling, row: np.ndarray, h: float, whose: Any) -> float | None:
    """h·max|λ| over the excited modes of ẋ = Ax + f at a record, x = (μ, n, π, a); None where it is not known.

    A mode v with eigenvalue λ is excited by |c|/|λ|, f = Σ c v: how far it is from where it would stay.
    """
    places, system = doubling.places, doubling.plan.program.skeleton
    kinds = [np.ravel(x).astype(int) for x in (places.mu, places.n, places.pi, places.a) if np.size(x)]
    index = np.concatenate(kinds)
    if doubling.plan.backend != "native" or not system.additional.flat or len(index) > LARGEST:
        return None
    sizes = np.concatenate([np.full(len(kind), np.max(np.abs(row[kind])) or 1.0) for kind in kinds])
    step, count = SHORT * h, len(index)
    rows = np.repeat(row[None], 2 * count + 1, axis=0)
    for i, place in enumerate(index):
        rows[i, place] += NUDGE * sizes[i]
        rows[count + i, place] -= NUDGE * sizes[i]
    members = None if whose is None else np.repeat(whose, len(rows))
    after, good = doubling.over(rows, np.full(len(rows), step), (1.0,), members)
    if not good.all():
        return None
    ends = after[:, index] / sizes
    flow = (ends[:count] - ends[count:-1]).T / (2 * NUDGE)
    return _excited(flow, (ends[-1] - row[index] / sizes), SHORT)


def _excited(flow: np.ndarray, moved: np.ndarray, short: float) -> float | None:
    """The largest |λ|h of the flow over short·h whose mode has a share in what moved."""
    values, modes = np.linalg.eig(flow)
    # The flow of every method of order 1 and more is (1 + z/2)/(1 − z/2) up to small terms, z = short·hλ.
    z = 2 * (values - 1) / (values + 1)
    try:
        shares = np.linalg.solve(modes, moved.astype(complex))
    except np.linalg.LinAlgError:
        return None
    away = np.abs(shares) * np.max(np.abs(modes), axis=0) / np.maximum(np.abs(z), SLOWEST)
    excited = (np.abs(z) > SLOWEST) & (away > EXCITED)
    return float(np.max(np.abs(z[excited]), initial=0.0) / short)
