"""The certificate of a run as plain numbers."""

from __future__ import annotations

import numpy as np

from coadjoint.kernels.newton.coupled import Factors
from coadjoint.kernels.program import Code
from coadjoint.simulation import energy_budget
from coadjoint.simulation.monitors import changing, residuals
from coadjoint.simulation.result import Result
from coadjoint.texts import Table


def certificate(run: Result) -> dict[str, object]:
    """The certificate under plain names; errors are maxima over every step, relative unless the start is zero.

    That of an ensemble has the system, the method, the accuracy and the time alone.
    """
    found: Table = {"system": run.system.name, "method": run.method.title}
    times = {"seconds": run.seconds, "set_up_seconds": run.set_up_seconds}
    accuracy = {} if run.accuracy is None else run.accuracy.numbers()
    if run.members is not None:
        return {**found, "dt": run.plan.h, **times, **accuracy}
    found |= {"steps": run.good_steps, "dt": run.plan.h, "newton_iterations_mean": iterations(run)}
    found |= {"newton_iterations_max": run.position.iterations_max, **times}
    if (renewals := factor_renewals(run)) is not None:
        found["factor_renewals"] = renewals
    if run.plan.until:
        found["event"] = run.event
        if name := run.plan.events[0][1].title:
            found["event_name"] = name
    if run.crossed:
        found["events"] = {name: len(states) for name, states in run.crossed.items()}
    found |= step_sizes(run)
    found |= accuracy
    if not run.count:
        return found
    for name, _ in changing(run.system):
        if name in run.ends:
            first, last = run.ends[name]
            found[f"{name}_initial"] = first.tolist()
            found[f"{name}_error_max"] = float(run.relative_changes(name))
            found[f"{name}_error_final"] = float(np.linalg.norm(last - first)) / (float(run.sizes(name)) or 1.0)
    found |= energy_budget.budget(run)
    if "kelvin_noether_budget" in run.ends:
        found["kelvin_noether_budget_error_max"] = energy_budget.momentum_gap(run)
    for one in residuals():
        if one.name in run.extrema:
            found[f"{one.name}_max"] = float(np.max(run.extrema[one.name][1]))
    return found


def failure(run: Result, member: int) -> str:
    """How a member failed, and at which step."""
    code = Code(int(run.position.codes[member]))
    return f"{code.name.lower().replace('_', ' ')} at step {run.position.steps_done[member]}"


def factor_renewals(run: Result) -> int | None:
    """How many times factors that pass from step to step were computed, over all members; None without factors."""
    memory = run.position.state.memory
    return int(np.sum(memory.renewals)) if isinstance(memory, Factors) else None


def iterations(run: Result) -> float:
    """Newton's iterations a step."""
    return float(np.sum(run.position.iterations)) / max(run.good_steps, 1)


def step_sizes(run: Result) -> Table:
    """Where a variable method ended, how many of its steps were fixed, and the bounds of h where it was monitored."""
    if not run.method.variable:
        return {}
    state = run.position.state
    found = {"time_final": float(state.t), "steps_fixed": round(float(state.memory.fixed))}
    if "step_size" in run.extrema:
        low, high = run.extrema["step_size"]
        found |= {"step_size_min": float(low), "step_size_max": float(high)}
    return found


def share(run: Result) -> str:
    """How many steps were fixed."""
    fixed, steps = step_sizes(run)["steps_fixed"], max(run.good_steps, 1)
    if not fixed:
        return "no step fixed"
    return f"{fixed:,} of {steps:,} steps ({fixed / steps:.2%}) fixed at dt"


def fixed_steps(run: Result) -> list[str]:
    """A warning where the method fell back to fixed steps: over those the discrete energy is not held."""
    if not step_sizes(run).get("steps_fixed"):
        return []
    return [
        f"{share(run).capitalize()}: no other h holds the energy there, or any h does, as at a relative equilibrium. "
        "Try the base co.Simpson(), or a smaller dt."
    ]
