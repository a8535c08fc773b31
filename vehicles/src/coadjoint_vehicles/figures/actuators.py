"""The actuators: their actual values, their commands and their limits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coadjoint.errors import ArgumentError
from coadjoint.plotting.entries import Entry
from coadjoint.plotting.style import COLUMN, WANTED, canvas
from coadjoint.texts import Table
from coadjoint_vehicles.figures.motions import draw_components, finish, key
from coadjoint_vehicles.logs.records import VehicleRecords

_LIMIT: Table = {"color": "#bb0000", "linestyle": (0, (1, 2)), "linewidth": 0.8, "zorder": 1.2}
_SHOWN = {"rad": (180 / np.pi, "°"), "m³": (1e3, "L"), "1/s": (60.0, "rpm"), "us": (1.0, "µs")}
"""The factor and the unit of figures, by SI unit."""
_LONGEST = 16
"""Letters of the names beside an axis; more are called actuators."""
_NEAR = 0.4
"""A limit is drawn where an actuator comes nearer to it than this part of it."""


def actuators(runs: Sequence[Entry]) -> Figure:
    """A panel for each actuator: its actual value, its command (dashed), its limits (dotted)."""
    names = names_of(runs)
    if not names:
        raise ArgumentError(f"There are no actuators to draw: the run of {runs[0].label} has none.")
    figure = canvas(COLUMN, 0.5 + 1.35 * len(names))
    column = list(np.atleast_1d(figure.subplots(len(names), 1, sharex=True)))
    for axes, name in zip(column, names, strict=True):
        draw_actuators(axes, runs, [name])
    finish(figure, column, runs)
    return figure


def names_of(runs: Sequence[Entry]) -> list[str]:
    """The names of the actuators of all runs."""
    return list(dict.fromkeys(name for run in runs for name in VehicleRecords(run.dataset).actuators))


def by_unit(runs: Sequence[Entry]) -> list[list[str]]:
    """The names of the actuators, those of one unit together."""
    found: dict[str, list[str]] = {}
    for run in runs[:1]:
        for name, actuator in VehicleRecords(run.dataset).actuators.items():
            found.setdefault(actuator.unit, []).append(name)
    return list(found.values())


def draw_actuators(axes: Axes, runs: Sequence[Entry], names: Sequence[str]) -> None:
    """Actuators of one unit on these axes; commands only for a single actuator."""
    labels: list[str] = []
    unit = ""
    for run in runs:
        labels, first = [], 0
        for name in names:
            actuator = VehicleRecords(run.dataset).actuators.get(name)
            if actuator is None:
                continue
            factor, unit = _SHOWN.get(actuator.unit, (1.0, actuator.unit))
            actual = factor * actuator.actual.reshape(len(actuator.actual), -1)
            if actuator.command is not None and len(names) == 1 and run is runs[0]:
                said = "command" if len(runs) == 1 else f"command of {_one(run)}"
                _draw_commands(axes, run, factor * actuator.command.reshape(len(actual), -1), said)
            draw_components(axes, run, actual, first)
            if run is runs[0]:
                _draw_limits(axes, [float(b) for end in actuator.ends for b in np.unique(factor * end)], actual)
            first += actual.shape[1]
            said = name.replace("_", " ")
            numbers = [str(i + 1) for i in range(actual.shape[1])]
            labels += [said] if len(numbers) == 1 else [f"{said} 1", *numbers[1:]]
    said = " and ".join(name.replace("_", " ") for name in names)
    said = said if len(said) <= _LONGEST else "actuators"
    axes.set_ylabel(said if unit in ("", "1") else f"{said} ({unit})")
    key(axes, labels)


def _one(run: Entry) -> str:
    """The run whose commands are drawn, among several."""
    return "the first" if run.crowd > 1 else run.label


def _draw_commands(axes: Axes, run: Entry, commands: np.ndarray, said: str) -> None:
    for number, series in enumerate(commands.T):
        kept = run.thin(series)
        axes.step(run.time[kept], series[kept], where="post", label="_" if number else said, **WANTED)


def _draw_limits(axes: Axes, limits: Sequence[float], actual: np.ndarray) -> None:
    """The limits that the actuator comes near to, both where it goes to both sides; others would dwarf its curve."""
    near = [limit for limit in limits if np.min(np.abs(actual - limit), initial=np.inf) <= _NEAR * abs(limit)]
    both_sides = near and np.min(actual) < 0 < np.max(actual)
    for limit in limits if both_sides else near:
        known = any(line.get_label() == "limit" for line in axes.get_lines())
        axes.axhline(limit, label="_" if known else "limit", **_LIMIT)
