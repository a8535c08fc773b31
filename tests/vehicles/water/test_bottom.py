"""A bottom on a grid against closed forms: a plane, a sine, the place where a body meets it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import jax
import numpy as np
import pytest
import xarray

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.errors import CoadjointError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint_vehicles import water
from coadjoint_vehicles.water import Bottom

NORTH, EAST = np.linspace(-50.0, 150.0, 41), np.linspace(-100.0, 100.0, 81)
PLANE = 30.0 + 0.1 * NORTH[:, None] - 0.05 * EAST


@pytest.mark.cases(1)
@pytest.mark.parametrize("between", ["bilinear", "bicubic"])
def test_a_plane_is_met_exactly_with_its_slope(between) -> None:
    bottom = Bottom(NORTH, EAST, PLANE, between)
    for n, e in ((3.3, 7.7), (80.0, -42.1), (0.0, 0.0)):
        assert evaluate(bottom, n, e) == pytest.approx(30.0 + 0.1 * n - 0.05 * e, rel=1e-13)
        slope = evaluate(jax.grad(lambda x, e=e: bottom(x, e)), n + 0.01)
        assert float(slope) == pytest.approx(0.1, rel=1e-9)
    assert evaluate(bottom, 1e4, 0.0) == pytest.approx(45.0, rel=1e-12)  # level beyond the grid


@pytest.mark.long
def test_a_sine_is_met_to_the_second_and_to_the_third_order() -> None:
    """d = 40 + 5 sin kn: bilinear within k²h²·5/8, bicubic falling by 2³ or more as h is halved."""
    k = 2 * np.pi / 60.0
    places = np.linspace(5.0, 95.0, 301)
    errors = {}
    for between in ("bilinear", "bicubic"):
        for h in (4.0, 2.0):
            grid = np.arange(-20.0, 121.0, h)
            bottom = Bottom(grid, [0.0, 1.0], np.repeat(40 + 5 * np.sin(k * grid)[:, None], 2, axis=1), between)
            found = np.array([float(evaluate(bottom, n, 0.3)) for n in places])
            errors[between, h] = np.max(np.abs(found - 40 - 5 * np.sin(k * places)))
    assert errors["bilinear", 2.0] <= 5 * k**2 * 4 / 8 * 1.001
    assert errors["bilinear", 4.0] / errors["bilinear", 2.0] == pytest.approx(4.0, rel=0.1)
    assert errors["bicubic", 4.0] / errors["bicubic", 2.0] > 7.0


@pytest.mark.long
def test_a_body_that_goes_ahead_meets_a_rising_plane_where_it_stands() -> None:
    """Over d = 12 − 0.2 n it meets the bottom at n = 10 m, before its Munk moment turns it, and is 1 m above at 5 m."""
    body = vehicles.load("ellipsoid")
    craft = vehicles.Craft(body)
    rising = Bottom(NORTH, EAST, np.broadcast_to(12.0 - 0.2 * NORTH[:, None], (41, 81)))
    start = craft.start(position=(0, 0, 10.0), speed=1.0)
    for clearance, north in ((0.0, 10.0), (1.0, 5.0)):
        event = water.at_bottom(rising, clearance)
        run = co.simulate(craft.system, start, dt=0.05, duration=60.0, until=event)
        n, _, z = run.final.q
        assert run.event is not None and n == pytest.approx(north, abs=0.1)
        assert z + clearance == pytest.approx(12.0 - 0.2 * n, abs=1e-9)


def test_files_of_both_formats_are_one_bottom_and_wrong_ones_have_a_sentence(tmp_path: Path) -> None:
    grid = xarray.DataArray(PLANE, {"north": NORTH, "east": EAST}, ("north", "east"))
    xarray.Dataset({"depth": grid}).to_netcdf(tmp_path / "a.nc")
    xarray.Dataset({"elevation": -grid.transpose()}).to_netcdf(tmp_path / "b.nc")
    rows = [f"{n},{e},{PLANE[i, j]!r}" for i, n in enumerate(NORTH[:5]) for j, e in enumerate(EAST[:4])]
    rows = [row.replace("np.float64(", "").replace(")", "") for row in rows]
    (tmp_path / "c.csv").write_text("north,east,depth\n" + "\n".join(rows) + "\n")
    made = [Bottom.from_netcdf(tmp_path / "a.nc"), Bottom.from_netcdf(tmp_path / "b.nc")]
    np.testing.assert_array_equal(made[0].depth, made[1].depth)
    np.testing.assert_array_equal(Bottom.from_csv(tmp_path / "c.csv").depth, PLANE[:5, :4])
    (tmp_path / "c.csv").write_text("north,east,depth\n" + "\n".join(rows[:-1]) + "\n")
    (tmp_path / "d.nc").write_text("depth")
    xarray.Dataset({"temperature": grid}).to_netcdf(tmp_path / "e.nc")
    for name, expected in (("c.csv", "one row for each"), ("d.nc", "can be read"), ("e.nc", "variable depth")):
        with pytest.raises(CoadjointError, match=expected):
            (Bottom.from_csv if name.endswith("csv") else Bottom.from_netcdf)(tmp_path / name)
    for north, depth, expected in (
        ([0.0, 1.0, 3.0], np.zeros((3, 2)), "evenly spaced"),
        ([1.0, 0.0], np.zeros((2, 2)), "that rise"),
        ([0.0, 1.0], np.zeros((3, 2)), "must have shape"),
        ([0.0, 1.0], np.full((2, 2), np.nan), "finite"),
    ):
        with pytest.raises(CoadjointError, match=expected):
            Bottom(north, [0.0, 1.0], depth)


def netcdf(path, name="depth", values=PLANE, **attrs):
    axes = {axis: attrs.pop(axis, {}) for axis in ("north", "east")}
    coords = {"north": ("north", NORTH, axes["north"]), "east": ("east", EAST, axes["east"])}
    xarray.Dataset({name: (("north", "east"), values, attrs)}, coords).to_netcdf(path)
    return path


def test_what_counts_up_in_netcdf_becomes_a_depth(tmp_path: Path) -> None:
    """By the name, or by the attribute of the CF conventions, whatever the name is."""
    for name, values, attrs in (
        ("depth", PLANE, {"units": "m"}),
        ("depth", -PLANE, {"positive": "up"}),
        ("elevation", -PLANE, {}),
        ("elevation", PLANE, {"positive": "down"}),
        ("z", -PLANE, {"positive": "up"}),
    ):
        bottom = Bottom.from_netcdf(netcdf(tmp_path / "x.nc", name, values, **attrs))
        assert evaluate(bottom, 10.0, 20.0) == pytest.approx(30.0, rel=1e-12), (name, attrs)


@pytest.mark.parametrize(
    ("name", "values", "attrs", "words"),
    [
        ("z", -PLANE, {}, "does not say whether z counts up"),
        ("depth", PLANE, {"positive": "left"}, 'must be "up" or "down", but is \'left\''),
        ("depth", PLANE, {"units": "km"}, "must hold depth in m, but its units are 'km'"),
        ("depth", PLANE, {"north": {"units": "degrees_north"}}, "must hold north in m"),
        ("depth", -PLANE, {}, "all its depths are negative"),
        ("elevation", PLANE, {}, "all its depths are negative"),
    ],
)
def test_grids_of_netcdf_that_mean_something_else_are_refused(tmp_path: Path, name, values, attrs, words) -> None:
    with pytest.raises(CoadjointError, match=words):
        Bottom.from_netcdf(netcdf(tmp_path / "x.nc", name, values, **attrs))


def test_a_grid_with_too_many_nodes_is_refused_before_it_is_read(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("coadjoint_vehicles.water.bottom.MOST", 3000)
    monkeypatch.setattr(xarray.DataArray, "load", None)
    with pytest.raises(CoadjointError, match="3,321 nodes, more than 3,000"):
        Bottom.from_netcdf(netcdf(tmp_path / "x.nc"))


def test_the_height_above_a_flat_bottom_is_its_depth_less_that_of_the_body():
    assert water.altitude(40.0)(SimpleNamespace(q=np.array([3.0, 7.0, 15.0]))) == 25.0  # type: ignore[arg-type]
