"""Warnings about the energy of a run: where it is not known, and where it changed though nothing may change it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from coadjoint.mechanics.inverse_legendre import SOLVED
from coadjoint.mechanics.ledger import energy_lines

if TYPE_CHECKING:
    from coadjoint.simulation.run import Run

TOO_MUCH = 0.1
"""The relative change of a conserved energy from which on the card warns."""


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
    return _changed(run)


def _changed(run: Run) -> list[str]:
    driven = energy_lines(run.system) or run.system.takes("inputs") or run.system.takes("internal")
    if driven or "energy" not in run.extrema or run.relative_change("energy") < TOO_MUCH:
        return []
    return [
        f"The energy, which nothing changes, is off by {run.relative_change('energy'):.0%}: dt = {run.dt:g} is too "
        "large for this motion, or functions of the system contradict each other, such as a space's `diamond` and its "
        "`act`."
    ]
