"""Figures of fields on a sphere: maps, animations and spectra of the datasets of `co.models.fluids.fields`."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coadjoint import checks
from coadjoint.errors import ArgumentError
from coadjoint.plotting.film import DOTS, ending, write
from coadjoint.plotting.style import COLUMN, PAGE, canvas, save, style

__all__ = ["animation", "spectra", "vorticity_map"]

"""Pictures of an animation."""

SLACK = 1e-9
"""How far a time may be outside the fields, of their length: round-off."""

Projection = Literal["mollweide", "hammer"]
Target = str | os.PathLike[str]


def vorticity_map(
    fields: Any,
    time: float | None = None,
    projection: Projection = "mollweide",
    variable: str = "vorticity",
    path: Target | None = None,
) -> Figure:
    """A map of the full sphere, north up, longitude 0 in the middle; colours are symmetric about 0.

    fields: a dataset of `co.models.fluids.fields`, over (time, latitude, longitude). time: s, of which the nearest node
    is drawn, within those of the fields, by default the last one. projection: "mollweide" or "hammer", both of equal
    areas. variable: by default "vorticity"; "stream_function", or "carried" where there is one. path: of the file,
    .png, .pdf or .svg, by default none. Returns a matplotlib Figure. Raises ArgumentError for others.
    """
    _require(fields, variable, projection)
    at = -1 if time is None else _node(fields, "time", time)
    with style():
        figure = canvas(PAGE * 0.7, PAGE * 0.42)
        axes = figure.add_subplot(projection=projection)
        mesh = _draw(axes, fields, variable, at, _largest(fields[variable].values[at]))
        _title(axes, fields, at)
        bar = figure.colorbar(mesh, ax=axes, orientation="horizontal", shrink=0.6, aspect=40, pad=0.03)
        bar.set_label(_label(fields, variable))
    if path is not None:
        save(figure, path)
    return figure


def animation(
    fields: Any, path: Target, projection: Projection = "mollweide", variable: str = "vorticity", frames: int = 100
) -> Path:
    """Write maps as in `vorticity_map` one after the other as a film, at most `frames`, 15 a second, in one scale.

    fields, projection, variable: as of `vorticity_map`. path: a name that ends in .gif, .mp4 or .html. frames: from
    2 to 1000, by default 100. Returns the path. Raises ArgumentError for others and for fields of one node.
    """
    target = ending(path)
    checks.whole(frames, "frames", 2, 1000)
    _require(fields, variable, projection)
    count = fields.sizes["time"]
    if count < 2:
        raise ArgumentError("These fields have one node, so there is nothing to animate.")
    nodes = np.unique(np.linspace(0, count - 1, min(frames, count)).round().astype(int))
    with style():
        figure = canvas(5.0, 2.8)
        figure.set_dpi(DOTS)
        axes: Any = figure.add_subplot(projection=projection)
        mesh = _draw(axes, fields, variable, 0, _largest(fields[variable].values))

        def pictures() -> Iterator[np.ndarray]:
            drawing: Any = figure.canvas
            for at in nodes:
                mesh.set_array(_closed(fields[variable].values[at]))
                _title(axes, fields, at)
                drawing.draw()
                yield np.array(drawing.buffer_rgba())[:, :, :3]

        return write(pictures(), target, variable)


def spectra(fields: Any, times: Any = None, variable: str = "energy_spectrum", path: Target | None = None) -> Figure:
    """The energy by degrees of spherical harmonics, on logarithmic axes, at some times.

    fields: as of `vorticity_map`. times: s, of which the nearest nodes are drawn, by default the first and the last.
    variable: by default "energy_spectrum", or "enstrophy_spectrum". path: as of `vorticity_map`.
    Returns a matplotlib Figure. Raises ArgumentError for others.
    """
    _require(fields, variable)
    t = fields["time"].values
    wanted = t[[0, -1]] if times is None else np.atleast_1d(times)
    nodes = list(dict.fromkeys(_node(fields, "times", one) for one in wanted))
    with style():
        figure = canvas(COLUMN, 0.75 * COLUMN)
        axes = figure.subplots()
        for at in nodes:
            power = fields[variable].values[at, 1:]
            seen = power > np.finfo(float).eps * np.max(power)
            axes.plot(fields["degree"].values[1:][seen], power[seen], label=f"$t$ = {t[at]:.4g} s")
        axes.set(xscale="log", yscale="log", xlabel="degree $l$", ylabel=_label(fields, variable))
        axes.legend()
    if path is not None:
        save(figure, path)
    return figure


def _draw(axes: Axes, fields: Any, variable: str, at: int, largest: float) -> Any:
    """The field of one node on the map, with the meridian of 180° on both sides."""
    longitude = np.radians(_turned(fields["longitude"].values))
    closed = np.concatenate([longitude, longitude[:1] + 2 * np.pi])
    latitude = np.radians(fields["latitude"].values)
    axes.grid(visible=False)
    axes.tick_params(labelbottom=False, labelleft=False)
    return axes.pcolormesh(
        closed, latitude, _closed(fields[variable].values[at]),
        cmap="RdBu_r", vmin=-largest, vmax=largest, shading="gouraud", rasterized=True,
    )  # fmt: skip


def _turned(longitude: np.ndarray) -> np.ndarray:
    """Longitudes of an even grid from 0° on, turned so that they begin at −180°."""
    return np.roll(np.where(longitude < 180, longitude, longitude - 360), longitude.size // 2)


def _closed(values: np.ndarray) -> np.ndarray:
    """Values (latitude, longitude) in the order of `_turned`, with the first meridian again at the end."""
    turned = np.roll(values, values.shape[1] // 2, axis=1)
    return np.concatenate([turned, turned[:, :1]], axis=1)


def _title(axes: Axes, fields: Any, at: int) -> None:
    axes.set_title(f"$t$ = {float(fields['time'].values[at]):.4g} s")


def _label(fields: Any, variable: str) -> str:
    units = str(fields[variable].attrs.get("units", "")).replace("s-1", "1/s").replace("s-2", "1/s²")
    return f"{fields[variable].attrs.get('long_name', variable)} ({units})"


def _largest(values: np.ndarray) -> float:
    return float(np.max(np.abs(values))) or 1.0


def _node(fields: Any, name: str, time: Any) -> int:
    """The node nearest to a time; raises ArgumentError for one before the first or after the last."""
    t, wanted = fields["time"].values, checks.number(time, name)
    first, last = np.min(t), np.max(t)
    if not first - SLACK * (last - first) <= wanted <= last + SLACK * (last - first):
        raise ArgumentError(
            f"Argument `{name}` must be within these fields, from {first:g} s to {last:g} s, but is {wanted:g}."
        )
    return int(np.argmin(np.abs(t - wanted)))


def _require(fields: Any, variable: str, projection: str = "mollweide") -> None:
    fits = hasattr(fields, "data_vars") and "time" in fields.dims and (variable in fields)
    checks.expect(
        fits, type(fields).__name__, "fields", f"a dataset of co.models.fluids.fields with `{variable}` over time"
    )
    checks.choice(projection, "projection", ("mollweide", "hammer"))
