"""Added mass from files of panel programs: closed forms come back, and wrong files are told in a sentence."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
import xarray
from scipy.spatial.transform import Rotation

from coadjoint.errors import ArgumentError, CoadjointError, FileError
from coadjoint.models import general_vehicle
from coadjoint_vehicles.hydrodynamics import (
    added_mass_about,
    added_mass_in_axes,
    capytaine_added_mass,
    displaced_mass,
    ellipsoid_added_mass,
    wamit_added_mass,
)
from coadjoint_vehicles.hydrodynamics.capytaine import MODES

DENSITY, LENGTH = 1025.0, 2.5
SEMI_AXES = (1.0, 0.5, 0.3)
ROUND = np.array([[3, 3, 3, 4, 4, 4]] * 3 + [[4, 4, 4, 5, 5, 5]] * 3)
CENTER = np.array([0.4, -0.2, 0.1])
"""Of the ellipsoid, in the axes of the program (z up), from the point to which moments refer."""


def computed():
    """Lamb's matrix about the program's point, in the program's axes."""
    return added_mass_about(ellipsoid_added_mass(SEMI_AXES, DENSITY), -CENTER)


def wamit_rows(matrix, period=0.0, damping=""):
    bar = matrix / (DENSITY * LENGTH**ROUND)
    return [
        f" {period: .6E} {i + 1:5d} {j + 1:5d} {bar[i, j]: .15E}{damping}"
        for i in range(6)
        for j in range(6)
        if abs(bar[i, j]) > 0
    ]


def wamit(path, rows, **other):
    file = path / "vehicle.1"
    file.write_text("\n".join(rows) + "\n", encoding="utf-8")
    given = {"length": LENGTH, "fluid_density": DENSITY, "axes": "z_up", "infinite_frequency": "zero", **other}
    return wamit_added_mass(file, **given)


def dataset(matrix, measure="omega", values=(1.0, 2.0, np.inf), order=MODES):
    index = [MODES.index(mode) for mode in order]
    spread = np.where(np.isin(values, (0.0, np.inf)), 1.0, 1.1)
    stack = spread[:, None, None] * matrix.T[np.ix_(index, index)]  # radiating first, then influenced
    return xarray.Dataset(
        {"added_mass": ((measure, "radiating_dof", "influenced_dof"), stack)},
        coords={
            measure: list(values),
            "radiating_dof": list(order),
            "influenced_dof": list(order),
            "rho": DENSITY,
            "g": 9.81,
            "forward_speed": 0.0,
            "water_depth": np.inf,
        },
    )


def capytaine(path, held, **other):
    file = path / "vehicle.nc"
    held.to_netcdf(file, engine="h5netcdf")
    return capytaine_added_mass(file, **{"axes": "z_up", **other})


def close(found, expected):
    return np.max(np.abs(found - expected)) <= 1e-12 * np.max(np.abs(expected))


@pytest.fixture(autouse=True)
def trusted(monkeypatch):
    """Files are not tried in a child first, which takes half a second; `test_sealed_files.py` tests that."""
    monkeypatch.setattr("coadjoint.sealed.tried", lambda path: True)


def test_the_kinetic_energy_is_the_same_about_every_point_and_in_all_axes():
    """v_O′ = v_O + ω × r, and components in axes that are turned about a slanted line."""
    random = np.random.default_rng(7)
    half = random.normal(size=(6, 6))
    M, r = half @ half.T, random.normal(size=3)
    v, omega = random.normal(size=3), random.normal(size=3)
    here, there = np.append(v, omega), np.append(v + np.cross(omega, r), omega)
    assert there @ added_mass_about(M, r) @ there == pytest.approx(here @ M @ here, rel=1e-12)
    S = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    turned = np.append(S @ v, S @ omega)
    assert turned @ added_mass_in_axes(M, S) @ turned == pytest.approx(here @ M @ here, rel=1e-12)


def test_from_z_up_to_z_down_only_couplings_of_surge_and_roll_with_the_others_change_their_sign():
    M = np.arange(1.0, 37.0).reshape(6, 6)
    changed = added_mass_in_axes(M, np.diag([1.0, -1.0, -1.0])) / M
    alike = np.equal.outer(np.isin(range(6), (0, 3)), np.isin(range(6), (0, 3)))
    assert np.array_equal(changed, np.where(alike, 1.0, -1.0))


