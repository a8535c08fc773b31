"""A standard manoeuvre on a page: its track, its course over time and its figures of merit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coadjoint.plotting.style import COLOURS, PAGE, WANTED, canvas
from coadjoint.texts import Table
from coadjoint_vehicles.trials.merits import Merit, steady_rates
from coadjoint_vehicles.trials.track import Track

_TABLE = ("advance", "transfer", "tactical_diameter", "maximum_transfer", "steady_radius", "steady_rate", "speed_ratio")
_TABLE += (
    "first_overshoot",
    "second_overshoot",
    "largest_overshoot",
    "time_to_first_reversal",
    "initial_turning",
    "period",
)
_TABLE += ("loop_height", "loop_width", "track_reach", "head_reach", "side_reach", "stopping_time", "remaining_speed")
_TABLE += ("rate_before", "residual_rate", "decay_time", "K", "T")


def page(track: Track, merits: Mapping[str, Merit], table: Sequence[tuple[str, str, str, str, str]]) -> Figure:
    """Track, course over time and figures of merit of a manoeuvre; table: rows as `TrialResult.rows`."""
    figure = canvas(PAGE, 3.4)
    left, middle, right = figure.subplots(1, 3, width_ratios=[1.0, 1.15, 0.95])
    _draw_track(left, track, merits)
    {"spiral": _draw_spiral, "stop": _draw_speed}.get(track.manoeuvre, _draw_course)(middle, track)
    right.axis("off")
    rows = {name.replace("_", " ") for name in _TABLE}
    shown = [row for row in table if row[0] in rows]
    lines = [f"{name:<23}{value:>7} {unit if unit != '1' else '':<4}{short}" for name, value, unit, short, _ in shown]
    right.text(0.0, 1.0, "\n".join(lines), family="monospace", fontsize=6.3, va="top", linespacing=1.7)
    figure.suptitle(track.manoeuvre.replace("_", " "), fontsize=9)
    return figure


class TrialCurve(NamedTuple):
    """A trial among several in one figure. look: the style of its curves."""

    label: str
    track: Track
    merits: Mapping[str, Merit]
    look: Table


def page_of_several(trials: Sequence[TrialCurve]) -> Figure:
    """Tracks, courses over the time since the first execute, and figures of merit of several manoeuvres."""
    figure = canvas(PAGE, 3.4)
    left, middle, right = figure.subplots(1, 3, width_ratios=[1.0, 1.15, 0.95])
    kinds = sorted({one.track.manoeuvre.replace("_", " ") for one in trials})
    kind = kinds[0] if len(kinds) == 1 else ""
    for label, track, _, look in trials:
        along, aside = track.ahead_and_aside[track.travelled >= -0.25 * max(track.travelled[-1], 1e-9)].T
        left.plot(aside, along, label=label, **look)
        assert track.rate is not None
        if kind == "spiral":
            middle.plot(*(np.degrees(part) for part in steady_rates(track)), marker="o", markersize=3, **look)
        else:
            answers = {"zigzag": np.degrees(track.turned), "stop": track.speed}
            middle.plot(track.time - (track.begin or 0.0), answers.get(kind, np.degrees(track.rate)), **look)
    left.set(xlabel="to starboard (m)", ylabel="along the course (m)")
    left.set_aspect("equal", adjustable="datalim")
    left.margins(0.08)
    xlabel = "rudder order (°)" if kind == "spiral" else "time since the execute (s)"
    ylabels = {"zigzag": "change of heading (°)", "stop": "speed ahead (m/s)", "spiral": "steady rate of turn (°/s)"}
    middle.set(xlabel=xlabel, ylabel=ylabels.get(kind, "rate of turn (°/s)"))
    left.legend(loc="lower center", bbox_to_anchor=(0.45, 1.0), ncols=2, fontsize=6.5)
    right.axis("off")
    size = 6.3 * min(1.0, 3 / len(trials))
    right.text(0.0, 1.0, _side_by_side(trials), family="monospace", fontsize=size, va="top", linespacing=1.7)
    figure.suptitle(", ".join(kinds), fontsize=9)
    return figure


def _side_by_side(trials: Sequence[TrialCurve]) -> str:
    """A line for each figure of merit that one of the trials has, with a dash for those that lack it."""
    rows = [f"{'':<23}" + "".join(f"{_short(one.label):>11}" for one in trials)]
    for name in _TABLE:
        found = [one.merits.get(name) for one in trials]
        unit = next((one.unit for one in found if one is not None), None)
        if unit is not None:
            values = "".join(f"{'–' if one is None else format(one.value, '.4g'):>11}" for one in found)
            rows.append(f"{name.replace('_', ' '):<23}{values} {'' if unit == '1' else unit}".rstrip())
    return "\n".join(rows)


def _short(label: str) -> str:
    return label if len(label) <= 10 else f"…{label[-9:]}"


def _draw_track(axes: Axes, track: Track, merits: Mapping[str, Merit]) -> None:
    """The path from above, the course upwards, with the distances of a turning circle."""
    approach = track.travelled >= -0.25 * max(track.travelled[-1], 1e-9)
    along, aside = track.ahead_and_aside[approach].T
    axes.plot(aside, along, color=COLOURS[0])
    axes.plot(0, 0, "o", color="black", markersize=4, zorder=3)
    if "tactical_diameter" in merits:
        names = ("advance", "transfer", "tactical_diameter")
        advance, transfer, diameter = (merits[name].value * (name == "advance" or track.side) for name in names)
        axes.plot([transfer, transfer], [0, advance], label="advance", **{**WANTED, "color": COLOURS[1]})
        axes.plot([0, transfer], [advance, advance], label="transfer", **{**WANTED, "color": COLOURS[2]})
        axes.plot([0, diameter], [0, 0], label="tactical diameter", **{**WANTED, "color": COLOURS[3]})
        axes.legend(
            loc="lower center", bbox_to_anchor=(0.45, 1.0), ncols=2, handlelength=1.2, columnspacing=0.9, fontsize=6.5
        )
    axes.set(xlabel="to starboard (m)", ylabel="along the course (m)")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)


def _draw_course(axes: Axes, track: Track) -> None:
    """The rudder, its order and what answers over time: of a zigzag the change of heading, else the rate of turn."""
    assert track.rate is not None
    zigzag = track.manoeuvre == "zigzag"
    answer, label = (track.turned, "heading") if zigzag else (track.rate, "rate of turn")
    axes.plot(track.time, np.degrees(answer), color=COLOURS[0], label=label)
    if track.rudder is not None:
        axes.plot(track.time, np.degrees(track.rudder), color=COLOURS[1], linewidth=0.9, label="rudder")
    axes.step(track.time, np.degrees(track.order), where="post", label="order", **WANTED)
    _timed(axes, track, "change of heading, rudder (°)" if zigzag else "rate of turn (°/s), rudder (°)")


def _draw_speed(axes: Axes, track: Track) -> None:
    """The speed ahead over time."""
    axes.plot(track.time, track.speed, color=COLOURS[0], label="speed ahead")
    _timed(axes, track, "speed (m/s)")


def _draw_spiral(axes: Axes, track: Track) -> None:
    """The steady rate of turn at each order, in the order in which they were held."""
    orders, rates = steady_rates(track)
    axes.plot(np.degrees(orders), np.degrees(rates), color=COLOURS[0], marker="o", markersize=3)
    axes.axhline(0, color="#999999", linewidth=0.6)
    axes.axvline(0, color="#999999", linewidth=0.6)
    axes.set(xlabel="rudder order (°)", ylabel="steady rate of turn (°/s)")


def _timed(axes: Axes, track: Track, label: str) -> None:
    axes.axvline(track.begin or 0.0, color="#999999", linewidth=0.6)
    axes.set(xlabel="time $t$ (s)", ylabel=label)
    axes.set_xlim(track.time[0], track.time[-1])
    axes.legend(
        loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=6.5, handlelength=1.2, columnspacing=0.9
    )
