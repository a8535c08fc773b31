"""Warnings about the energy of a run: where it is not known, and where it changed though nothing may change it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from coadjoint.mechanics.inverse_legendre import SOLVED
from coadjoint.mechanics.ledger import energy_lines

if TYPE_CHECKING:
    from coadjoint.simulation.run import Run

TOO_MUCH = 0.1
"""The relative change of a conserved energy from which on the card warns."""
GAINED = 1e-3
"""What passive forces put in, relative to the largest energy that they have changed, from which on the card warns."""


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
    return [*_changed(run), *_driven(run)]


def _changed(run: Run) -> list[str]:
    driven = energy_lines(run.system) or run.system.takes("inputs") or run.system.takes("internal")
    if driven or "energy" not in run.extrema or run.relative_change("energy") < TOO_MUCH:
        return []
    return [
        f"The energy, which nothing changes, is off by {run.relative_change('energy'):.0%}: dt = {run.dt:g} is too "
        "large for this motion, or functions of the system contradict each other, such as a space's `diamond` and its "
        "`act`."
    ]


def _driven(run: Run) -> list[str]:
    """A sentence where passive forces have put energy in between two records.

    A force is one if it has an attribute `passive`, a function of the parameters that is true of those of the run. The
    work of all of them together is looked at, since the lift of one may do work on the drag of another.
    """
    forces = run.system.forces or ()
    names = [name for name, force in forces if getattr(force, "passive", _active)(run.system.parameters)]
    if not names or any(f"work_{name}" not in run.monitors for name in names):
        return []
    work = np.sum([run.monitors[f"work_{name}"] for name in names], axis=0)
    gained = np.cumsum(np.maximum(np.diff(work), 0.0))
    least = GAINED * max(
        float(np.ptp(work)), float(np.ptp(run.monitors["energy"])) if "energy" in run.monitors else 0.0
    )
    if len(gained) == 0 or not gained[-1] > least:
        return []
    first = np.asarray(run.records.t)[int(np.argmax(gained > least))]
    energy = f"{gained[-1]:.4g} {dict(run.system.units).get('energy', '')}".strip()
    whose = ", ".join(f"`{name}`" for name in names)
    return [
        f"{whose}, which should only brake, put in {energy}, from t = {first:.4g} s on: their coefficients do not hold "
        "for such motions."
    ]


def _active(p: object) -> bool:
    return False
