"""Figures of a run's dataset: `run.plot.energy()`, `run.plot.trajectory(other, path="dive.pdf")`, …"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal, NoReturn

from coadjoint import checks
from coadjoint.errors import ArgumentError
from coadjoint.extensions import import_string
from coadjoint.log import phase
from coadjoint.plotting.registries import ADDED

if TYPE_CHECKING:
    from pathlib import Path as FilePath

    from matplotlib.figure import Figure

    from coadjoint.plotting.entries import Entry
    from coadjoint.plotting.film import Film

    Path = str | os.PathLike[str]


class Plots:
    """Figures of a dataset, for print: each is a matplotlib Figure outside pyplot's state.

    Every figure takes further runs or datasets to compare with, `labels` for all of them, and `path`, which writes the
    figure in the format of its ending (.png, .pdf, .svg). Raises ArgumentError where a dataset lacks the variables of a
    figure.
    """

    def __init__(self, dataset: Any):
        self.dataset = dataset

    def energy(
        self,
        *others: object,
        definition: Literal["discrete", "legendre"] | None = None,
        labels: Sequence[str] | None = None,
        path: Path | None = None,
    ) -> Figure:
        """|E(t)/E(0) − 1| over time, |E(t) − E(0)| if E(0) is small; E(t) where forces change it by more than 1 %.

        E(t_k) = −∂_hΛ for the left rectangle (P68, P69), else the Legendre energy.
        """
        from coadjoint.plotting import conservation

        return self._draw(lambda runs: conservation.energy(runs, definition), others, labels, path)

    def kelvin_noether(self, *others: object, labels: Sequence[str] | None = None, path: Path | None = None) -> Figure:
        """|I(t)/I(0) − 1| over time, with the norm over the quantities where there are several (Theorem 7)."""
        from coadjoint.plotting import conservation

        return self._draw(conservation.kelvin_noether, others, labels, path)

    def budget(self, *others: object, labels: Sequence[str] | None = None, path: Path | None = None) -> Figure:
        """The energy stored, and the energy from each force since the start; below, the gap between the two."""
        from coadjoint.plotting import budget

        return self._draw(budget.budget, others, labels, path)

    def inputs(
        self,
        *others: object,
        bounds: Mapping[str, object] | None = None,
        labels: Sequence[str] | None = None,
        path: Path | None = None,
    ) -> Figure:
        """The inputs over time, a panel each, and their bounds: name → `co.control.Input`, or (lower, upper).

        Inputs of `bounds` that are linear in each step are joined by lines, all others are held until the next node.
        """
        from coadjoint.plotting import inputs

        return self._draw(lambda runs: inputs.inputs(runs, bounds or {}), others, labels, path)

    def trajectory(
        self,
        *others: object,
        variable: str | None = None,
        z_down: bool | None = None,
        labels: Sequence[str] | None = None,
        path: Path | None = None,
    ) -> Figure:
        """The path q in space, and by axis over time; the z axis points down with `z_down`, by default of vehicles."""
        from coadjoint.plotting import trajectory

        return self._draw(lambda runs: trajectory.trajectory(runs, variable, z_down), others, labels, path)

    def attitude(
        self, *others: object, unwrap: bool = False, labels: Sequence[str] | None = None, path: Path | None = None
    ) -> Figure:
        """Yaw, pitch and roll in degrees over time; with `unwrap` full turns are counted."""
        from coadjoint.plotting import attitude

        return self._draw(lambda runs: attitude.attitude(runs, unwrap), others, labels, path)

    def velocities(self, *others: object, labels: Sequence[str] | None = None, path: Path | None = None) -> Figure:
        """The body velocities ξ and ν over time."""
        from coadjoint.plotting import components

        return self._draw(components.velocities, others, labels, path)

    def momenta(self, *others: object, labels: Sequence[str] | None = None, path: Path | None = None) -> Figure:
        """The momenta μ and π over time."""
        from coadjoint.plotting import components

        return self._draw(components.momenta, others, labels, path)

    def group_defect(self, *others: object, labels: Sequence[str] | None = None, path: Path | None = None) -> Figure:
        """How far g is from its group over time."""
        from coadjoint.plotting import conservation

        return self._draw(conservation.group_defect, others, labels, path)

    def variable(
        self, name: str, *others: object, labels: Sequence[str] | None = None, path: Path | None = None
    ) -> Figure:
        """One variable of the dataset over time, by its name."""
        from coadjoint.plotting import components

        return self._draw(lambda runs: components.variable(runs, name), others, labels, path)

    def scene(
        self,
        *others: object,
        bodies: Sequence[Any] | None = None,
        hull: Any = None,
        z_down: bool = False,
        labels: Sequence[str] | None = None,
        path: Path | None = None,
    ) -> Any:
        """The bodies moving in space: a `Player`, which notebooks show, and a self-contained page as `path`.

        `bodies`: a `coadjoint.plotting.bodies.Solid` each, by default a vehicle with its parts, or a box for each
        rotation and a point for each place. `hull`: another shape of the hull, as of `bodies.mesh`. `z_down` has the z
        axis pointing down, as of vehicles it does.
        """
        from coadjoint.plotting.entries import entries
        from coadjoint.plotting.player import Player
        from coadjoint.plotting.scene_of_runs import scene

        made = Player(scene(entries([self.dataset, *others], labels), bodies, z_down, hull))
        if path is not None:
            made.save(path)
        return made

    def animation(
        self,
        *others: object,
        frames: int = 150,
        labels: Sequence[str] | None = None,
        path: Path | None = None,
    ) -> Film | FilePath:
        """The motion as a film of `frames` pictures, ten seconds by default: a `Film`, which notebooks show inline.

        `path` writes it, and returns the path: `.gif`; `.mp4` where the program ffmpeg is; `.html`, a page with the
        bodies in space, to be turned with the mouse, or with the pictures if nothing moves in space. Pictures show
        track and depth of vehicles; of others the path in space or the axes of the body, and coordinates over time.
        """
        from coadjoint.plotting.entries import entries
        from coadjoint.plotting.film import Film

        made = Film(entries([self.dataset, *others], labels), frames)
        return made if path is None else made.save(path)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        """A figure that a package above adds, such as `track` and `animation` of vehicles."""
        if name.startswith("_") or name not in ADDED:
            raise AttributeError(f"There is no figure `{name}`; there are: {', '.join(_all_names())}.")
        from coadjoint.plotting.entries import entries

        added = ADDED[name]

        def figure(
            *others: object, labels: Sequence[str] | None = None, path: Path | None = None, **options: object
        ) -> Any:
            draw = import_string(added.draw)
            if not added.film:
                return self._draw(lambda runs: draw(runs, **options), others, labels, path)
            if path is None:
                raise ArgumentError(f"`{name}` is written to a file: give its name, as in path='{name}.html'.")
            return draw(entries([self.dataset, *others], labels), path, **options)

        figure.__name__, figure.__doc__ = name, added.doc
        return figure

    def __repr__(self) -> str:
        there = ", ".join([*available(self.dataset, films=True), *OTHERS])
        return f"<figures: {there}; run.plot.{OTHERS[0]}(name) draws any variable>"

    def __call__(self, *unnamed: object, **options: object) -> NoReturn:
        raise TypeError(
            f"Each figure is a function of `plot`, as in plot.energy(); there are: {', '.join(_all_names())}."
        )

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *ADDED})

    def _draw(
        self,
        make: Callable[[list[Entry]], Figure],
        others: Sequence[object],
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


OWN: dict[str, tuple[str, ...]] = {
    "energy": ("energy", "discrete_energy"),
    "kelvin_noether": ("kelvin_noether",),
    "budget": ("energy_budget",),
    "trajectory": ("x", "q"),
    "attitude": ("euler_angles",),
    "velocities": ("xi",),
    "momenta": ("mu",),
    "group_defect": ("group_defect",),
    "inputs": ("inputs",),
}
"""The figures that any dataset may have, by the names of their methods, and a variable that each needs."""


FILMS = ("animation",)
"""The films that any dataset has."""


OTHERS = ("variable", "scene")
"""The figure that takes a name, and the page that is no figure."""


def _all_names() -> list[str]:
    return [*figure_names(), *OTHERS]


def figure_names(films: bool = True) -> list[str]:
    """The names of all figures, with or without those that are films."""
    return [*OWN, *(name for name, added in ADDED.items() if films or not added.film), *(FILMS if films else ())]


def available(dataset: Any, films: bool = False) -> list[str]:
    """The names of the figures that can be drawn of this dataset, with or without films."""
    held = {str(name) for name in dataset.data_vars}
    held |= {part for part in ("q", "inputs") for name in held if name.startswith(f"{part}_")}
    own = [name for name, needed in OWN.items() if held.intersection(needed)]
    added = [name for name, one in ADDED.items() if (films or not one.film) and import_string(one.fits)(dataset)]
    return [*own, *added, *(FILMS if films else ())]


def common(datasets: Sequence[Any]) -> list[str]:
    """The names of the figures, films aside, that can be drawn of these datasets together."""
    held = [available(dataset) for dataset in datasets]
    return [name for name in figure_names(films=False) if all(name in names for names in held)]


def save_figures(
    datasets: Sequence[object],
    folder: Path,
    wanted: Sequence[str] | None = None,
    ending: str = "png",
    labels: Sequence[str] | None = None,
) -> list[str]:
    """Write the wanted figures of the datasets as folder/name.ending, by default all that every dataset has.

    A film, such as `animation`, counts as a figure, as .html, .mp4 or else .gif. Returns the file names; raises
    ArgumentError for an unknown name, and as the figures do.
    """
    chosen = common(datasets) if wanted is None else list(wanted)
    checks.all_known(chosen, figure_names(), "figure", "A run")
    plots = Plots(datasets[0])
    files = [f"{name}.{_ending(name, ending)}" for name in chosen]
    if files:
        phase("Drawing %s.", ", ".join(files))
    for name, file in zip(chosen, files, strict=True):
        getattr(plots, name)(*datasets[1:], labels=labels, path=os.path.join(folder, file))
    return files


def _ending(name: str, ending: str) -> str:
    """The ending of a figure's file: pictures for figures, .html, .mp4 or .gif for a film."""
    moving = ending in ("gif", "html", "mp4")
    if name in FILMS or (name in ADDED and ADDED[name].film):
        return ending if moving else "gif"
    return "png" if moving else ending
