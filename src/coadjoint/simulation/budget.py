"""The energy budget of a run: what was stored, the work of each force, and how well this closes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.mechanics.work_balance import energy_lines

if TYPE_CHECKING:
    from coadjoint.simulation.run import Run

POORLY = 0.1
"""The relative gap of a budget from which on the card warns."""


def budget(run: Run) -> dict[str, Any]:
    """E_N − E_0, the work W of each force, and the largest |E_k − E_0 − ΣW_k| over every step.

    The last is relative to the largest of these energies.
    """
    if "energy_budget" not in run.ends:
        return {}
    stored = "energy" if "energy" in run.ends else "discrete_energy"
    names = [stored, *(f"work_{line}" for line in energy_lines(run.system))]
    size = max(float(np.max(np.abs(run.extrema[name]))) for name in names)
    return {
        **{f"{name}_change": float(run.ends[name][1] - run.ends[name][0]) for name in names},
        "energy_budget_error_max": _widest(run, "energy_budget") / (size or 1.0),
    }


def momentum_gap(run: Run) -> float:
    """The largest change of the Kelvin–Noether quantities less the impulse of forces, relative to their largest."""
    first, (low, high) = run.ends["kelvin_noether_budget"][0], run.extrema["kelvin_noether_budget"]
    change = float(np.linalg.norm(np.maximum(high - first, first - low)))
    size = float(np.linalg.norm(np.max(np.abs(run.extrema["kelvin_noether"]), axis=0)))
    return change / (size or 1.0)


def _widest(run: Run, name: str) -> float:
    """The largest change of a monitored number since the start, over every step."""
    first, (low, high) = run.ends[name][0], run.extrema[name]
    return float(np.maximum(high - first, first - low))


def sentence(run: Run) -> str:
    """The budget in words."""
    found = budget(run)
    parts = []
    for line in energy_lines(run.system):
        energy = found[f"work_{line}_change"]
        parts.append(f"{line} {'took' if energy < 0 else 'put in'} {abs(energy):.6g}")
    stored = next(value for name, value in found.items() if name.endswith("energy_change"))
    return f"stored {stored:.6g}; {', '.join(parts)}; closes to {found['energy_budget_error_max']:.1e}, relative"


def gap(run: Run) -> list[str]:
    """A warning where the budget closes poorly: the step does not resolve the motion."""
    much = budget(run).get("energy_budget_error_max", 0.0)
    if much < POORLY:
        return []
    return [f"The energy budget closes only to {much:.0%}: the motion or a force is too fast for dt = {run.dt:g}."]