def test_an_ellipsoid_comes_back_from_both_files(tmp_path):
    """The program had it off its origin and z up; the body's origin is the centre."""
    lamb = ellipsoid_added_mass(SEMI_AXES, DENSITY)
    assert close(wamit(tmp_path, wamit_rows(computed()), origin=CENTER), lamb)
    assert close(capytaine(tmp_path, dataset(computed()), origin=CENTER), lamb)


def test_a_sphere_comes_back_with_half_of_its_water(tmp_path):
    half = 0.5 * displaced_mass((0.4,) * 3, DENSITY)
    sphere = np.diag([half] * 3 + [0.0] * 3)
    rows = [*wamit_rows(sphere), *(f"0.0 {i} {i} 0.0" for i in (4, 5, 6))]
    assert close(wamit(tmp_path, rows), sphere) and close(capytaine(tmp_path, dataset(sphere)), sphere)


@pytest.mark.parametrize("point", [(0.0, 0.0, 0.0), (0.3, 0.1, -0.2)])
def test_without_an_origin_the_moments_stay_where_the_program_had_them(tmp_path, point):
    """The centre, which lies to port and above, is to starboard < 0 and down < 0 in the body's axes."""
    S = np.array([1.0, -1.0, -1.0])
    expected = added_mass_about(ellipsoid_added_mass(SEMI_AXES, DENSITY), S * (np.array(point) - CENTER))
    assert close(wamit(tmp_path, wamit_rows(computed()), origin=point), expected)


def test_z_down_files_and_files_with_the_bow_along_y_are_turned_as_told(tmp_path):
    matrix = computed()
    assert close(wamit(tmp_path, wamit_rows(matrix), axes="z_down"), matrix)
    forward_is_y = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    in_their_axes = added_mass_in_axes(matrix, forward_is_y.T)
    assert close(wamit(tmp_path, wamit_rows(in_their_axes), axes=forward_is_y), matrix)


def test_rows_at_other_periods_words_above_and_fortran_exponents_change_nothing(tmp_path):
    matrix = computed()
    steady = wamit_rows(1.1 * matrix, period=-1.0)
    waves = wamit_rows(1.3 * matrix, period=5.0, damping=" 1.0E-02")
    rows = ["WAMIT numeric output", *steady, *(row.replace("E", "D") for row in wamit_rows(matrix)), "", *waves]
    assert close(wamit(tmp_path, rows, axes="z_down"), matrix)


def test_limits_of_frequency_that_are_exchanged_are_found_out_and_can_be_named(tmp_path):
    """A(0) ≥ A(∞); some programs write −1 for infinite frequency and 0 for zero."""
    matrix = computed()
    rows = [*wamit_rows(matrix, period=-1.0), *wamit_rows(1.2 * matrix, period=0.0)]
    with pytest.raises(FileError, match=r'exchanged.*infinite_frequency="negative"'):
        wamit(tmp_path, rows)
    assert close(wamit(tmp_path, rows, axes="z_down", infinite_frequency="negative"), matrix)


def test_a_wamit_file_with_one_limit_only_is_warned_of_unless_it_is_said_what_it_marks(tmp_path):
    """Some programs write the rows of zero frequency, which are larger, at PERIOD = 0."""
    rows = [*wamit_rows(computed()), *wamit_rows(1.3 * computed(), period=5.0, damping=" 1.0E-02")]
    with pytest.warns(UserWarning, match="none at PERIOD < 0, so that nothing shows"):
        wamit(tmp_path, rows, infinite_frequency=None)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        wamit(tmp_path, rows, infinite_frequency="zero")
        wamit(tmp_path, [*rows, *wamit_rows(1.2 * computed(), period=-1.0)], infinite_frequency=None)


@pytest.mark.parametrize("form", ["NETCDF3_CLASSIC", "NETCDF3_64BIT"])
def test_netcdf_3_files_are_read_as_netcdf_4_ones(tmp_path, form):
    """xarray writes them where it finds no library of netCDF 4."""
    dataset(computed()).to_netcdf(tmp_path / "three.nc", engine="scipy", format=form)
    assert close(capytaine_added_mass(tmp_path / "three.nc", axes="z_down"), computed())


