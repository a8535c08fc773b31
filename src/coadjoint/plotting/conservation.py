"""Errors of conserved quantities, on a logarithmic axis."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coadjoint import checks
from coadjoint.mechanics.energy_scale import near_zero, paired
from coadjoint.plotting.entries import Entry, require
from coadjoint.plotting.style import COLUMN, canvas, legend, time_axis

Definition = Literal["discrete", "legendre"]

_HEIGHT = 2.3

CHANGED = 0.01
"""The part of its largest value by which forces change an energy that is drawn itself, on a linear axis."""


def energy(runs: Sequence[Entry], definition: Definition | None) -> Figure:
    """|E(t)/E(0) − 1| over time: an error where no force acts, otherwise the change by forces; E(t) if it is large.

    The change itself, |E(t) − E(0)|, where E(0) is near zero against the largest kinetic energy
    (`coadjoint.mechanics.energy_scale`).

    `definition`: "discrete" is E(t_k) = −∂_hΛ with the discrete velocities, (P68) and (P69) for the left rectangle;
    "legendre" the energy of (μ_k, π_k) at the node. By default the first for the left rectangle, whose figures the
    paper shows, and the second for every other rule.
    """
    if definition is not None:
        checks.choice(definition, "definition", ("discrete", "legendre"))

    def name(run: Entry) -> str:
        left = str(run.dataset.attrs.get("method", "")).startswith("LeftRectangle")
        discrete = definition == "discrete" or (definition is None and left)
        names = ["discrete_energy", "energy"] if discrete else ["energy", "discrete_energy"]
        return require(run, names[:1] if definition else names, "No energy was recorded, as with `monitors=False`.")

    driven = any("energy_budget" in run.dataset for run in runs)
    if driven and any(np.ptp(E) > CHANGED * np.max(np.abs(E)) for E in (run.values(name(run)) for run in runs)):
        return _itself(runs, name)
    return _changes(runs, name, "energy change" if driven else "energy error", "E", motion)


def _itself(runs: Sequence[Entry], name: Callable[[Entry], str]) -> Figure:
    figure = canvas(COLUMN, _HEIGHT)
    axes = figure.subplots()
    for run in runs:
        values = run.values(name(run))
        kept = run.thin(values)
        axes.plot(run.time[kept], values[kept], label=run.label, **run.look)
    unit = runs[0].unit(name(runs[0]))
    axes.set_ylabel("energy $E(t)$" + (f" ({unit})" if unit else ""))
    time_axis([axes], [run.time for run in runs])
    legend(figure, *axes.get_legend_handles_labels())
    return figure


def kelvin_noether(runs: Sequence[Entry]) -> Figure:
    """|I(t) − I(0)|/|I(0)| over time; the norm over the quantities where there are several."""
    sentence = (
        "No Kelvin–Noether quantity was recorded: the common isotropy algebra of the advected parameters is trivial, "
        "or monitors=False."
    )
    driven = any("kelvin_noether_budget" in run.dataset for run in runs)
    what = "Kelvin–Noether change" if driven else "Kelvin–Noether error"
    return _changes(runs, lambda run: require(run, ["kelvin_noether"], sentence), what, "I")


def group_defect(runs: Sequence[Entry]) -> Figure:
    """How far g is from its group over time; for rotations the largest entry of |RᵀR − I|."""
    figure = canvas(COLUMN, _HEIGHT)
    axes = figure.subplots()
    for run in runs:
        name = require(run, ["group_defect"], "No group defect was recorded.")
        _curve(axes, run, run.values(name))
    _finish(figure, axes, runs, "distance from the group")
    return figure


def relative(values: np.ndarray, kinetic: float = 0.0) -> tuple[np.ndarray, bool]:
    """|X_k − X₀|/|X₀| with the Euclidean norm over components, and True; |X_k − X₀| and False if X₀ is near zero."""
    columns = values.reshape(len(values), -1)
    change = np.linalg.norm(columns - columns[0], axis=1)
    size = float(np.linalg.norm(columns[0]))
    return (change, False) if size == 0.0 or near_zero(size, kinetic) else (change / size, True)


def motion(run: Entry) -> float:
    """The largest kinetic energy, ½|⟨μ, ξ⟩ + ⟨π, ν⟩|."""
    power = np.zeros(len(run.time))
    for name in map(str, run.dataset.data_vars):
        kind, _, which = name.partition("_")
        velocity = {"mu": "xi", "pi": "nu"}.get(kind, "") + (f"_{which}" if which else "")
        if kind in ("mu", "pi") and velocity in run.dataset:
            momenta, velocities = (np.reshape(run.values(one), (len(power), -1)) for one in (name, velocity))
            power += paired(momenta, velocities)
    return float(np.max(np.abs(power))) / 2


def _nowhere(run: Entry) -> float:
    return 0.0


def _changes(
    runs: Sequence[Entry],
    name: Callable[[Entry], str],
    what: str,
    letter: str,
    kinetic: Callable[[Entry], float] = _nowhere,
) -> Figure:
    figure = canvas(COLUMN, _HEIGHT)
    axes = figure.subplots()
    found = [relative(run.values(name(run)), kinetic(run)) for run in runs]
    all_relative = all(is_relative for _, is_relative in found)
    for run, (change, is_relative) in zip(runs, found, strict=True):
        values = run.values(name(run))
        size = 1.0 if all_relative or not is_relative else float(np.linalg.norm(values[0]))
        _curve(axes, run, change * size)
    unit = runs[0].unit(name(runs[0]))
    if all_relative:
        label = rf"{what} $|{letter}(t)/{letter}(0) - 1|$"
    else:
        label = rf"{what} $|{letter}(t) - {letter}(0)|$" + (f" ({unit})" if unit else "")
    _finish(figure, axes, runs, label)
    return figure


def _curve(axes: Axes, run: Entry, values: np.ndarray) -> None:
    """A curve on the logarithmic axis; exact zeros have no place there and are left out, all-zero curves are named."""
    positive = np.flatnonzero(values > 0)
    if not len(positive):
        axes.plot([], [], label=f"{run.label} (exactly 0)", **run.look)
        return
    kept = positive[run.thin(np.log(values[positive]))]
    axes.plot(run.time[kept], values[kept], label=run.label, **run.look)


def _finish(figure: Figure, axes: Axes, runs: Sequence[Entry], label: str) -> None:
    axes.set_yscale("log")
    axes.set_ylabel(label)
    heights = [np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines()]
    heights = [values for values in heights if len(values)]
    if heights:
        # A factor of two on either side, and a decade at least, so that a nearly constant error does not look erratic.
        low, high = min(map(np.min, heights)) / 2, max(map(np.max, heights)) * 2
        low = max(low, 1e-17 * high)  # Round-off of the largest value does not stretch the axis.
        axes.set_ylim(min(low, high / 10), high)
    else:
        axes.set_ylim(1e-17, 1e-15)
        axes.text(0.5, 0.5, "exactly 0 at every saved node", transform=axes.transAxes, ha="center", va="center")
    time_axis([axes], [run.time for run in runs])
    legend(figure, *axes.get_legend_handles_labels())
