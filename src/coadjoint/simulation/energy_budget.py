"""The energy of a run: its budget, and warnings where it is not known, or changed though nothing may change it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.groups.overrides import own
from coadjoint.mechanics.inverse_legendre import SOLVED
from coadjoint.mechanics.members import member_of
from coadjoint.mechanics.system import System
from coadjoint.mechanics.work_balance import energy_lines
from coadjoint.simulation.result import Result
from coadjoint.spaces.space import Space
from coadjoint.texts import Table

POORLY = 0.1
"""The relative gap of a budget above which the certificate warns."""


def budget(run: Result) -> Table:
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


def momentum_gap(run: Result) -> float:
    """The largest change of the Kelvin–Noether quantities less the impulse of forces, relative to their largest."""
    first, (low, high) = run.ends["kelvin_noether_budget"][0], run.extrema["kelvin_noether_budget"]
    change = float(np.linalg.norm(np.maximum(high - first, first - low)))
    size = float(np.linalg.norm(np.max(np.abs(run.extrema["kelvin_noether"]), axis=0)))
    return change / (size or 1.0)


def _widest(run: Result, name: str) -> float:
    """The largest change of a monitored number since the start, over every step."""
    first, (low, high) = run.ends[name][0], run.extrema[name]
    return float(np.maximum(high - first, first - low))


def in_words(run: Result) -> str:
    """The budget as text."""
    found = budget(run)
    parts = []
    for line in energy_lines(run.system):
        energy = found[f"work_{line}_change"]
        parts.append(f"{line} {'took' if energy < 0 else 'put in'} {abs(energy):.6g}")
    stored = next(value for name, value in found.items() if name.endswith("energy_change"))
    return f"stored {stored:.6g}; {', '.join(parts)}; closes to {found['energy_budget_error_max']:.1e}, relative"


def gap(run: Result) -> list[str]:
    """A warning where the budget closes poorly: the step does not resolve the motion."""
    much = budget(run).get("energy_budget_error_max", 0.0)
    if much < POORLY:
        return []
    return [f"The energy budget closes only to {much:.0%}: the motion or a force is too fast for dt = {run.plan.h:g}."]


TOO_MUCH = 0.1
"""The relative change of a conserved energy above which the certificate warns."""
GAINED = 1e-3
"""The energy put in by passive forces, relative to the largest that they changed, above which the certificate warns."""

LISTED = 10
"""How many members a warning lists."""
BLOCK = 1 << 20
"""How many values of a monitor are read together: it limits the members of one read."""


def energy_known(run: Result) -> bool:
    """Whether the velocities at all nodes were found, on which the Legendre energy rests."""
    return "legendre_residual" not in run.extrema or float(np.max(run.extrema["legendre_residual"][1])) <= SOLVED


def energy_warnings(run: Result) -> list[str]:
    """One warning for an unknown energy, or warnings for an energy that changed."""
    if not energy_known(run):
        much = float(np.max(run.extrema["legendre_residual"][1]))
        return [
            "The energy is not known at every node, nor what follows from it: the velocities could not be found from "
            f"the momenta there (the inverse Legendre transform leaves a residual of {much:.1e}). Look whether ∂ℓ can "
            "be solved for the velocities, or take the discrete energy."
        ]
    return [*_changed(run), *driven(run)]


def _changed(run: Result) -> list[str]:
    driven = energy_lines(run.system) or run.system.takes("inputs") or run.system.takes("internal")
    if (
        driven
        or run.method.claims.energy == "changed"
        or "energy" not in run.extrema
        or (change := _change_of_energy(run)) < TOO_MUCH
    ):
        return []
    off = f"The energy, which nothing changes, is off by {change:.0%}"
    if run.accuracy is not None and run.accuracy.resolved:
        why = "the steps are accurate (line `accuracy`), but their errors add up: compare with a run of dt/2"
    else:
        why = f"dt = {run.plan.h:g} is too large for this motion"
    places = run.system.places
    if any(own(space, Space) for space in places[1:]):
        why += ", or functions of the system contradict each other, such as a space's `diamond` and its `act`"
    return [f"{off}: {why}."]


def _change_of_energy(run: Result) -> float:
    """The largest change relative to the larger of the energy at the start and, where it then is too much, the largest
    kinetic energy."""
    size, change = max(abs(float(run.ends["energy"][0])), np.finfo(float).tiny), _widest(run, "energy")
    return change / (size if change < TOO_MUCH * size else max(float(run._kinetic()), size))


class _Gain(NamedTuple):
    """Energy put in by passive forces: the names of the forces, a lower bound, and the first time, s.

    `first` is None if records do not show the gain.
    """

    names: str
    energy: float
    first: float | None


class _Watched(NamedTuple):
    """The observations of a run: monitors at the saved nodes, (minimum, maximum) over all steps, times of the nodes."""

    rows: Mapping[str, np.ndarray]
    extrema: Mapping[str, tuple[float, float]]
    times: np.ndarray


def driven(run: Result) -> list[str]:
    """A warning if passive forces have put energy in, also for a run whose step failed."""
    rows = run.rows_of(_asked(run))
    extrema = {name: (float(run.extrema[name][0]), float(run.extrema[name][1])) for name in rows}
    gain = _gain(run.system, run.system.parameters, _Watched(rows, extrema, run.node_times())) if rows else None
    return [f"{_told(run.system, gain)}."] if gain else []


def members_driven(ensemble: Result) -> list[str]:
    """A warning if passive forces have put energy into members: it describes the largest gain and lists the others."""
    asked = _asked(ensemble)
    if not asked or ensemble.members is None:
        return []
    times, parameters, extrema = ensemble.node_times(), ensemble.system.parameters, ensemble.extrema
    count, gains = ensemble.members, dict[int, _Gain]()
    block = max(BLOCK // len(times), 1)
    for first in range(0, count, block):
        rows = ensemble.rows_of(asked, slice(first, first + block))
        for member in range(first, min(first + block, count)):
            own = {name: values[member - first] for name, values in rows.items()}
            good = np.all([np.isfinite(values) for values in own.values()], axis=0)
            between = {name: (extrema[name][0][member], extrema[name][1][member]) for name in own}
            watched = _Watched({name: values[good] for name, values in own.items()}, between, times[good])
            if gain := _gain(ensemble.system, member_of(parameters, member), watched):
                gains[member] = gain
    if not gains:
        return []
    most = max(gains, key=lambda member: gains[member].energy)
    others = [str(member) for member in gains if member != most]
    shown = ", ".join(others[:LISTED]) + (", …" if len(others) > LISTED else "")
    also = f"; so in {len(others)} more of {count} members: {shown}" if others else ""
    return [f"In member {most} {_told(ensemble.system, gains[most])}{also}."]


def _asked(run: Result) -> list[str]:
    """The monitors that show passive forces; empty without such forces, or if their work is not observed."""
    names = [f"work_{name}" for name, force in run.system.forces or () if hasattr(force, "passive")]
    if not names or any(name not in run.ends for name in names):
        return []
    return [*names, *(name for name in ("energy", "energy_budget") if name in run.ends)]


def _told(system: System, gain: _Gain) -> str:
    energy = f"{gain.energy:.4g} {dict(system.units).get('energy', '')}".strip()
    when = "between two saved nodes" if gain.first is None else f"from t = {gain.first:.4g} s on"
    why = "their coefficients do not hold for such motions"
    return f"{gain.names}, which should only brake, put in {energy}, {when}: {why}"


def _gain(system: System, parameters: PyTree, watched: _Watched) -> _Gain | None:
    """The energy that passive forces have put in.

    A force is passive if its attribute `passive`, a function of the parameters, is true for those of the run. The total
    work of these forces is examined, because the lift of one may do work on the drag of another.
    """
    names = [name for name, force in system.forces or () if getattr(force, "passive", _active)(parameters)]
    if not names or len(watched.times) == 0:
        return None
    rows, whose = watched.rows, ", ".join(f"`{name}`" for name in names)
    work = np.sum([rows[f"work_{name}"] for name in names], axis=0)
    gained = np.cumsum(np.maximum(np.diff(work), 0.0))
    energy = float(np.ptp(rows["energy"])) if "energy" in rows else 0.0
    least = GAINED * max(float(np.ptp(work)), energy)
    between = _between(system, names, work, watched.extrema)
    if len(gained) and gained[-1] > least:
        first = float(watched.times[int(np.argmax(gained > least))])
        return _Gain(whose, max(float(gained[-1]), between), first)
    return _Gain(whose, between, None) if between else None


def _between(system: System, names: list[str], work: np.ndarray, extrema: Mapping[str, tuple[float, float]]) -> float:
    """A lower bound of the energy put in by passive forces, by the extrema of their work over all steps; 0 if small.

    work: the total at the nodes, (nodes,). The extrema of W are those of a single passive force. If nothing else
    changes the energy E, they follow from those of E and of the budget E − W: W ≥ E − max(E − W) at the step where E is
    largest, W ≤ E − min(E − W) at the step where E is smallest. Otherwise they are unknown.
    """
    if len(names) == 1:
        low, high = extrema[f"work_{names[0]}"]
    elif set(names) == set(energy_lines(system)) and {"energy", "energy_budget"} <= set(extrema):
        budget = extrema["energy_budget"]
        low, high = extrema["energy"][0] - budget[0], extrema["energy"][1] - budget[1]
    else:
        return 0.0
    span = extrema["energy"][1] - extrema["energy"][0] if "energy" in extrema else 0.0
    found = max(high - work[0], work[-1] - low)
    return float(found) if found > GAINED * max(high - low, float(np.ptp(work)), span) else 0.0


def _active(p: object) -> bool:
    return False