def test_the_highest_frequency_stands_in_for_an_infinite_one_only_if_asked(tmp_path):
    held = dataset(computed(), values=(1.0, 80.0, 2.0))
    held["added_mass"][1] /= 1.1
    assert close(capytaine(tmp_path, held, axes="z_down", frequency="highest"), computed())
    with pytest.raises(FileError, match='frequency="highest"'):
        capytaine(tmp_path, held)


def test_an_empty_file_is_called_empty(tmp_path):
    """What an interrupted `to_netcdf` leaves: no bytes at all, or a netCDF file without variables."""
    (tmp_path / "bytes.nc").write_bytes(b"")
    xarray.Dataset().to_netcdf(tmp_path / "four.nc", engine="h5netcdf")
    xarray.Dataset().to_netcdf(tmp_path / "three.nc", engine="scipy")
    for name in ("bytes.nc", "four.nc", "three.nc"):
        with pytest.raises(FileError, match=r"is empty: .*capytaine\.export_dataset"):
            capytaine_added_mass(tmp_path / name, axes="z_up")


@pytest.mark.parametrize(("measure", "infinite"), [("omega", np.inf), ("period", 0.0), ("wavelength", 0.0)])
def test_infinite_frequency_is_found_in_every_measure_and_modes_in_every_order(tmp_path, measure, infinite):
    held = dataset(computed(), measure, (2.0, infinite, 5.0), order=MODES[::-1])
    assert close(capytaine(tmp_path, held, axes="z_down"), computed())


def test_the_force_is_the_first_index_of_an_asymmetric_dataset(tmp_path):
    matrix = computed()
    matrix[0, 4] *= 1.2
    with pytest.warns(UserWarning, match=rf"A\(1,5\) = {matrix[0, 4]:.6g}, but A\(5,1\) = {matrix[4, 0]:.6g}"):
        found = capytaine(tmp_path, dataset(matrix), axes="z_down")
    assert close(found, 0.5 * (matrix + matrix.T))


def test_one_frequency_that_is_a_scalar_and_another_density_are_understood(tmp_path):
    held = dataset(computed()).isel(omega=2)
    assert close(capytaine(tmp_path, held, axes="z_down", fluid_density=1000.0), computed() * 1000 / DENSITY)


def test_small_errors_of_panels_are_mended_and_told(tmp_path):
    matrix = computed()
    matrix[1, 5] *= 1.05
    with pytest.warns(UserWarning, match=r"A\(2,6\).*finer mesh"):
        found = wamit(tmp_path, wamit_rows(matrix))
    assert np.array_equal(found, found.T)
    sphere = np.diag([100.0, 100.0, 100.0, -1e-3, 1e-3, 1e-3])
    with pytest.warns(UserWarning, match="negative eigenvalue"):
        found = wamit(tmp_path, wamit_rows(sphere))
    general_vehicle(mass=1.0, inertia=(1.0, 1.0, 1.0), added_mass=found)


