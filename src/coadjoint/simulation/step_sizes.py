"""The nodes of a run: at whole multiples of dt, or wherever a variable method or an event has led to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.mechanics.state import State
from coadjoint.methods.program import StepProgram

if TYPE_CHECKING:
    from coadjoint.simulation.run import Run


def times(program: StepProgram, start: State, h: float, steps: np.ndarray, records: State) -> np.ndarray:
    """The times of records, s."""
    if program.method.variable or program.events:
        return np.asarray(records.t)
    return np.ravel(start.t)[0] + h * steps


def step_sizes(run: Run) -> dict[str, Any]:
    """Where a variable method ended, how many of its steps were fixed, and the bounds of h where it was monitored."""
    if not run.method.variable:
        return {}
    state = run.position.state
    found = {"time_final": float(state.t), "steps_fixed": round(float(state.memory.fixed))}
    if "step_size" in run.extrema:
        low, high = run.extrema["step_size"]
        found |= {"step_size_min": float(low), "step_size_max": float(high)}
    return found


def sentence(run: Run) -> str:
    """The step sizes in words."""
    found = step_sizes(run)
    bounds = f"{found['step_size_min']:.4g} to {found['step_size_max']:.4g} s, " if "step_size_min" in found else ""
    return f"{bounds}to t = {found['time_final']:.6g} s; {share(run)}"


def share(run: Run) -> str:
    """How many steps were fixed."""
    fixed, steps = step_sizes(run)["steps_fixed"], max(run.good_steps, 1)
    if not fixed:
        return "no step fixed"
    return f"{fixed:,} of {steps:,} steps ({fixed / steps:.2%}) fixed at dt"


def fixed_steps(run: Run) -> list[str]:
    """A warning where the method fell back to fixed steps: over those the discrete energy is not held."""
    found = step_sizes(run)
    if not found.get("steps_fixed"):
        return []
    return [
        f"{share(run).capitalize()}: no other h holds the energy there, or any h does, as at a relative equilibrium. "
        "Try the base co.Simpson(), or a smaller dt."
    ]
