"""The report of a reproduction: the paper's figures, ours, and the reasons for differences. Every number is
measured."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.models.paper_tables import PAPER_DURATION, PAPER_STEP
from coadjoint.report.reproduction import FIGURES, Reproduction, numbers

if TYPE_CHECKING:
    from coadjoint.simulation.run import Run

ROUND_OFF = 1e-12
"""Below this a relative residual counts as round-off."""
FIRST_ORDER = (1.9, 2.1)
"""The range of the ratio of the errors at h and h/2 for an error proportional to h."""


def report(found: Reproduction) -> str:
    """The report as Markdown."""
    parts = (_head(found), _table(found), _energy(found), _kelvin_noether(found), _trajectory(found), _files(found))
    return "\n\n".join(parts) + "\n"


def _head(found: Reproduction) -> str:
    run = found.runs["cayley"]
    p: PyTree = run.system.parameters
    duration = run.steps * run.dt
    same = np.isclose(run.dt, PAPER_STEP) and np.isclose(duration, PAPER_DURATION)
    kind = (
        "the paper's run" if same else f"NOT the paper's run, which has h = {PAPER_STEP:g} s, T = {PAPER_DURATION:g} s"
    )
    return f"""# Section 5 of Ono, Fiori and Peng (2025), run again

The vehicle of Table 1: m = {p.mass:g} kg, M_A = {_diagonal(p.added_mass)} kg, J = {_diagonal(p.inertia)} kg m²
in the body frame, buoyancy ρ|V|g = {p.buoyancy:g} N (Table 1 prints kg), g = {p.gravity:g} m/s²,
r = {_vector(p.center_of_buoyancy)} m.
The run of Table 2: h = {run.dt:g} s, T = {duration:g} s, {run.steps:,} steps; {kind}.
Scheme: left rectangle rule, with the initial velocities as first discrete velocities, over both difference maps.
The midpoint rule and runs at h/2 were added to find out where the energy error comes from.
Descriptions of the paper's figures are quoted from its text: their curves cannot be compared digit by digit."""


