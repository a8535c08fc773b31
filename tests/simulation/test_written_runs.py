"""What a run is written to, and what a notebook shows of it."""

from __future__ import annotations

import csv

import h5py
import jax
import numpy as np
import pytest
import xarray

import coadjoint as co
from coadjoint.labelled import Labelled
from coadjoint.simulation import netcdf
from coadjoint.simulation.result import FORMATS

BODY = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi, name="body")


@pytest.fixture(scope="module")
def run():
    return co.simulate(BODY, BODY.state(xi=[0.1, 0.2, 1.0]), dt=0.1, steps=5, progress=False)


def read(path):
    with open(path, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: np.array([float(row[name] or "nan") for row in rows]) for name in rows[0]}


def test_a_run_of_any_system_is_written_as_a_table_with_all_digits(run, tmp_path):
    found = read(run.save(tmp_path / "body.csv"))
    np.testing.assert_array_equal(found["time"], run.dataset.time)
    np.testing.assert_array_equal(found["mu_2"], run.records.mu[:, 2])
    np.testing.assert_array_equal(found["R_0_1"], run.records.g[:, 0, 1])


def test_an_ensemble_is_written_as_a_table_with_its_members(tmp_path):
    starts = BODY.state(xi=co.each([[0.1, 0.2, 1.0], [0.0, 0.0, 2.0]]))
    fleet = co.simulate(BODY, starts, dt=0.1, steps=5, progress=False)
    found = read(fleet.save(tmp_path / "fleet.csv"))
    np.testing.assert_array_equal(found["member"], np.repeat([0, 1], 6))
    np.testing.assert_array_equal(found["xi_2"].reshape(2, 6), fleet.dataset.xi[:, :, 2])
    np.testing.assert_array_equal(found["xi_step_2"].reshape(2, 6), fleet.records.xi[:, :, 2])


@pytest.mark.parametrize("ending", [".json", ".h5", ".mat"])
def test_a_format_that_is_not_written_is_refused(run, tmp_path, ending):
    with pytest.raises(co.errors.ArgumentError, match=rf"ends in \.nc, .*but the name ends in \{ending}"):
        run.save(tmp_path / f"run{ending}")
    assert not list(tmp_path.iterdir())


def kinds_of(dataset):
    return f"{type(dataset).__module__.split('.')[0]} {len(xarray.merge([dataset]).time)}"


def test_the_writer_of_another_package_is_given_a_dataset_of_xarray(tmp_path, monkeypatch):
    monkeypatch.setitem(FORMATS._entries, ".kinds", f"{__name__}:kinds_of")
    run = co.simulate(BODY, BODY.state(xi=[0.1, 0.2, 1.0]), dt=0.1, steps=5, progress=False)
    assert run.save(tmp_path / "unread.kinds").read_text() == "xarray 6"
    assert run.save(tmp_path / "read.kinds").read_text() == "xarray 6"


def test_a_notebook_shows_the_card(run):
    class Printer:
        shown = ""

        def text(self, text):
            self.shown += text

    printer = Printer()
    run._repr_pretty_(printer, False)
    assert printer.shown == str(run)


@pytest.mark.parametrize("save_every", [1, 5])
def test_a_trajectory_has_the_records_of_a_run(save_every):
    start, of = BODY.state(xi=[0.1, 0.2, 1.0]), {"dt": 0.1, "steps": 5, "save_every": save_every}
    expected = co.simulate(BODY, start, **of, monitors=False, accuracy=False).records
    found = co.trajectory(BODY, start, **of).records
    for name in ("t", "g", "mu", "xi"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=1e-14)


