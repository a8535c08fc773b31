"""Fields of fluids on the sphere: latitude and longitude, units, spectra, netCDF files, and figures of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray
from PIL import Image

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.models import fluids
from coadjoint.plotting import sphere

SPIN = 0.3


@pytest.fixture(scope="module")
def ran():
    """A wave of degree 2 on solid-body rotation, on a rotating sphere."""
    fluid = fluids.euler(4, rotation=0.7)
    start = fluids.start(fluid, fluids.rossby_haurwitz(2, 1, 0.5, SPIN))
    return fluid, co.simulate(fluid, start, dt=0.1, steps=4, method=co.IsospectralMidpoint(), accuracy=False)


def gridded(ran):
    """Its fields on a coarse grid."""
    fluid, run = ran
    return fluids.fields(fluid, run, 7, 12)


@pytest.mark.long
def test_energy_and_enstrophy_of_fields_in_a_file_are_those_of_the_run(ran, tmp_path: Path):
    fluid, run = ran
    fluids.fields(fluid, run, 7, 12).to_netcdf(tmp_path / "wave.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "wave.nc", engine="h5netcdf", decode_times=False) as data:
        for name in ("energy", "enstrophy"):
            total = data[f"{name}_spectrum"].values.sum(axis=1)
            expected = run.dataset["kinetic_energy" if name == "energy" else name].values
            np.testing.assert_allclose(total, expected, rtol=1e-13)
        assert data.attrs["Conventions"] == "CF-1.11" and data.vorticity.attrs["units"] == "s-1"
        assert data.latitude.attrs["standard_name"] == "latitude" and data.latitude.attrs["units"] == "degrees_north"


@pytest.mark.long
def test_fields_of_files_are_those_of_the_run_and_latitudes_are_found_by_their_number(ran, tmp_path: Path):
    fluid, run = ran
    run.save(tmp_path / "run.nc")
    data = fluids.fields(fluid, run, 31, 60)
    xarray.testing.assert_allclose(fluids.fields(fluid, co.load(tmp_path / "run.nc"), 31, 60), data, rtol=1e-14)
    assert data.vorticity.sel(latitude=30, longitude=84).shape == (5,) and "carried" not in data


@pytest.mark.long
def test_fields_of_a_member_of_an_ensemble():
    fluid = fluids.euler(4)
    starts = [fluids.start(fluid.replace(rotation=w), fluids.rossby_haurwitz(2, 1, 0.5, SPIN)).mu for w in (0.0, 1.0)]
    both = co.simulate(
        fluid.replace(rotation=co.each([0.0, 1.0])),
        fluid.state(mu=co.each(np.stack(starts))),
        dt=0.1,
        steps=2,
        method=co.IsospectralMidpoint(),
        accuracy=False,
    )
    first, second = (
        fluids.fields(fluid.replace(rotation=w), both.dataset.isel(member=i), 7, 12) for i, w in ((0, 0.0), (1, 1.0))
    )
    np.testing.assert_allclose(first.vorticity[0], second.vorticity[0], atol=1e-14)
    assert np.max(np.abs(first.vorticity[2] - second.vorticity[2])) > 1e-3
    for run in (both, both.dataset):
        with pytest.raises(ArgumentError, match=r"or the dataset of one, as ensemble.dataset.isel\(member=0\)"):
            fluids.fields(fluid, run)


@pytest.mark.parametrize(("model", "units"), [(fluids.magnetohydrodynamics, "s-1"), (fluids.boussinesq, "s-2")])
def test_fields_and_what_the_flow_carries_have_their_values_units_and_names(model, units):
    """At a start; ψ = −ω/2 and −ω/6 of the degrees 1 and 2, on a sphere that rotates."""
    fluid, carried = model(4, rotation=0.7), fluids.rossby_haurwitz(2, 1, 0.5, SPIN)
    start = fluids.carrying_start(fluid, 0.1 * carried, carried)
    rows = {"mu": start.mu[None], "a": np.ravel(start.a)[None]}
    held = xarray.Dataset({name: (("time", "algebra"), row) for name, row in rows.items()}, {"time": [2.5]})
    data = fluids.fields(fluid, held, 7, 12)
    north, east = np.radians(data.latitude.values)[:, None], np.radians(data.longitude.values)
    assert data.latitude.values.tolist() == [-90, -60, -30, 0, 30, 60, 90] and data.longitude.values[3] == 90
    wave = -np.sqrt(15 / (8 * np.pi)) * np.sin(north) * np.cos(north) * np.cos(east)  # 2 Re(½ Y_21)
    spin = 2 * SPIN * np.sin(north) + 0 * east
    np.testing.assert_allclose(data.carried.values[0], spin + wave, atol=1e-14)
    np.testing.assert_allclose(data.vorticity.values[0], 0.1 * (spin + wave), atol=1e-14)
    np.testing.assert_allclose(data.stream_function.values[0], -0.1 * (spin / 2 + wave / 6), atol=1e-14)
    energy, enstrophy = data.energy_spectrum.values[0], data.enstrophy_spectrum.values[0]
    np.testing.assert_allclose(enstrophy, [0, 0.5 * 0.01 * 16 * np.pi / 3 * SPIN**2, 0.5 * 0.01 * 0.5, 0], atol=1e-15)
    np.testing.assert_allclose(energy[1:], enstrophy[1:] / [2, 6, 12], atol=1e-15)
    assert {name: (one.attrs["long_name"], one.attrs["units"]) for name, one in data.data_vars.items()} == {
        "vorticity": ("relative vorticity", "s-1"),
        "stream_function": ("stream function of the velocity", "s-1"),
        "energy_spectrum": ("kinetic energy by degrees", "s-2"),
        "enstrophy_spectrum": ("enstrophy by degrees", "s-2"),
        "carried": ("function carried by the flow", units),
    }
    assert data.time.values == 2.5 and data.attrs["Conventions"] == "CF-1.11"
    assert data.attrs["source"] == "Zeitlin's model on U(4)" and data.attrs["title"] == fluid.name


@pytest.mark.parametrize("projection", ["mollweide", pytest.param("hammer", marks=pytest.mark.long)])
def test_maps_have_the_values_of_the_field_at_their_places(ran, tmp_path: Path, projection):
    data = gridded(ran)
    figure = sphere.vorticity_map(data, path=tmp_path / "map.png", time=0.21, projection=projection)
    (mesh,) = figure.axes[0].collections
    corners, values = np.degrees(mesh.get_coordinates()), mesh.get_array().reshape(7, 13)  # pyright: ignore
    assert figure.axes[0].get_title() == "$t$ = 0.2 s" and figure.axes[0].name == projection
    for row, column in ((2, 0), (4, 9), (1, 12)):
        east, north = corners[row, column]
        at = data.vorticity.sel(latitude=north, longitude=round(east) % 360, method="nearest").values[2]
        assert values[row, column] == pytest.approx(at, abs=1e-15) and abs(at) > 1e-3
    assert (tmp_path / "map.png").stat().st_size > 5000


def test_an_animation_has_a_picture_for_each_node_up_to_its_frames(ran, tmp_path: Path):
    data = gridded(ran)
    for shown, frames, expected in ((data.isel(time=slice(2)), 100, 2), (data, 2, 2)):
        with Image.open(sphere.animation(shown, tmp_path / "wave.gif", frames=frames)) as film:
            assert getattr(film, "n_frames", 1) == expected


def test_spectra_are_drawn_from_degree_1(ran):
    data = gridded(ran)
    figure = sphere.spectra(data, times=[0.0, 0.4])
    first, last = figure.axes[0].lines
    np.testing.assert_array_equal(first.get_xdata(), [1, 2])
    np.testing.assert_array_equal(first.get_ydata(), data.energy_spectrum.values[0, 1:3])
    assert last.get_label() == "$t$ = 0.4 s" and figure.axes[0].get_ylabel() == "kinetic energy by degrees (1/s²)"


def test_what_cannot_be_drawn_is_refused(ran, tmp_path: Path):
    data = gridded(ran)
    for call, sentence in (
        (lambda: fluids.fields(ran[0], 3), "`run` must be one run of co.simulate, or of co.load, or .*, but is 3"),
        (lambda: fluids.fields(ran[0], ran[1], latitudes=1), "`latitudes` must be a whole number from 2"),
        (lambda: fluids.fields(fluids.euler(5), ran[1]), "be the one that ran, but has N = 5, and the run N = 4"),
        (lambda: fluids.fields(fluids.euler(4), ran[1]), "energy .* is not that of the run: rotation = 0 rad/s is ano"),
        (lambda: sphere.vorticity_map(data, time=100), "`time` must be within these fields, from 0 s to 0.4 s, but is"),
        (lambda: sphere.spectra(data, times=[0, -1]), "`times` must be within these fields, .* but is -1"),
        (lambda: sphere.vorticity_map(ran[1]), "`fields` must be a dataset of co.models.fluids.fields"),
        (lambda: sphere.vorticity_map(data, projection="polar"), '`projection` must be "mollweide" or "hammer"'),  # pyright: ignore
        (lambda: sphere.vorticity_map(data, time=np.nan), "`time` must be a finite number, but is nan"),
        (lambda: sphere.animation(data, tmp_path / "a.avi"), "must end in .gif, .mp4 or .html, but is a.avi"),
        (lambda: sphere.animation(data, tmp_path / "a.gif", frames=1), "`frames` must be a whole number from 2"),
        (lambda: sphere.animation(data.isel(time=[0]), tmp_path / "a.gif"), "have one node"),
    ):
        with pytest.raises(ArgumentError, match=sentence):
            call()
