"""Infeasible problems: the motion with the least sum of violations shows which constraint resists."""

from __future__ import annotations

import numpy as np

from coadjoint.control.library import INTERRUPTED, IPOPT, casadi
from coadjoint.control.program import NonlinearProgram
from coadjoint.errors import Interrupted

KEPT = (
    "the equations of motion",
    "the course of",
    "the joint of",
    "the start",
    "the velocities of the start",
    "the shared",
)
"""The prefixes of constraints that define a motion, which are never violated."""

MOST = 200
"""Iterations of the solver."""


def resisting(program: NonlinearProgram, first: np.ndarray) -> tuple[str, float] | None:
    """The constraint that a motion within the bounds of its inputs must violate most, and by how much:

        min Σ (s⁺ + s⁻)   subject to   lower ≤ g(w) + s⁺ − s⁻ ≤ upper,  s⁺, s⁻ ≥ 0, and 0 for the equations of motion.

    first: the start of the solver. None if it finds no such motion, or one without violations.
    """
    ca = casadi()
    kept = np.concatenate([np.full(b.nodes * len(b.rows.lower), b.rows.what.startswith(KEPT)) for b in program.blocks])
    soft = np.flatnonzero(~kept)
    if not len(soft):
        return None
    s = ca.MX.sym("s", 2 * len(soft))
    above, below = s[: len(soft)], s[len(soft) :]
    place = ca.DM.triplet(soft.tolist(), list(range(len(soft))), ca.DM.ones(len(soft)), len(kept), len(soft))
    g = program.g + place @ (above - below)
    own = IPOPT | {"max_iter": MOST, "print_level": 0}
    options = {"print_time": False, "error_on_fail": False, "show_eval_warnings": False, "ipopt": own}
    lower, upper = program.limits
    low, high = (
        np.concatenate([side, np.full(2 * len(soft), end)])
        for side, end in zip(program.bounds, (0.0, np.inf), strict=True)
    )
    try:
        values = ca.Function("g", [program.w], [program.g])
        gap = np.nan_to_num(values(first).full().ravel(), posinf=1.0, neginf=1.0)[soft]
        slack = np.maximum(np.concatenate([lower[soft] - gap, gap - upper[soft]]), 0.1)
        solver = ca.nlpsol("nearest", "ipopt", {"x": ca.vertcat(program.w, s), "f": ca.sum1(s), "g": g}, options)
        found = solver(x0=np.concatenate([first, slack]), lbx=low, ubx=high, lbg=lower, ubg=upper)
    except (RuntimeError, SystemError) as error:
        if "KeyboardInterrupt" in f"{error} {error.__cause__!r}":
            raise Interrupted("Interrupted in the solver.") from None
        return None
    stats = solver.stats()
    if stats.get("return_status") in INTERRUPTED:
        raise Interrupted("Interrupted in the solver.")
    if not stats["success"]:
        return None
    left = values(found["x"][: len(first)]).full().ravel()
    return program.worst(np.where(kept, np.clip(left, lower, upper), left))
