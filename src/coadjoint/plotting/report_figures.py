"""The figures of a report: their choice, their order, and captions for readers without the library."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from coadjoint import checks
from coadjoint.plotting.plots import Plots, common, figure_names
from coadjoint.plotting.registries import ADDED, points_down

OWN = {
    "trajectory": "The path in space, and each of its coordinates over time.",
    "attitude": "Yaw, pitch and roll in degrees over time.",
    "velocities": "The velocities in the axes of the body over time: angular ξ, linear ν.",
    "momenta": "The momenta in the axes of the body over time: angular μ, linear π.",
    "budget": "The energy stored since the start, and the energy that each force has put in or taken out; below, the "
    "gap between "
    "the two, which is the error of the computation.",
    "energy": "The energy, relative to that at the start: no force acts, so any change is an error of the computation.",
    "kelvin_noether": "The Kelvin–Noether quantity, a component of the momentum in space, relative to that at the "
    "start.",
    "inputs": "The inputs over time.",
    "group_defect": "How far the configuration is from its group over time; of a rotation matrix R the largest entry "
    "of |RᵀR − I|.",
}
"""The captions of the library's own figures, from those on the motion to those on the computation."""
_DRIVEN = "The energy over time. Forces act and change it: this is not an error of the computation."
_FINE = ("velocities", "momenta", "inputs")
"""Figures that a report of a vehicle omits by default, because its speeds, rates and commands are shown."""


def chosen(datasets: Sequence[Any]) -> list[str]:
    """The default figures of a report, in their order: those of the owner of the datasets first.

    Where forces act the energy budget takes the place of the energy.
    """
    ranks = {name: added.rank for name, added in ADDED.items()} | {name: 10 + k for k, name in enumerate(OWN)}
    shared = common(datasets)
    left_out = {"energy"} if "budget" in shared else set()
    left_out |= set(_FINE) if any(name in ADDED for name in shared) else set()
    return sorted((name for name in shared if name not in left_out), key=ranks.__getitem__)


def svgs(
    datasets: Sequence[Any], wanted: Sequence[str] = (), labels: Sequence[str] | None = None
) -> list[tuple[str, str, str]]:
    """The wanted figures, by default those `chosen`: name, caption, and the figure as SVG text.

    Raises ArgumentError for an unknown name, and as the figures do.
    """
    from coadjoint.plotting.style import svg

    found = []
    for name in wanted or chosen(datasets):
        checks.known(name, figure_names(films=False), "figure", "A report")
        figure = getattr(Plots(datasets[0]), name)(*datasets[1:], labels=labels)
        found.append((name.replace("_", " "), caption(name, datasets), svg(figure)))
    return found


def caption(name: str, datasets: Sequence[Any]) -> str:
    """The caption of a figure of these datasets, for readers without the library."""
    if name in ADDED:
        return ADDED[name].caption or " ".join(ADDED[name].doc.split())
    if name == "energy" and any("energy_budget" in dataset for dataset in datasets):
        return _DRIVEN
    down = name == "trajectory" and all(map(points_down, datasets))
    return OWN[name] + (" The z axis points down." if down else "")