def test_sound_files_are_read_without_a_word(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        wamit(tmp_path, wamit_rows(computed()))
        capytaine(tmp_path, dataset(computed()))


GOOD = wamit_rows(computed())


def with_entry(i, j, value):
    matrix = computed()
    matrix[i, j] = value
    return wamit_rows(matrix)


@pytest.mark.parametrize(
    ("rows", "sentence"),
    [
        ([""], "no rows PERIOD I J"),
        ([*GOOD, "0.0 1 1"], r"Line \d+ .*3 columns"),
        ([*GOOD, "0.0 1 1 1.0 0.0 90.0 2.0"], r"7 columns: is it a file `\.1`"),
        ([*GOOD, "0.0 1 x 1.0"], "numbers only"),
        ([*GOOD, "0.0 1 2 ********"], "numbers only"),
        ([*GOOD, "0.0 1 2 NaN"], "finite numbers"),
        ([*GOOD, "0.0 inf 2 1.0"], "finite numbers"),
        ([*GOOD, "0.0 1.5 2 1.0"], "modes from 1 to 6"),
        ([*GOOD, "0.0 7 7 1.0"], "several bodies or generalized modes"),
        ([*GOOD, GOOD[0]], "second time"),
        (GOOD[1:], r"no A\(1,1\)"),
        ([row for row in GOOD if row.split()[1:3] != ["1", "5"]], r"gives A\(5,1\), but not A\(1,5\)"),
        (wamit_rows(computed(), period=4.0), "no rows at infinite frequency .* only PERIOD = 4: add it"),
        (wamit_rows(-computed()), "kinetic energy of water is positive"),
        (with_entry(3, 3, -5.0), "kinetic energy of water is positive"),
        (with_entry(0, 4, -computed()[4, 0]), "not symmetric"),
        (
            wamit_rows(computed() + 1e3 * (np.eye(6)[[0]].T @ np.eye(6)[[2]] + np.eye(6)[[2]].T @ np.eye(6)[[0]])),
            "eigenv",
        ),
    ],
)
def test_a_wrong_wamit_file_is_told_in_a_sentence(tmp_path, rows, sentence):
    with pytest.raises(FileError, match=sentence) as caught:
        wamit(tmp_path, rows)
    assert str(caught.value).endswith((".", "?")) and "vehicle.1" in str(caught.value)


def renamed(prefix="body__"):
    return dataset(computed()).assign_coords(
        {d: [prefix + m for m in MODES] for d in ("radiating_dof", "influenced_dof")}
    )


def over(name, values):
    return xarray.concat([dataset(computed())] * len(values), dim=xarray.DataArray(list(values), dims=name, name=name))


@pytest.mark.parametrize(
    ("held", "sentence"),
    [
        (dataset(computed()).rename(added_mass="mass"), "holds no added_mass, but mass"),
        (dataset(computed()).rename(influenced_dof="force"), "no dimension influenced_dof"),
        (dataset(computed(), order=MODES[:5]), "must be Surge, Sway"),
        (renamed("left_"), "must be Surge, Sway"),
        (renamed(), "several bodies"),
        (over("body_name", ["a", "b"]), "several bodies"),
        (over("water_depth", [10.0, 20.0]), "several values of water_depth"),
        (over("rho", [1000.0, 1025.0]), "several values of rho"),
        (dataset(computed()).assign_coords(forward_speed=1.5), "forward speed"),
        (dataset(computed()).isel(omega=[0, 1]), "no infinite frequency .* 1 to 2: add omega=numpy.inf"),
        (dataset(computed()).isel(omega=2, drop=True), "no omega, period"),
        (dataset(computed()).isel(omega=[0, 2, 2]), "omega = inf 2 times"),
        (dataset(computed()).astype(str), "must be real numbers"),
        (dataset(np.nan * computed()), "not finite"),
        (dataset(-computed()), "kinetic energy of water is positive"),
    ],
)
def test_a_wrong_capytaine_file_is_told_in_a_sentence(tmp_path, held, sentence):
    with pytest.raises(FileError, match=sentence):
        capytaine(tmp_path, held.drop_vars("rho") if "rho" in held.coords and held["rho"].ndim == 0 else held)


def test_a_file_that_cannot_be_read_is_told(tmp_path):
    given = {"length": 1.0, "fluid_density": 1025.0, "axes": "z_up"}
    (tmp_path / "binary.1").write_bytes(b"\xff\xfe\x00\x81")
    for name, sentence in (("none.1", "There is no file"), ("binary.1", "not a text"), (".", "cannot be read")):
        with pytest.raises(FileError, match=sentence):
            wamit_added_mass(tmp_path / name, **given)
    Path(tmp_path / "text.nc").write_text("PERIOD I J", encoding="utf-8")
    for name, sentence in (("none.nc", "There is no file"), ("text.nc", "not a netCDF file")):
        with pytest.raises(FileError, match=sentence):
            capytaine_added_mass(tmp_path / name, axes="z_up")
    with pytest.raises(FileError, match="does not name one density"):
        capytaine(tmp_path, dataset(computed()).drop_vars("rho"), fluid_density=1000.0)


@pytest.mark.parametrize(
    ("other", "sentence"),
    [
        ({"axes": "ENU"}, "forward, port, up"),
        ({"axes": np.diag([1.0, 1.0, -1.0])}, "left-handed"),
        ({"axes": np.eye(2)}, "shape"),
        ({"length": 0.0}, "length"),
        ({"fluid_density": -1.0}, "fluid_density"),
        ({"origin": (0.0, 1.0)}, "origin"),
        ({"infinite_frequency": "both"}, "infinite_frequency"),
    ],
)
def test_arguments_that_cannot_be_are_refused(tmp_path, other, sentence):
    with pytest.raises(ArgumentError, match=sentence) as caught:
        wamit(tmp_path, GOOD, **other)
    assert isinstance(caught.value, CoadjointError)