@pytest.mark.long
@pytest.mark.parametrize("save_every", [1, 5])
@pytest.mark.parametrize("backend", ["native", "xla"])
def test_a_trajectory_has_the_records_of_a_run_inside_a_transformation_and_out(backend, save_every):
    start, of = BODY.state(xi=[0.1, 0.2, 1.0]), {"dt": 0.1, "steps": 5, "save_every": save_every}
    expected = co.simulate(BODY, start, **of, monitors=False, accuracy=False).records

    def records(spin):
        path = co.trajectory(BODY, BODY.state(xi=spin), **of, backend=backend)
        return path.records.t, path.records.mu, path.records.xi

    with co.float64():
        inside = jax.jit(records)(np.asarray(start.xi))
        slope = jax.jacrev(lambda spin: records(spin)[2][-1])(np.asarray(start.xi))
        near = [records(start.xi + sign * 1e-5 * np.eye(3)[0])[2][-1] for sign in (1, -1)]
    for found in (records(start.xi), inside):
        for one, other in zip(found, (expected.t, expected.mu, expected.xi), strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-13)
    np.testing.assert_allclose(slope[:, 0], (near[0] - near[1]) / 2e-5, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("path", [3, None, ""])
def test_what_is_no_path_is_said_in_a_sentence(run, path):
    for act in (run.save, co.load):
        with pytest.raises(
            co.errors.ArgumentError, match=r"`path` must be the name of a file, such as .run\.nc., but is"
        ):
            act(path)


def test_a_file_that_was_not_written_as_it_should_be_takes_no_name(run, tmp_path, monkeypatch):
    write = netcdf.write

    def spoiled(dataset, path):
        write(dataset.assign(xi=dataset.xi + 1e-12), path)

    monkeypatch.setattr(netcdf, "write", spoiled)
    with pytest.raises(
        co.errors.FileError, match=r"could not be written .*: the values of `xi` in the file are not those"
    ):
        run.save(tmp_path / "run.nc")
    assert not list(tmp_path.iterdir())


def require_same_files(ours, theirs):
    """Both hold the same to the bit, and xarray reads the same from them, with the same encodings."""
    with h5py.File(ours) as one, h5py.File(theirs) as other:
        assert {*one} == {*other}
        for name in one:
            assert one[name].dtype == other[name].dtype
            np.testing.assert_array_equal(one[name][()], other[name][()])
    ours, theirs = (xarray.load_dataset(path, engine="h5netcdf") for path in (ours, theirs))
    xarray.testing.assert_identical(ours, theirs)
    assert [*ours.variables] == [*theirs.variables] and [*ours.attrs] == [*theirs.attrs]
    for name, one in ours.variables.items():
        other = theirs.variables[name]
        assert [*one.attrs] == [*other.attrs]
        left_out = {"source"} if one.size else {"source", "chunksizes", "preferred_chunks"}
        encodings = ({key: str(x) for key, x in it.encoding.items() if key not in left_out} for it in (one, other))
        assert next(encodings) == next(encodings)


def test_a_file_of_netcdf_is_read_as_the_one_that_xarray_writes(run, tmp_path):
    """Numbers of every kind, texts, axes with and without a variable or numbers, attributes of one and of several."""
    attributes = {"n": [1, 2], "half": 0.5, "words": ["a", "bc"], "é": "ž"}
    made = run.dataset.assign(
        held=("time", run.dataset.xi.values[:, 2] > 0),
        words=(("two", "algebra"), [["a", "bcd", "é"], ["", "x", "y"]]),
        none=(("zero", "algebra"), np.zeros((0, 3))),
        single=("time", run.dataset.xi.values[:, 0].astype("f4"), attributes),
        one=((), 3),
        member=("member", [1, 2]),
    ).assign_coords(alone=("apart", [1.0]), code=("member", [3, 4]), beside=("time", run.dataset.time.values))
    made.to_netcdf(tmp_path / "theirs.nc", engine="h5netcdf")
    for dataset in (made, Labelled(made.variables, {*made.coords}, made.attrs)):
        netcdf.write(dataset, tmp_path / "ours.nc")
        require_same_files(tmp_path / "ours.nc", tmp_path / "theirs.nc")
        with h5py.File(tmp_path / "ours.nc") as opened:
            assert [scale.name for scale in opened["xi"].dims[1].values()] == ["/algebra"]


def a_run(kind, folder):
    """A run of few steps, whose dataset has not been read."""
    given = {"dt": 0.01, "steps": 6, "progress": False}
    if kind in ("one", "members"):
        spin = [0.1, 0.2, 1.0]
        return co.simulate(BODY, BODY.state(xi=spin if kind == "one" else co.each([spin, spin[::-1]])), **given)
    if kind == "mission":
        (folder / "mission.toml").write_text(MISSION)
        return co.vehicles.load_mission(folder / "mission.toml").run(progress=False)
    system, start = SYSTEMS[kind.split()[-1]]()
    if kind.startswith("resumed"):
        co.simulate(system, start, store=folder / "run", **given)
        return co.resume(folder / "run", system, progress=False)
    return co.simulate(system, start, **given)


def of_catalogue(name, **initial):
    entry = co.models.catalogue[name]
    system = entry.make()
    return system, entry.start(system, **initial)


SYSTEMS = {"top": lambda: of_catalogue("heavy_top"), "rod": lambda: of_catalogue("planar_rod")}
MISSION = """
[vehicle]
name = "bluerov2_heavy_blue"
[mission]
time_s = [0, 1]
depth_m = [0.5, 1.0]
heading_deg = 0
speed_m_s = 0.5
[initial]
position_m = [0, 0, 0.5]
[sensors]
bottom_m = 20
[run]
dt = 0.05
duration = 1.0
"""
KINDS = ["one", "members", *(pytest.param(name, marks=pytest.mark.long) for name in ("resumed top", "rod", "mission"))]


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_is_written_without_xarray_as_xarray_writes_its_dataset(kind, tmp_path, monkeypatch):
    made = a_run(kind, tmp_path)
    with monkeypatch.context() as without:
        without.setattr(Labelled, "to_xarray", lambda self: pytest.fail("xarray was asked for"))
        made.save(tmp_path / "ours.nc")
    whole = made.dataset.assign(made._last_record())
    whole.to_netcdf(tmp_path / "theirs.nc", engine="h5netcdf")
    require_same_files(tmp_path / "ours.nc", tmp_path / "theirs.nc")
    made.save(tmp_path / "changed.nc")
    assert (tmp_path / "changed.nc").read_bytes() == (tmp_path / "ours.nc").read_bytes()


def test_what_a_user_compresses_is_written_by_xarray(run, tmp_path):
    dataset = run.dataset.copy()
    dataset["xi"].encoding["zlib"] = True
    netcdf.write(dataset, tmp_path / "small.nc")
    with h5py.File(tmp_path / "small.nc") as opened:
        assert opened["xi"].compression == "gzip"


@pytest.mark.long
def test_a_file_in_a_folder_of_results_is_compared_with_its_manifest(tmp_path):
    from coadjoint.manifest import Manifest

    body = co.System(co.SO2(), lambda xi: 0.5 * xi @ xi)
    for name, spin in (("trajectory.nc", 0.3), ("other.nc", 0.4)):
        co.simulate(body, body.state(xi=[spin]), dt=0.1, steps=5, progress=False).save(tmp_path / name)
    manifest = Manifest(tmp_path, {"kind": "results", "complete": True, "inputs": {}})
    manifest.enter("trajectory.nc")
    manifest.write()
    assert co.load(tmp_path / "trajectory.nc").dataset.sizes["time"] == 6
    (tmp_path / "other.nc").replace(tmp_path / "trajectory.nc")
    with pytest.raises(co.errors.FileError, match=r"trajectory.nc of the run is damaged: put back a copy"):
        co.load(tmp_path / "trajectory.nc")
    (tmp_path / "manifest.json").write_text("{}")  # of another program
    assert co.load(tmp_path / "trajectory.nc").dataset.sizes["time"] == 6
