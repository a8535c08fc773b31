"""Where an event ends a stepper: between two nodes, located as `co.simulate` locates one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.mechanics.state import State
from coadjoint.simulation.crossings import crossings, from_zero
from coadjoint.simulation.dense import part_of_step, sound
from coadjoint.simulation.events import Event
from coadjoint.simulation.plan import Plan


def ending(plan: Plan, event: Event, state: State, first: bool) -> tuple[State, bool]:
    """The state at the event in the step from `state`, and True; or the state after that step, and False.

    The event is a root of f(Φ_{θh}(state)). first: whether the stepper started at `state`: so near to a zero it starts
    from that zero, as a run does, and there is no event.
    Raises StepError where a part of the step cannot be solved.
    """
    free = replace(plan, program=replace(plan.program, until=None))
    value = tabulate(event.function, state)

    def after(theta: float) -> State:
        return sound(part_of_step(free, state, theta)).final

    whole = after(1.0)
    values = np.array([float(value(state)), float(value(whole))])
    if first and from_zero(values)[0] == 0:
        return whole, False
    found = crossings(values, 0, lambda theta: float(value(after(theta))))
    # Machine code has seen the change of sign; to round-off it may lie at the node.
    theta = next((crossing.theta for crossing in found if event.counts(crossing.rises)), 1.0)
    return after(theta), True
