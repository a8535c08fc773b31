"""What speaks against the length of some steps: their local error, and how far they turn. Knows NumPy only."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from coadjoint.simulation.accuracy.metric import KEPT
from coadjoint.simulation.accuracy.parts import Errors, PartsOfSteps

TOO_MUCH, TOO_MUCH_OF_ORDER_ONE = 0.05, 0.1
"""The local error, relative to the motion over a step, from which on a motion is not resolved."""

ENVELOPE = 1.0
"""The angle, rad, by which a step may turn a body (the supported envelope), unless its local error is small."""

EXACT = 0.02
"""The local error, relative to the limit, below which a step may turn further: about a fixed axis, or of high order."""

HALVINGS = 24
"""How often dt is halved at most in search of one that would do."""


class Verdict(NamedTuple):
    """The worst of some steps: its local error, of which part of the state, when, and which it is among the good ones;
    the largest turn of a step, rad; what speaks against dt, and for each reason a dt that would do."""

    size: float
    part: str
    when: float
    worst: int
    turn: float
    reasons: list[str]
    fine: list[float]


def verdict(
    parts: PartsOfSteps, rows: np.ndarray, h: np.ndarray, members: Any, errors: Errors, sizes: Any, dt: float,
    turns: bool = True,
) -> Verdict:  # fmt: skip
    """The verdict about steps of h (k,) from rows (k, size), by their errors, which are relative to sizes by name.

    turns: whether the turn is wanted where nothing depends on it, which costs eigenvalues of large groups.
    """
    good, order = errors.good, parts.order
    worst = int(np.argmax(errors.largest))
    limit = TOO_MUCH if order > 1 else TOO_MUCH_OF_ORDER_ONE
    size, part, when = float(errors.largest[worst]), errors.part[worst], float(rows[good][worst, parts.ruler.time])
    reasons, fine, turn = [], [], 0.0
    if turns or size > EXACT * limit:
        turn = float((np.abs(h) * parts.ruler.turning(rows[:, list(parts.ruler.xi)])).max())
    if not size < limit:
        reasons.append(f"one step is off by {size:.0%} of what it moves ({part}, t = {when:.4g} s)")
        given = rows[good][[worst]], h[good][[worst]], whose(members, good, worst)
        fine.append(_resolving(parts, *given, limit, sizes))
    if turn > ENVELOPE and size > EXACT * limit:
        reasons.append(f"a step turns by {turn:.2g} rad")
        fine.append(abs(dt) * 0.25 * ENVELOPE / turn)
    return Verdict(size, part, when, worst, turn, reasons, fine)


def whose(members: Any, good: np.ndarray, worst: int) -> Any:
    """The member of the worst step, as a row; None of a run."""
    return None if members is None else np.asarray(members)[good][[worst]]


def sentence(dt: float, reasons: Any, resolving: float | None) -> str:
    """What is warned of."""
    return (
        f"dt = {dt:g} does not resolve this motion: {'; '.join(reasons)}. Take dt = {resolving:.2g} or less. What is "
        "conserved does not tell."
    )


def _resolving(parts: PartsOfSteps, row, h, member, limit: float, sizes: dict[str, float]) -> float:
    """The largest dt = h/2^j whose local error, and that of the half of it, is under half the limit."""
    well = 0
    for halving in range(1, HALVINGS):
        step = h / 2**halving
        errors, _ = parts.errors(row, step, member, _local_sizes(sizes, halving), at_least=True)
        well = well + 1 if errors.good.all() and errors.largest[0] < 0.5 * limit else 0
        if well == 2:
            return float(abs(2 * step[0]))
    return float(abs(h[0]) / 2**HALVINGS)


def _local_sizes(sizes: dict[str, float], halving: int) -> dict[str, float]:
    """What is moved over a step shrinks with it, momenta do not."""
    return {name: size if name.startswith(KEPT) else size / 2**halving for name, size in sizes.items()}
