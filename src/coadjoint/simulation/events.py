"""Where a function of the motion crosses zero, located on the dense output."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import root_scalar

from coadjoint.errors import LagrangianError, StepError
from coadjoint.kernels import backend as kernels
from coadjoint.kernels.chunk import Chunk
from coadjoint.kernels.evaluate import evaluate, tabulate
from coadjoint.mechanics.check import require_float64
from coadjoint.mechanics.state import State
from coadjoint.simulation.driver import Plan

Event = Callable[[State], Any]


def require_event(until: Event | None, state: State) -> None:
    """Raise LagrangianError unless `until` is a function of a state whose value is one number."""
    if until is None:
        return
    if not callable(until):
        raise LagrangianError(f"Argument `until` must be a function of the state, but is {until!r}.")
    require_float64(until, "The function `until`", (state,))
    value = evaluate(until, state)
    if np.shape(value) != () or isinstance(value, dict) or np.asarray(value).dtype != float:
        raise LagrangianError(
            "The function `until` must return one number, which crosses zero at the event, such as "
            f"lambda state: state.q[2] - 10.0, but returned {value!r}."
        )
    if not np.isfinite(value):
        raise LagrangianError(f"The function `until` must be finite at the start, but is {value}.")


def without_event(plan: Plan) -> Plan:
    """The plan of the same steps, which no event ends."""
    return replace(plan, program=replace(plan.program, until=None))


def part_of_step(plan: Plan, state: State, fraction: float, monitors: bool = False) -> Chunk:
    """A step of fraction·h from a state, by the method itself."""
    return kernels.run(
        plan.backend, plan.program, plan.constants, state, fraction * plan.h, 1, 1, monitors and plan.monitors
    )


def sound(chunk: Chunk) -> Chunk:
    """The chunk itself; raises StepError where its step failed."""
    if chunk.code:
        what = chunk.code.name.lower().replace("_", " ")
        raise StepError(f"A step to a time between two nodes failed ({what}): take a smaller dt.")
    return chunk


def crossing(plan: Plan, state: State) -> float:
    """The part of the step from `state` after which `until` is zero: a root in (0, 1] of until(Φ_{θh}(state)).

    The dense output of a step is the method's own step of part θ: its momenta are as exact as those of the nodes, it
    lies on the group, and it is continuous with both. Raises StepError where such a step cannot be solved.
    """
    until, free = plan.program.until, without_event(plan)
    assert until is not None
    value = tabulate(until, state)
    start = float(value(state))

    def along(fraction: float) -> float:
        if fraction == 0.0:
            return start
        return float(value(sound(part_of_step(free, state, fraction)).final))

    if start * along(1.0) >= 0:
        return 1.0
    return root_scalar(along, bracket=(0.0, 1.0), method="brentq", xtol=1e-15, rtol=1e-14).root
