"""Figures of a sweep: all members in parallel coordinates, responses to the varied numbers, and failed members."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.plotting import style
from coadjoint.plotting.decimation import some
from coadjoint.texts import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from coadjoint.sweeps.results import SweepResults

MOST_LINES, MOST_POINTS = 1000, 20_000
"""Members in a figure at most, chosen at random."""
MOST_NUMBERS, MOST_PANELS = 6, 6
CELLS = 24
"""Cells of a response surface along each axis, at most."""
DENSE = 4
"""Members for each cell, from which on means over cells are drawn instead of points."""


def columns(
    made: SweepResults, chosen: np.ndarray | None = None
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """The numbers that vary and the results, each one number of a member, by name with its place and unit.

    chosen: the members, by default MOST_POINTS of them at most.
    """
    found = made.dataset
    numbers: dict[str, np.ndarray] = {}
    results: dict[str, np.ndarray] = {}
    chosen = some(found.sizes["member"], MOST_POINTS) if chosen is None else chosen
    for name in (*found.coords, *found.data_vars):
        array = found[name]
        if "member" not in array.dims or "time" in array.dims or name in ("code", "steps_done", "member"):
            continue
        values = array.values[chosen].reshape(len(chosen), -1)
        own = [str(word) for word in array["angle"].values] if "angle" in array.dims else None
        kept = numbers if array.attrs.get("swept") else results
        for place, column in enumerate(values.T):
            end = "" if values.shape[1] == 1 else f"[{own[place] if own else place}]"
            kept[f"{name}{end}"] = column
    return numbers, results


def _set_title(figure: Figure, *parts: str) -> None:
    """The omissions of a figure, as its title; empty if it shows all."""
    if sentence := "; ".join(filter(None, parts)):
        figure.suptitle(sentence, fontsize=8)


def _of(shown: int, all_of: int, what: str = "members") -> str:
    """The number shown and the total; empty if all are shown."""
    return f"{shown:,} of {all_of:,} {what}, chosen at random" if shown < all_of else ""


def parallel(made: SweepResults, results: Sequence[str] = ()) -> Figure:
    """Every member as a line through its numbers and results, coloured by the last result.

    results: names as "final_q[2]", by default the final states. Raises ArgumentError for an unknown one.
    """
    good = np.flatnonzero(made.dataset["code"].values == 0)
    numbers, found = columns(made, good[some(len(good), MOST_LINES)])
    shown = _chosen(results, found, _usual(found))
    table = {**dict(list(numbers.items())[:MOST_NUMBERS]), **{name: found[name] for name in shown}}
    values = np.stack([*table.values()], axis=1)
    values = values[np.isfinite(values).all(axis=1)]
    with style.style():
        from matplotlib.cm import ScalarMappable
        from matplotlib.collections import LineCollection
        from matplotlib.colors import Normalize

        figure = style.canvas(style.PAGE, 3.0)
        axes = figure.add_subplot()
        low, high = values.min(axis=0, initial=np.inf), values.max(axis=0, initial=-np.inf)
        share = np.where(high > low, (values - low) / np.where(high > low, high - low, 1.0), 0.5)
        if len(values):
            scale = Normalize(low[-1], high[-1])
            rows = [np.column_stack([np.arange(values.shape[1]), row]) for row in share]
            lines = LineCollection(rows, cmap="viridis", norm=scale, linewidths=0.5, alpha=0.5)
            lines.set_array(values[:, -1])
            axes.add_collection(lines)
            figure.colorbar(ScalarMappable(scale, "viridis"), ax=axes, label=_with_unit(made, [*table][-1]), pad=0.02)
        for place in range(len(table)):
            axes.axvline(place, color="#555555", linewidth=0.6)
            for end, at, side in ((low, 0.0, "top"), (high, 1.0, "bottom")):
                if np.isfinite(end[place]):
                    axes.text(
                        place, at + (0.02 if at else -0.02), f"{end[place]:.4g}", ha="center", va=side, fontsize=7
                    )
        axes.set_xticks(range(len(table)), [_short(_with_unit(made, name)) for name in table], fontsize=7)
        axes.tick_params(axis="x", length=0, pad=12)
        axes.set(xlim=(-0.3, len(table) - 0.7), ylim=(-0.1, 1.1), yticks=[])
        axes.grid(False)
        axes.spines[["left", "bottom"]].set_visible(False)
        every = made.dataset.sizes["member"]
        failed = every - len(good)
        lost = f"{failed:,} of {every:,} members failed and are not shown" if failed else ""
        _set_title(figure, _of(len(values), len(good), "members that did not fail" if failed else "members"), lost)
    return figure


def responses(made: SweepResults, result: str = "") -> Figure:
    """A result over the varied numbers: over one number, and the mean over cells of each pair of numbers.

    result: as "final_q[2]", by default the one that depends most on the varied numbers. Raises ArgumentError.
    """
    numbers, found = columns(made)
    (name,) = _chosen([result] if result else [], found, [_liveliest(numbers, found)])
    good = np.isfinite(found[name])
    ties = {key: _tie(column[good], found[name][good]) for key, column in numbers.items() if _varies(column[good])}
    keys = sorted(ties, key=ties.__getitem__, reverse=True)[:4]
    pairs = [*combinations(keys, 2)][:MOST_PANELS] or [(key, "") for key in keys]
    with style.style():
        across = min(len(pairs), 3)
        down = -(-len(pairs) // across) if across else 1
        figure = style.canvas(style.PAGE if across > 1 else style.COLUMN, 2.3 * down + 0.2)
        shades: Any = None
        limits = (float(np.min(found[name][good], initial=np.inf)), float(np.max(found[name][good], initial=-np.inf)))
        for place, (a, b) in enumerate(pairs):
            axes = figure.add_subplot(down, across, place + 1)
            axes.set_xlabel(_short(a, 1))
            if not b:
                axes.plot(numbers[a][good], found[name][good], ".", markersize=2)
                axes.set_ylabel(_with_unit(made, name))
                continue
            shades = _surface(axes, numbers[a][good], numbers[b][good], found[name][good], limits)
            axes.set(ylabel=_short(b, 1), xlim=_ends(numbers[a]), ylim=_ends(numbers[b]))
        if shades is not None:
            figure.colorbar(shades, ax=figure.axes, label=_with_unit(made, name))
        _set_title(figure, _of(len(good), made.dataset.sizes["member"]))
    return figure


def failure_map(made: SweepResults) -> Figure:
    """Which members failed, and why, over each pair of numbers."""
    from coadjoint.sweeps.results import CAUSES

    codes = made.dataset["code"].values
    bad, good = np.flatnonzero(codes), np.flatnonzero(codes == 0)
    lost = bad[some(len(bad), MOST_POINTS // 2)]  # all of them, if they are few among many
    kept = good[some(len(good), MOST_POINTS - len(lost))]
    chosen = np.sort(np.concatenate([lost, kept]))
    (numbers, _), codes = columns(made, chosen), codes[chosen]
    keys = [key for key, column in numbers.items() if np.ptp(column) > 0][:4]
    pairs = [*combinations(keys, 2)][:MOST_PANELS] or [(key, key) for key in keys]
    with style.style():
        across = min(len(pairs), 3)
        down = -(-len(pairs) // across) if across else 1
        figure = style.canvas(style.PAGE if across > 1 else style.COLUMN, 2.3 * down + 0.2)
        marks: Table = {}
        for place, (a, b) in enumerate(pairs):
            axes = figure.add_subplot(down, across, place + 1)
            axes.set(xlabel=_short(a, 1), ylabel=_short(b, 1))
            for order, code in enumerate(sorted(set(codes.tolist()), key=abs)):
                here = codes == code
                colour = "#8c8c8c" if code == 0 else style.COLOURS[1 + (order - 1) % 6]
                own = {"markersize": 1.5 if code == 0 else 3.5, "color": colour, "linestyle": ""}
                (mark,) = axes.plot(numbers[a][here], numbers[b][here], "." if code == 0 else "x", **own)
                marks.setdefault("good" if code == 0 else CAUSES.get(code, str(code)), mark)
        style.legend(figure, [*marks.values()], [*marks], least=1)
        _set_title(
            figure,
            _of(len(kept), len(good), "members that did not fail"),
            _of(len(lost), len(bad), "members that failed"),
        )
    return figure


def save_figures(made: SweepResults, folder: Path) -> list[str]:
    """Write all figures of a sweep, and return their names."""
    figures: dict[str, Figure] = {}
    if made.summary["finished"]:
        figures["parallel"] = parallel(made)
        figures["responses"] = responses(made)
    if made.failures:
        figures["failures"] = failure_map(made)
    return [style.save(figure, folder / f"{name}.png", dpi=200).name for name, figure in figures.items()]


def _surface(axes: PyTree, x: np.ndarray, y: np.ndarray, values: np.ndarray, limits: tuple[float, float]) -> Any:
    """Means of the values over cells of two numbers, or over those of a grid; points where members are few."""
    if len(values) < DENSE * CELLS**2 and not all(len(np.unique(column)) <= CELLS for column in (x, y)):
        size = float(np.clip(2000 / len(values), 1.0, 20.0))
        return axes.scatter(x, y, s=size, c=values, cmap="viridis", vmin=limits[0], vmax=limits[1], linewidths=0)
    edges = [_edges(column) for column in (x, y)]
    count, *_ = np.histogram2d(x, y, bins=edges)
    total, *_ = np.histogram2d(x, y, bins=edges, weights=values)
    mean = np.divide(total, count, out=np.full(count.shape, np.nan), where=count > 0)
    axes.grid(False)
    return axes.pcolormesh(edges[0], edges[1], mean.T, cmap="viridis", vmin=limits[0], vmax=limits[1])


def _edges(column: np.ndarray) -> np.ndarray:
    once = np.unique(column)
    if 2 <= len(once) <= CELLS:
        middle = (once[1:] + once[:-1]) / 2
        return np.concatenate([once[:1], middle, once[-1:]])
    cells = int(np.clip(np.sqrt(len(column) / 4), 2, CELLS))
    return np.linspace(column.min(), column.max(), cells + 1)


def _ends(column: np.ndarray) -> tuple[float, float]:
    return float(column.min()), float(column.max())


def _usual(found: dict[str, np.ndarray]) -> list[str]:
    """Up to three final results that are not constant."""
    ends = [name for name, column in found.items() if name.startswith("final_") and _varies(column)]
    return ends[:3] or [name for name in found if name.startswith("final_")][:1]


def _varies(column: np.ndarray) -> bool:
    good = column[np.isfinite(column)]
    return len(good) > 1 and np.ptp(good) > 1e-9 * np.max(np.abs(good))


def _liveliest(numbers: dict[str, np.ndarray], found: dict[str, np.ndarray]) -> str:
    """The final result that correlates most with a number that varies."""

    def best(name: str) -> float:
        good = np.isfinite(found[name])
        return max((_tie(column[good], found[name][good]) for column in numbers.values()), default=0.0)

    return max(_usual(found), key=best)


def _tie(column: np.ndarray, result: np.ndarray) -> float:
    """The size of the correlation of two columns."""
    return abs(float(np.corrcoef(column, result)[0, 1])) if _varies(column) and _varies(result) else 0.0


def _chosen(given: Sequence[str], found: dict[str, np.ndarray], usual: Sequence[str]) -> list[str]:
    for name in given:
        checks.known(name, found, "result", "The sweep")
    return list(given) or list(usual)


def _with_unit(made: SweepResults, name: str) -> str:
    """A result with its unit in the dataset, as "final_q[2] (m)"; a varied number has its unit in its name."""
    array = made.dataset.data_vars.get(name.split("[")[0])
    unit = "" if array is None else array.attrs.get("units", "")
    return f"{name} ({unit})" if unit not in ("", "1") else name


def _short(name: str, lines: int = 2) -> str:
    """A name without its section, `parameters.water.velocity_m_s[0]` as water velocity_m_s[0]."""
    parts = name.split(".")
    return (" " if lines == 1 else "\n").join(parts[1:] if len(parts) > 1 else parts)
