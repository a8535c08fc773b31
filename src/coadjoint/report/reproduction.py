"""Section 5 of Ono, Fiori and Peng (2025), run again with both difference maps, and what its figures mean."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint.difference_maps import Cayley, Exponential
from coadjoint.methods import LeftRectangle, Midpoint
from coadjoint.models.paper_tables import PAPER_DURATION, PAPER_STEP, paper_start, paper_vehicle
from coadjoint.plotting.plots import Plots
from coadjoint.plotting.style import save
from coadjoint.plotting.whole_file import write_text
from coadjoint.report.folder import SUMMARY, begin_results, claimed
from coadjoint.report.summary import to_json, versions
from coadjoint.simulation.simulate import simulate

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

    def summary(self) -> dict[str, Any]:
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


def numbers(run: Run) -> dict[str, Any]:
    """The entry of a run in summary.json; errors are relative maxima over every step.

    The energy is K_k + U_k with the discrete velocities for the left rectangle (P68, P69), the Legendre energy of
    (μ_k, π_k) for other rules; the Kelvin–Noether quantity is the e_z-component of the spatial momentum (P78).
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
        "angular_velocity_final": np.asarray(final.xi),
        "seconds": run.seconds,
        "set_up_seconds": run.set_up_seconds,
    }


def reproduce(
    out: str | Path = "reproduction",
    *,
    dt: float = PAPER_STEP,
    duration: float = PAPER_DURATION,
    overwrite: bool = False,
    progress: bool | None = None,
) -> Reproduction:
    """Compute the reproduction and write it to the folder `out`: figures, trajectories, summary.json and report.md.

    dt, duration: s, by default the paper's. Raises FileError where `out` holds a run already or cannot be written.
    """
    from coadjoint.report.text import report

    configuration = f"[reproduce]\ndt = {dt!r}\nduration = {duration!r}\n"
    with claimed(Path(out), configuration, overwrite) as folder:
        found = compute(dt, duration, progress)
        begin_results(folder)
        for name in ("cayley", "exponential", "midpoint"):
            found.runs[name].save(folder / f"{name}.nc", overwrite=overwrite)
        draw(found, folder)
        write_text(folder / "report.md", report(found))
        write_text(folder / SUMMARY, to_json(found.summary()))
    return found


def draw(found: Reproduction, folder: Path) -> None:
    """The paper's figures 1–3, and one that explains the growth of the energy."""
    first, second = (found.runs[name] for name in LABELS)
    labels = list(LABELS.values())
    plots = Plots(first.dataset)
    plots.energy(second, labels=labels, path=folder / FIGURES["energy"])
    plots.kelvin_noether(second, labels=labels, path=folder / FIGURES["kelvin_noether"])
    figure = plots.trajectory(second, labels=labels)
    space, *_, last = figure.axes
    space.set(zlabel="$z$, down (m)")
    last.set_ylabel("$z$, down (m)")
    save(figure, folder / FIGURES["trajectory"])
    half, midpoint = found.runs["cayley_half_step"], found.runs["midpoint"]
    plots.energy(
        half,
        midpoint,
        labels=[f"left, h = {first.dt:g} s", f"left, h = {half.dt:g} s", f"midpoint, h = {midpoint.dt:g} s"],
        path=folder / FIGURES["explained"],
    )
