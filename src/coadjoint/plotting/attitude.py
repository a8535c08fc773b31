"""Yaw, pitch and roll over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, MultipleLocator

from coadjoint.plotting.entries import Entry, fewest, require
from coadjoint.plotting.style import COLUMN, WANTED, canvas, legend, time_axis

_SENTENCE = (
    "There is no attitude to draw: `attitude` needs a group with rotations of space, SO(3) or SE(3); "
    "mechanism.joint_data(run) has the angles of joints."
)


def attitude(runs: Sequence[Entry], unwrap: bool) -> Figure:
    """Yaw, pitch and roll in degrees, a panel each.

    Angles stay within ±180° and their curves break where they jump; with `unwrap` yaw and roll count full turns.
    """
    for run in runs:
        require(run, ["euler_angles"], _SENTENCE)
    figure = canvas(COLUMN, 3.6)
    column = figure.subplots(3, 1, sharex=True)
    for component, (axes, name) in enumerate(zip(column, ("yaw", "pitch", "roll"), strict=True)):
        for run in runs:
            angle = run.values("euler_angles")[:, component]
            time, degrees = _unwrapped(run, angle) if unwrap else _broken(run, angle)
            axes.plot(time, degrees, label="angle" if len(runs) == 1 else run.label, **run.look)
        _set_points(axes, runs[0], name, unwrap)
        axes.set_ylabel(f"{name} (°)")
        low, high = axes.get_ylim()
        axes.yaxis.set_major_locator(MultipleLocator(90) if 200 < high - low < 500 else MaxNLocator(5))
    time_axis(column, [run.time for run in runs])
    said = {text: line for axes in column for line, text in zip(*axes.get_legend_handles_labels(), strict=True)}
    legend(figure, list(said.values()), list(said), fewest(runs))
    return figure


def _set_points(axes: Axes, run: Entry, name: str, unwrap: bool) -> None:
    """The set point of an angle, where the run has one; of yaw also under the name `heading`."""
    for source in (f"inputs_{name}", *(["inputs_heading"] if name == "yaw" else [])):
        if source in run.dataset and run.values(source).ndim == 1 and run.unit(source) == "rad":
            wanted = run.values(source)
            time, degrees = _unwrapped(run, wanted) if unwrap else _broken(run, np.angle(np.exp(1j * wanted)))
            axes.plot(time, degrees, label="set point", **WANTED)


def _unwrapped(run: Entry, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    turned = np.degrees(np.unwrap(angle))
    kept = run.thin(turned)
    return run.time[kept], turned[kept]


def _broken(run: Entry, angle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The thinned curve with a gap at every jump across ±180°."""
    kept = run.thin(angle)
    time, degrees = run.time[kept], np.degrees(angle[kept])
    jumps = np.flatnonzero(np.abs(np.diff(degrees)) > 180.0) + 1
    return np.insert(time, jumps, time[jumps]), np.insert(degrees, jumps, np.nan)
