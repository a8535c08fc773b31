"""Section 5 of Ono, Fiori and Peng (2025), run again with both difference maps, and the numbers behind its figures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from coadjoint.difference_maps import Cayley, Exponential
from coadjoint.methods import LeftRectangle, Midpoint
from coadjoint.models.paper_tables import PAPER_DURATION, PAPER_STEP, paper_start, paper_vehicle
from coadjoint.report.summary import versions
from coadjoint.simulation.simulate import simulate
from coadjoint.texts import Table

if TYPE_CHECKING:
    from coadjoint.methods import Method
    from coadjoint.simulation.run import Run

LABELS = {"cayley": "Cayley", "exponential": "exponential"}
"""The paper's two runs."""
FIGURES = {
    "energy": "figure1_energy.png",
    "kelvin_noether": "figure2_kelvin_noether.png",
    "trajectory": "figure3_trajectory.png",
    "explained": "energy_explained.png",
}


@dataclass(frozen=True)
class Reproduction:
    """The runs of a reproduction by name.

    `cayley`, `exponential`: the left rectangle with velocity start at h, as in the paper; `cayley_half_step`,
    `exponential_half_step`: the same at h/2; `midpoint`: the midpoint rule at h.
    """

    runs: dict[str, Run]

    def summary(self) -> Table:
        """The numbers of summary.json: a dictionary a run, and the versions that computed them."""
        return {**{name: numbers(run) for name, run in self.runs.items()}, "versions": versions()}


def compute(dt: float = PAPER_STEP, duration: float = PAPER_DURATION, progress: bool | None = None) -> Reproduction:
    """Run the vehicle of Tables 1 and 2 by the paper's scheme, by the same at dt/2, and by the midpoint rule.

    dt, duration: s, by default those of Table 2.
    """
    vehicle = paper_vehicle()
    start = paper_start(vehicle)
    cayley, exponential = (LeftRectangle(tau, start="velocity") for tau in (Cayley(), Exponential()))
    plans: dict[str, tuple[Method, int]] = {
        "cayley": (cayley, 1),
        "exponential": (exponential, 1),
        "cayley_half_step": (cayley, 2),
        "exponential_half_step": (exponential, 2),
        "midpoint": (Midpoint(Cayley()), 1),
    }
    runs = {
        name: simulate(
            vehicle, start, dt=dt / parts, duration=duration, method=method, save_every=parts, progress=progress
        )
        for name, (method, parts) in plans.items()
    }
    return Reproduction(runs)


def numbers(run: Run) -> Table:
    """The entry of a run in summary.json; errors are relative maxima over every step.

    The energy is K_k + U_k with the discrete velocities for the left rectangle (P68, P69), the Legendre energy of
    (μ_k, π_k) for other rules; the Kelvin–Noether quantity is the e_z-component of the spatial momentum (P78); the
    angular velocity is that of the step that starts at the last node.
    """
    c = run.summary()
    energy = "discrete_energy" if isinstance(run.method, LeftRectangle) else "energy"
    final = run.final
    return {
        "method": run.method.title,
        "order": run.method.order,
        "steps": run.good_steps,
        "dt": run.dt,
        "energy_definition": "discrete" if energy == "discrete_energy" else "legendre",
        "energy_initial": float(c[f"{energy}_initial"]),
        "energy_error_max": c[f"{energy}_error_max"],
        "energy_error_final": c[f"{energy}_error_final"],
        "kelvin_noether_initial": float(np.ravel(c["kelvin_noether_initial"])[0]),
        "kelvin_noether_error_max": c["kelvin_noether_error_max"],
        "kelvin_noether_error_final": c["kelvin_noether_error_final"],
        "balance_residual_max": c["balance_max"],
        "newton_residual_max": c["newton_residual_max"],
        "group_defect_max": c["group_defect_max"],
        "newton_iterations_mean": c["newton_iterations_mean"],
        "position_final": np.asarray(final.q),
        "angular_velocity_final": np.asarray(run.last_record.xi),
        "seconds": run.seconds,
        "set_up_seconds": run.set_up_seconds,
    }
