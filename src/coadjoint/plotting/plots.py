"""Figures of a run's dataset: `run.plot.energy()`, `run.plot.trajectory(other, path="dive.pdf")`, …"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Literal

from coadjoint.errors import ArgumentError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from coadjoint.plotting.entries import Entry

    Path = str | os.PathLike[str]


class Plots:
    """Figures of a dataset, for print: a matplotlib Figure each, which no pyplot state knows of.

    Every figure takes further runs or datasets to compare with, `labels` for all of them, and `path`, which writes the
    figure in the format of its ending (.png, .pdf, .svg). ArgumentError says where a dataset lacks what is drawn.
    """

    def __init__(self, dataset: Any):
        self.dataset = dataset

    def energy(
        self,
        *others: Any,
        definition: Literal["discrete", "legendre"] | None = None,
        labels: Sequence[str] | None = None,
        path: Path | None = None,
    ) -> Figure:
        """|E_k/E₀ − 1| over time: E_k = −∂_hΛ for the left rectangle (P68, P69), else the Legendre energy."""
        from coadjoint.plotting import conservation

        return self._draw(lambda runs: conservation.energy(runs, definition), others, labels, path)

    def kelvin_noether(self, *others: Any, labels: Sequence[str] | None = None, path: Path | None = None) -> Figure:
        """|I_k/I₀ − 1| over time, with the norm over the quantities where there are several (Theorem 7)."""
        from coadjoint.plotting import conservation

        return self._draw(conservation.kelvin_noether, others, labels, path)

    def budget(self, *others: Any, labels: Sequence[str] | None = None, path: Path | None = None) -> Figure:
        """The energy stored, and what each force has put in since the start; below, how well this closes."""
        from coadjoint.plotting import budget

        return self._draw(budget.budget, others, labels, path)

    def trajectory(
        self,
        *others: Any,
        variable: str | None = None,
        z_down: bool = False,
        labels: Sequence[str] | None = None,
        path: Path | None = None,
    ) -> Figure:
        """The path q in space, and by axis over time; `z_down` draws the z axis pointing down."""
        from coadjoint.plotting import trajectory

        return self._draw(lambda runs: trajectory.trajectory(runs, variable, z_down), others, labels, path)

    def attitude(
        self, *others: Any, unwrap: bool = False, labels: Sequence[str] | None = None, path: Path | None = None
    ) -> Figure:
        """Yaw, pitch and roll in degrees over time; with `unwrap` full turns are counted."""
        from coadjoint.plotting import attitude

        return self._draw(lambda runs: attitude.attitude(runs, unwrap), others, labels, path)

    def velocities(self, *others: Any, labels: Sequence[str] | None = None, path: Path | None = None) -> Figure:
        """The body velocities ξ and ν over time."""
        from coadjoint.plotting import components

        return self._draw(components.velocities, others, labels, path)

    def momenta(self, *others: Any, labels: Sequence[str] | None = None, path: Path | None = None) -> Figure:
        """The momenta μ and π over time."""
        from coadjoint.plotting import components

        return self._draw(components.momenta, others, labels, path)

    def group_defect(self, *others: Any, labels: Sequence[str] | None = None, path: Path | None = None) -> Figure:
        """How far g is from its group over time."""
        from coadjoint.plotting import conservation

        return self._draw(conservation.group_defect, others, labels, path)

    def variable(
        self, name: str, *others: Any, labels: Sequence[str] | None = None, path: Path | None = None
    ) -> Figure:
        """One variable of the dataset over time, by its name."""
        from coadjoint.plotting import components

        return self._draw(lambda runs: components.variable(runs, name), others, labels, path)

    def track(
        self, *others: Any, way_points: Any = None, labels: Sequence[str] | None = None, path: Path | None = None
    ) -> Figure:
        """The path of a vehicle seen from above, north up, with its start, its end and `way_points` (k, 2 or 3), m."""
        from coadjoint.plotting import navigation

        return self._draw(lambda runs: navigation.track(runs, way_points), others, labels, path)

    def depth(self, *others: Any, labels: Sequence[str] | None = None, path: Path | None = None) -> Figure:
        """The depth of a vehicle over time, downwards, with its set point."""
        from coadjoint.plotting import navigation

        return self._draw(navigation.depth, others, labels, path)

    def speeds(self, *others: Any, labels: Sequence[str] | None = None, path: Path | None = None) -> Figure:
        """Surge, sway and heave through the water with the set point of speed, and the rates of roll, pitch and yaw."""
        from coadjoint.plotting import motions

        return self._draw(motions.speeds, others, labels, path)

    def actuators(self, *others: Any, labels: Sequence[str] | None = None, path: Path | None = None) -> Figure:
        """What every actuator does, what it was told, and its limits."""
        from coadjoint.plotting import actuators

        return self._draw(actuators.actuators, others, labels, path)

    def current(self, *others: Any, labels: Sequence[str] | None = None, path: Path | None = None) -> Figure:
        """The velocity of the water where the vehicle is: north, east, down."""
        from coadjoint.plotting import motions

        return self._draw(motions.current, others, labels, path)

    def mission(
        self, *others: Any, way_points: Any = None, labels: Sequence[str] | None = None, path: Path | None = None
    ) -> Figure:
        """A vehicle's run on one page: track, depth, angles, speeds, rates, actuators, energy, current."""
        from coadjoint.plotting import mission

        return self._draw(lambda runs: mission.mission(runs, way_points), others, labels, path)

    def animation(
        self, *others: Any, path: Path, frames: int = 150, labels: Sequence[str] | None = None
    ) -> os.PathLike[str]:
        """Write an animation of vehicles to `path`: `.gif`, track and depth in `frames` pictures, or `.html`.

        The page plays the tracks in space, to be turned with the mouse; it holds all that it needs.
        """
        from coadjoint.plotting.animation import animation
        from coadjoint.plotting.entries import entries

        return animation(entries([self.dataset, *others], labels), path, frames)

    def _draw(
        self,
        make: Callable[[list[Entry]], Figure],
        others: Sequence[Any],
        labels: Sequence[str] | None,
        path: Path | None,
    ) -> Figure:
        from coadjoint.plotting.entries import entries
        from coadjoint.plotting.style import save, style

        with style():
            figure = make(entries([self.dataset, *others], labels))
        if path is not None:
            save(figure, path)
        return figure


