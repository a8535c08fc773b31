"""Warnings about the energy of a run: where it is not known, and where it changed though nothing may change it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from coadjoint.mechanics.each import member_of
from coadjoint.mechanics.inverse_legendre import SOLVED
from coadjoint.mechanics.ledger import energy_lines
from coadjoint.simulation.driver import Memory

if TYPE_CHECKING:
    from coadjoint.mechanics.system import System
    from coadjoint.simulation.ensemble import Ensemble
    from coadjoint.simulation.run import Run

TOO_MUCH = 0.1
"""The relative change of a conserved energy from which on the card warns."""
GAINED = 1e-3
"""What passive forces put in, relative to the largest energy that they have changed, from which on the card warns."""

LISTED = 10
"""How many members a warning lists."""


def energy_known(run: Run) -> bool:
    """Whether the velocities at all nodes were found, on which the Legendre energy rests."""
    return "legendre_residual" not in run.extrema or run.largest("legendre_residual") <= SOLVED


def energy_warnings(run: Run) -> list[str]:
    """A sentence each for an energy that is not known, and for one that changed."""
    if not energy_known(run):
        much = run.largest("legendre_residual")
        return [
            "The energy is not known at every node, nor what follows from it: the velocities could not be found from "
            f"the momenta there (the inverse Legendre transform leaves a residual of {much:.1e}). Look whether ∂ℓ can "
            "be solved for the velocities, or take the discrete energy."
        ]
    return [*_changed(run), *driven(run)]


def _changed(run: Run) -> list[str]:
    driven = energy_lines(run.system) or run.system.takes("inputs") or run.system.takes("internal")
    if driven or "energy" not in run.extrema or run.relative_change("energy") < TOO_MUCH:
        return []
    return [
        f"The energy, which nothing changes, is off by {run.relative_change('energy'):.0%}: dt = {run.dt:g} is too "
        "large for this motion, or functions of the system contradict each other, such as a space's `diamond` and its "
        "`act`."
    ]


class _Gain(NamedTuple):
    """Energy that passive forces have put in between records: whose, how much, and from when on, s."""

    names: str
    energy: float
    first: float


def driven(run: Run) -> list[str]:
    """A sentence where passive forces have put energy in between two records, also of a run whose step failed."""
    gain = _gain(run.system, run.system.parameters, run.monitors, lambda: _times(run))
    return [f"{_told(run.system, gain)}."] if gain else []


def _times(run: Run) -> np.ndarray:
    """The times of the saved nodes, s; of a run on disk its dataset is read, and read again with all warnings."""
    if isinstance(run.memory, Memory):
        return np.asarray(run.records.t)
    found = run.dataset["time"].values
    run.__dict__.pop("dataset", None)
    return found


def members_driven(ensemble: Ensemble) -> list[str]:
    """A sentence where passive forces have put energy into members: that of the most, and the others by number."""
    if not any(hasattr(force, "passive") for _, force in ensemble.system.forces or ()):
        return []
    t, parameters = np.asarray(ensemble.records.t), ensemble.system.parameters
    gains: dict[int, _Gain] = {}
    for member in range(len(t)):
        good = np.isfinite(t[member])
        rows = {name: values[member][good] for name, values in ensemble.monitors.items()}
        if gain := _gain(ensemble.system, member_of(parameters, member), rows, partial(_of, t[member][good])):
            gains[member] = gain
    if not gains:
        return []
    most = max(gains, key=lambda member: gains[member].energy)
    others = [str(member) for member in gains if member != most]
    shown = ", ".join(others[:LISTED]) + (", …" if len(others) > LISTED else "")
    also = f"; so in {len(others)} more of {len(t)} members: {shown}" if others else ""
    return [f"In member {most} {_told(ensemble.system, gains[most])}{also}."]


def _of(times: np.ndarray) -> np.ndarray:
    return times


def _told(system: System, gain: _Gain) -> str:
    energy = f"{gain.energy:.4g} {dict(system.units).get('energy', '')}".strip()
    return (
        f"{gain.names}, which should only brake, put in {energy}, from t = {gain.first:.4g} s on: their coefficients "
        "do not hold for such motions"
    )


def _gain(
    system: System, parameters: Any, monitors: Mapping[str, np.ndarray], times: Callable[[], np.ndarray]
) -> _Gain | None:
    """What passive forces have put in; `times` of the nodes are asked for where they did.

    A force is one if it has an attribute `passive`, a function of the parameters that is true of those of the run. The
    work of all of them together is looked at, since the lift of one may do work on the drag of another.
    """
    forces = system.forces or ()
    names = [name for name, force in forces if getattr(force, "passive", _active)(parameters)]
    if not names or any(f"work_{name}" not in monitors for name in names):
        return None
    work = np.sum([monitors[f"work_{name}"] for name in names], axis=0)
    gained = np.cumsum(np.maximum(np.diff(work), 0.0))
    least = GAINED * max(float(np.ptp(work)), float(np.ptp(monitors["energy"])) if "energy" in monitors else 0.0)
    if len(gained) == 0 or not gained[-1] > least:
        return None
    whose = ", ".join(f"`{name}`" for name in names)
    return _Gain(whose, float(gained[-1]), float(times()[int(np.argmax(gained > least))]))


def _active(p: object) -> bool:
    return False
