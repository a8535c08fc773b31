"""The figures: ratios of time as bars, and work–precision curves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from coadjoint.plotting.style import COLOURS, PAGE, canvas, legend, save, style

_GREY = ("#333333", "#777777", "#777777", "#999999", "#555555", "#555555", "#555555", "#999999", "#999999")
_QUANTITIES = {
    "position": "position error (m)",
    "energy": "relative energy error",
    "momentum": "Kelvin–Noether error",
}
FLOOR = 1e-17
"""Smaller errors are drawn here."""


def work_precision(found: dict[str, Any], path: Path) -> Path:
    """Errors against computing time, a column a problem; ours in colour, others in grey."""
    with style():
        figure = canvas(PAGE, 6.6)
        panels = figure.subplots(len(_QUANTITIES), len(found["problems"]), sharex="col", sharey="row", squeeze=False)
        handles: dict[str, Any] = {}
        others = sorted({row["name"] for rows in found["problems"].values() for row in rows} - set(found["ours"]))
        for column, (title, rows) in enumerate(found["problems"].items()):
            panels[0][column].set_title(title)
            for line, (quantity, label) in enumerate(_QUANTITIES.items()):
                axes = panels[line][column]
                for name in [*others, *found["ours"]]:
                    points = sorted((r["time"], max(r[quantity], FLOOR)) for r in rows if r["name"] == name)
                    if points:
                        handles[name] = axes.loglog(*zip(*points, strict=True), **_look(name, found["ours"], others))[0]
                if column == 0:
                    axes.set_ylabel(label)
        for axes in panels[-1]:
            axes.set_xlabel("time, in steps of the hand-written loop")
        names = [*found["ours"], *others]
        legend(figure, [handles[name] for name in names], names)
        return save(figure, path)


def _look(name: str, ours: list[str], others: list[str]) -> dict[str, Any]:
    if name in ours:
        i = ours.index(name)
        return {"color": COLOURS[i], "marker": "os^DvPX*h<"[i], "markersize": 3, "linewidth": 1.2}
    i = others.index(name)
    dashes = ("-", "--", ":", "-.")[i % 4]
    return {
        "color": _GREY[i % len(_GREY)],
        "linestyle": dashes,
        "marker": "x+1234*.|"[i % 9],
        "markersize": 4,
        "linewidth": 0.8,
    }


def speed(found: dict[str, Any], path: Path) -> Path:
    """Time per step relative to the hand-written loop, a bar a row, on a logarithmic scale."""
    rows = {name: row["ratio"] for name, row in found["rows"].items() if "a call" not in name}
    with style():
        figure = canvas(PAGE, 0.6 + 0.17 * len(rows))
        axes = figure.subplots()
        colours = [{"nat": COLOURS[0], "XLA": COLOURS[5]}.get(name[:3], "#999999") for name in rows]
        axes.barh(list(rows), list(rows.values()), color=colours, height=0.7)
        axes.axvline(1.0, color="black", linewidth=0.8)
        for i, ratio in enumerate(rows.values()):
            axes.text(ratio * 1.08, i, f"{ratio:.3g}", va="center", fontsize=6.5)
        axes.set_xscale("log")
        axes.set_xlim(0.5, 6 * max(rows.values()))
        axes.invert_yaxis()
        axes.grid(axis="y", visible=False)
        axes.set_xlabel("time per step, relative to the hand-written left rule")
        return save(figure, path)


def courses(found: dict[str, Any], path: Path) -> Path:
    """Largest energy error so far against time, a panel a problem; ours in colour, others in grey."""
    chosen = [
        found["paper"], "midpoint", "Suzuki-4 (midpoint)", "Kahan–Li-6 (midpoint)", "Kahan–Li-8 (midpoint)",
        "Sofroniou–Spaletta-10 (midpoint)",
    ]  # fmt: skip
    others = sorted({n for rows in found["courses"].values() for n in rows if n.startswith(("RK4", "DOP", "MuJoCo"))})
    with style():
        figure = canvas(PAGE, 3.9)
        panels = figure.subplots(1, len(found["courses"]), squeeze=False)[0]
        handles: dict[str, Any] = {}
        for axes, (title, rows) in zip(panels, found["courses"].items(), strict=True):
            axes.set_title(title)
            axes.set_xlabel("t (s)")
            for name in [*chosen, *others]:
                if name in rows:
                    times, worst = [row[0] for row in rows[name]], 0.0
                    errors = [worst := max(worst, row[1], 1e-16) for row in rows[name]]
                    look = _look(name, chosen, others) | {"marker": ""}
                    handles[name] = axes.semilogy(times[1:], errors[1:], **look)[0]
            axes.set_ylim(top=min(axes.get_ylim()[1], 10.0))
        panels[0].set_ylabel("largest relative energy error so far")
        names = [name for name in [*chosen, *others] if name in handles]
        legend(figure, [handles[name] for name in names], names)
        return save(figure, path)


def top(found: dict[str, Any], path: Path) -> Path:
    """Position error of the fast heavy top at t = 2 s against computing time; ours in colour, others in grey."""
    ours = list(found["ours"])
    others = sorted({row["name"] for row in found["top"]} - set(ours))
    with style():
        figure = canvas(PAGE, 3.8)
        axes = figure.subplots()
        handles = []
        for name in [*ours, *others]:
            points = sorted((r["seconds"], max(r["error"], 1e-13)) for r in found["top"] if r["name"] == name)
            handles += axes.loglog(*zip(*points, strict=True), **_look(name, ours, others))
        axes.axhline(1e-10, color="black", linewidth=0.6, linestyle=":")
        axes.set_xlabel("computing time (s)")
        axes.set_ylabel("position error at t = 2 s (m)")
        legend(figure, handles, [*ours, *others])
        return save(figure, path)


def ideal_fluid(found: dict[str, Any], path: Path) -> Path:
    """Largest energy error so far of bodies in an ideal fluid, a panel a body; ours in colour, others in grey."""
    ours = list(found["ours"])
    labels = {
        f"{r['name']}, {r['step']:g} s" for rows in found["bodies"].values() for r in rows if r["name"] not in ours
    }
    others = sorted(labels)
    with style():
        figure = canvas(PAGE, 4.3)
        panels = figure.subplots(1, len(found["bodies"]), squeeze=False)[0]
        handles: dict[str, Any] = {}
        for axes, (title, rows) in zip(panels, found["bodies"].items(), strict=True):
            axes.set_title(title)
            axes.set_xlabel("t (s)")
            for row in rows:
                name = row["name"] if row["name"] in ours else f"{row['name']}, {row['step']:g} s"
                times, errors = zip(*((t, max(e, 1e-16)) for t, e in row["course"]), strict=True)
                handles[name] = axes.semilogy(times, errors, **(_look(name, ours, others) | {"marker": ""}))[0]
            axes.set_ylim(top=min(axes.get_ylim()[1], 100.0))
        panels[0].set_ylabel("largest relative energy error so far")
        names = [name for name in [*ours, *others] if name in handles]
        legend(figure, [handles[name] for name in names], names)
        return save(figure, path)