OF_VEHICLES = ("mission", "track", "depth", "speeds", "actuators", "current")
"""The figures that only vehicles have."""
FIGURES = (
    *("energy", "kelvin_noether", "budget", "trajectory", "attitude", "velocities", "momenta", "group_defect"),
    *OF_VEHICLES,
)
"""The figures that a dataset can have, by the names of their methods."""


ANIMATION = "animation"


def available(dataset: Any) -> list[str]:
    """The names of the figures that this dataset has what to draw for."""
    held = {str(name) for name in dataset.data_vars}
    needs = {
        "energy": {"energy", "discrete_energy"},
        "kelvin_noether": {"kelvin_noether"},
        "budget": {"energy_budget"},
        "trajectory": {"x"} | {name for name in held if name == "q" or name.startswith("q_")},
        "attitude": {"euler_angles"},
        "velocities": {"xi"},
        "momenta": {"mu"},
        "group_defect": {"group_defect"},
    }
    return [name for name in FIGURES if (needs[name] & held if name in needs else name in _of_vehicle(dataset))]


def _of_vehicle(dataset: Any) -> list[str]:
    """The figures that only vehicles have."""
    from coadjoint.models.underwater.log.log import Log, is_vehicle

    if not is_vehicle(dataset):
        return []
    if "member" in dataset.dims:
        dataset = dataset.isel(member=0)
    log = Log(dataset)
    lacking = {"actuators": not log.actuators, "current": log.current is None}
    return [name for name in OF_VEHICLES if not lacking.get(name, False)]


def save_figures(
    datasets: Sequence[Any],
    folder: Path,
    names: Sequence[str] | None = None,
    ending: str = "png",
    labels: Sequence[str] | None = None,
) -> list[str]:
    """Write the named figures of the datasets as folder/name.ending, by default all that every dataset has.

    `animation` is one, too, as .html or else .gif. Returns the file names; raises ArgumentError for a name that is
    none, and as the figures do.
    """
    common = [name for name in FIGURES if all(name in available(dataset) for dataset in datasets)]
    chosen = common if names is None else list(names)
    for name in chosen:
        if name not in (*FIGURES, ANIMATION):
            raise ArgumentError(f"There is no figure `{name}`; there are {', '.join((*FIGURES, ANIMATION))}.")
    plots = Plots(datasets[0])
    files = [f"{name}.{_ending(name, ending)}" for name in chosen]
    for name, file in zip(chosen, files, strict=True):
        getattr(plots, name)(*datasets[1:], labels=labels, path=os.path.join(folder, file))
    return files


def _ending(name: str, ending: str) -> str:
    """The ending of a figure's file: pictures for figures, .html or .gif for an animation."""
    moving = ending in ("gif", "html")
    if name == ANIMATION:
        return ending if moving else "gif"
    return "png" if moving else ending