def _table(found: Reproduction) -> str:
    lines = [
        "| run | h (s) | energy error | Kelvin–Noether error | balance | Newton residual | RᵀR − I | iterations |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, run in found.runs.items():
        c = numbers(run)
        lines.append(
            f"| {name.replace('_', ' ')} | {c['dt']:g} | {c['energy_error_max']:.2e} "
            f"| {c['kelvin_noether_error_max']:.1e} | {c['balance_residual_max']:.0e} "
            f"| {c['newton_residual_max']:.0e} | {c['group_defect_max']:.0e} | {c['newton_iterations_mean']:.2f} |"
        )
    words = (
        "Errors are relative maxima over every step. The energy is K_k + U_k with the discrete velocities (P68, P69) "
        "for the left rectangle, and the Legendre energy at the nodes for the midpoint rule."
    )
    return "\n".join(["## Measured", "", *lines, "", words])


def _energy(found: Reproduction) -> str:
    errors = {name: numbers(run)["energy_error_max"] for name, run in found.runs.items()}
    first = found.runs["cayley"]
    times, typical = _growth(first)
    stations = ", ".join(f"{error:.1e} up to {time:.4g} s" for time, error in zip(times, typical, strict=True))
    return f"""## Figure 1: the energy

![Relative energy error]({FIGURES["energy"]})

The paper: the energy "fluctuates within a certain range but tends to increase slightly over time. This is because of
the Gauss–Newton method, which brings truncation errors."

Here: the relative error reaches {errors["cayley"]:.3e} (Cayley) and {errors["exponential"]:.3e} (exponential). Its
means over the fifths of the run, Cayley: {stations}.

{_explanation(found, errors)}

![Energy error at two step sizes, and of the midpoint rule]({FIGURES["explained"]})"""


def _growth(run: Run) -> tuple[np.ndarray, np.ndarray]:
    """The mean relative energy error over each fifth of a run, and where each fifth ends."""
    energy = run.monitors["discrete_energy"]
    fifths = np.array_split(np.abs(energy / energy[0] - 1), 5)
    ends = np.array_split(run.records.t, 5)
    return np.array([part[-1] for part in ends]), np.array([np.mean(part) for part in fifths])


def _explanation(found: Reproduction, errors: dict[str, float]) -> str:
    """Why the energy error grows, as far as the runs at h/2 and by the midpoint rule show it."""
    names = ("cayley", "exponential")
    residual = max(found.runs[name].largest("newton_residual") for name in names)
    ratios = [errors[name] / errors[f"{name}_half_step"] for name in names]
    gain = errors["cayley"] / errors["midpoint"]
    seconds = [found.runs[name].seconds for name in ("cayley", "midpoint")]
    measured = (
        f"The equations of every step are solved to {residual:.0e} of the momenta. Halving h divides the error by "
        f"{ratios[0]:.3f} (Cayley) and {ratios[1]:.3f} (exponential). The midpoint rule at the same h has "
        f"{errors['midpoint']:.2e}, {gain:.3g} times less, in {seconds[1]:.2g} s against {seconds[0]:.2g} s."
    )
    solved = residual < ROUND_OFF
    first_order = all(FIRST_ORDER[0] < ratio < FIRST_ORDER[1] for ratio in ratios)
    if solved and first_order:
        verdict = (
            "So the growth does not come from truncation of the Newton iteration, which converges to round-off here: "
            "it is the error of the left rectangle rule, which is of first order in h."
        )
    else:
        verdict = (
            "These runs do not determine the cause: "
            + ("" if solved else "the equations of the steps were not solved to round-off. ")
            + ("" if first_order else "the error does not halve with h, as an error of first order does.")
        ).strip()
    return f"{measured}\n{verdict}"


def _kelvin_noether(found: Reproduction) -> str:
    first, second = (numbers(found.runs[name]) for name in ("cayley", "exponential"))
    run = found.runs["cayley"]
    terms = float(np.max(np.linalg.norm(run.records.n, axis=1) * np.linalg.norm(run.records.pi, axis=1)))
    floor = np.finfo(float).eps * terms / abs(first["kelvin_noether_initial"])
    balance = max(first["balance_residual_max"], second["balance_residual_max"])
    verdict = "so the error shown is round-off" if balance < ROUND_OFF else "which is more than round-off"
    return f"""## Figure 2: the Kelvin–Noether quantity

![Relative error of the Kelvin–Noether quantity]({FIGURES["kelvin_noether"]})

The paper: the e_z-component of the spatial momentum on a logarithmic axis; "Differences can hardly be observed in the
two cases."

Here: the relative error reaches at most {first["kelvin_noether_error_max"]:.1e} (Cayley) and
{second["kelvin_noether_error_max"]:.1e} (exponential). Every step keeps the balance of Theorem 7
to {balance:.0e} of its terms, {verdict}. Round-off grows with the distance: the quantity,
I = {first["kelvin_noether_initial"]:.6g} kg m²/s, contains n × π, whose factors reach |n||π| = {terms:.1e} kg m²/s;
one unit in the last place of that is {floor:.0e} of I."""


def _trajectory(found: Reproduction) -> str:
    run = found.runs["cayley"]
    p: PyTree = run.system.parameters
    q, t = np.asarray(run.records.q), np.asarray(run.records.t)
    deepest = int(np.argmax(q[:, 2]))
    apart = float(np.max(np.linalg.norm(q - np.asarray(found.runs["exponential"].records.q), axis=1)))
    net = float(p.mass * p.gravity - p.buoyancy)
    turns = net < 0 and 0 < deepest < len(q) - 1
    path = (
        f"z grows from {q[0, 2]:.3g} m to {q[deepest, 2]:.4g} m at t = {t[deepest]:.4g} s and then falls to "
        f"{q[-1, 2]:.4g} m"
        if turns
        else f"z goes from {q[0, 2]:.3g} m to {q[-1, 2]:.4g} m without turning back in this time"
    )
    meaning = (
        "the vehicle first dives, driven by its initial velocity, and then floats up, past where it began"
        if turns and q[-1, 2] < q[0, 2]
        else "growing z is a dive"
    )
    return f"""## Figure 3: the trajectory

![Trajectory in space and by axis]({FIGURES["trajectory"]})

The paper: the vehicle "will initially rise due to the (positive) initial velocities and then descend under the combined
effects of gravitational and buoyancy forces."

Here: {path}; it ends at q = {_vector(q[-1])} m. The trajectories of the two maps are at most {apart:.0e} m apart.
The curves are those the paper describes, its words for them are not: in its equations the buoyancy is −ρ|V|g e_z and
the weight mg e_z, so z points *down*. Weight less buoyancy is {net:.4g} N, an upward force if negative. Read so,
{meaning}. The model knows no surface of the water. Figure 3 is drawn with growing z upwards, as numbers are, to be
compared with the paper's."""


def _files(found: Reproduction) -> str:
    p = found.summary()["versions"]
    seconds = sum(run.seconds for run in found.runs.values())
    set_up = sum(run.set_up_seconds for run in found.runs.values())
    return f"""## Files

`summary.json` holds these numbers; `cayley.nc`, `exponential.nc` and `midpoint.nc` hold every node of the three runs at
h, for `coadjoint.load`. The runs took {seconds:.2g} s, and {set_up:.2g} s to set up. Computed by
{", ".join(f"{name} {number}" for name, number in p.items())}."""


def _vector(values: Array) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in np.asarray(values)) + ")"


def _diagonal(matrix: Array) -> str:
    matrix = np.asarray(matrix)
    if matrix.ndim == 2 and np.array_equal(matrix, np.diag(np.diag(matrix))):
        return "diag" + _vector(np.diag(matrix))
    return str(matrix.tolist())
