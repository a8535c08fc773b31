"""The zero of a function of one number."""

from __future__ import annotations

import math
from collections.abc import Callable

MOST = 2000
"""The largest number of evaluations; Brent's bound is the square of the 50 to 60 that bisection takes."""


def brent(f: Callable[[float], float], a: float, b: float, xtol: float = 1e-15, rtol: float = 4 * 2.0**-52) -> float:
    """The zero of f between a and b, where f has different signs, to xtol + rtol·|x|.

    Secants and inverse quadratic interpolation where they come nearer fast enough, bisection elsewhere; SciPy's
    `brentq` gives the same numbers and takes a third of a second to load. Raises ValueError where the signs are equal,
    and where f is NaN.

    Source: R. P. Brent, Algorithms for Minimization without Derivatives, 1973, chapter 4.
    """
    before, here = a, b
    f_before, f_here = f(before), f(here)
    if f_before == 0:
        return before
    if f_here == 0:
        return here
    if math.isnan(f_before) or math.isnan(f_here):
        raise ValueError(f"f must be a number at a = {a:g} and b = {b:g}.")
    if _same_sign(f_before, f_here):
        raise ValueError(f"f must have different signs at a = {a:g} and b = {b:g}.")
    across, f_across, last, move = before, f_before, 0.0, 0.0
    for _ in range(MOST):
        if f_before != 0 and f_here != 0 and not _same_sign(f_before, f_here):
            across, f_across = before, f_before
            last = move = here - before
        if abs(f_across) < abs(f_here):
            before, here, across = here, across, here
            f_before, f_here, f_across = f_here, f_across, f_here
        near, middle = (xtol + rtol * abs(here)) / 2, (across - here) / 2
        if f_here == 0 or abs(middle) < near:
            return here
        step = None
        if abs(last) > near and abs(f_here) < abs(f_before):
            if before == across:
                trial = -f_here * (here - before) / (f_here - f_before)
            else:
                slope = (f_before - f_here) / (before - here)
                slope_across = (f_across - f_here) / (across - here)
                below = slope_across * slope * (f_across - f_before)
                trial = -f_here * (f_across * slope_across - f_before * slope) / below if below else math.inf
            if 2 * abs(trial) < min(abs(last), 3 * abs(middle) - near):
                step = trial
        last, move = (middle, middle) if step is None else (move, step)
        before, f_before = here, f_here
        here += move if abs(move) > near else math.copysign(near, middle)
        f_here = f(here)
        if math.isnan(f_here):
            break
    raise ValueError(f"No zero was found between {a:g} and {b:g}: f({here:g}) = {f_here:g}.")


def _same_sign(x: float, y: float) -> bool:
    return math.copysign(1.0, x) == math.copysign(1.0, y)
