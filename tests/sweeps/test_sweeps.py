"""Sweeps of a small run file in this process."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray
from killing import bits

import coadjoint as co
from coadjoint.runs.run_file import read
from coadjoint.runs.running import simulate
from coadjoint.sweeps.file import read_sweep
from coadjoint.sweeps.store import MEMBERS, done
from coadjoint.sweeps.sweep import execute

TOP = """
[system]
model = "simo_wong_top"
[initial]
euler_zyx_deg = [0, 10, 0]
angular_velocity_rpm = [0, 0, 400]
[run]
dt = 0.001
steps = 40
"""
SWEEP = """
[sweep]
run = "top.toml"
task = 3
[vary.parameters]
mass = { from = 4.0, to = 6.0, count = 4 }
[vary.initial]
euler_zyx_deg = [0, { values = [5, 20] }, 0]
[results]
variables = ["xi", "euler_angles"]
save_every = 10
"""


def written(folder: Path, text: str = SWEEP) -> Path:
    (folder / "top.toml").write_text(TOP)
    file = folder / "sweep.toml"
    file.write_text(text)
    return file


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sweep")
    return execute(read_sweep(written(folder)), folder / "out", workers=1, progress=False)


@pytest.mark.long
def test_a_member_of_a_grid_is_the_run_with_its_numbers(swept):
    found = swept.dataset
    assert found.sizes["member"] == 8 and swept.failures == {} and swept.summary["tasks"] == 3
    assert np.unique(found["parameters.mass"]).tolist() == np.linspace(4, 6, 4).tolist()
    member = found.isel(member=5)
    mass, angle = float(member["parameters.mass"]), float(member["initial.euler_zyx_deg[1]"])
    file = read(
        swept.folder.parent / "top.toml",
        [f"parameters.mass={mass}", f"initial.euler_zyx_deg=[0, {angle}, 0]", "run.save_every=10"],
    )
    alone = simulate(file, file.set_up(), False).dataset
    np.testing.assert_allclose(member.final_xi, alone.xi[-1], rtol=1e-11)
    np.testing.assert_allclose(member.largest_euler_angles, alone.euler_angles.max("time"), rtol=1e-11)
    np.testing.assert_allclose(member.mean_xi, alone.xi.mean("time"), rtol=1e-11)


def test_statistics_are_those_of_the_members(swept):
    values = swept.dataset.final_xi.values
    table = swept.statistics.final_xi
    np.testing.assert_allclose(table.sel(statistic="mean"), values.mean(axis=0), rtol=1e-13)
    np.testing.assert_allclose(table.sel(statistic="std"), values.std(axis=0, ddof=1), rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(table.sel(statistic="50%"), np.quantile(values, 0.5, axis=0), rtol=1e-12)


@pytest.mark.long
def test_a_sweep_that_was_killed_computes_what_is_missing_to_the_same_bits(swept, tmp_path, monkeypatch):
    file = written(tmp_path)
    sweep = read_sweep(file)
    monkeypatch.setattr("coadjoint.sweeps.store.enter_chunks", lambda *_: 1 / 0)  # killed before its end
    with pytest.raises(ZeroDivisionError):
        execute(sweep, tmp_path / "out", workers=1, progress=False)
    monkeypatch.undo()
    shard = tmp_path / "out" / "unfinished" / "shards" / "000001.shard"
    shard.unlink()
    for chunk in (tmp_path / "out" / MEMBERS).rglob("c.1*"):
        chunk.write_bytes(b"half of")
    assert done(tmp_path / "out") == {0, 2}
    again = execute(sweep, tmp_path / "out", workers=1, progress=False)
    assert again.summary["computed_tasks"] == 1
    assert bits(again.folder) == bits(swept.folder)


def test_the_same_command_again_returns_what_is_finished(swept):
    before = bits(swept.folder)
    again = execute(read_sweep(swept.folder.parent / "sweep.toml"), swept.folder, "tcp://127.0.0.1:1", progress=False)
    assert again.summary == swept.summary and bits(again.folder) == before


@pytest.mark.long
def test_no_member_depends_on_those_of_its_task(swept, tmp_path):
    other = execute(
        read_sweep(written(tmp_path, SWEEP.replace("task = 3", "task = 8"))),
        tmp_path / "out",
        workers=1,
        progress=False,
    )
    for name, values in swept.dataset.items():
        np.testing.assert_array_equal(other.dataset[name].values, values.values, err_msg=str(name))


def test_numbers_of_the_grid_of_time_are_swept_too(tmp_path):
    (tmp_path / "top.toml").write_text(TOP.replace("steps = 40", "duration = 0.04"))
    found = co.sweep(
        tmp_path / "top.toml",
        {"run.dt": {"values": [0.001, 0.002]}, "parameters.mass": {"values": [4.0, 5.0]}},
        store=tmp_path / "out",
        sampling="grid",
        variables=["xi"],
        save_every=10,
        workers=1,
        progress=False,
    )
    assert found.dataset.steps_done.values.tolist() == [40, 40, 20, 20]


def test_members_that_cannot_be_are_told_and_the_others_run(tmp_path):
    (tmp_path / "top.toml").write_text(TOP)
    found = co.sweep(
        tmp_path / "top.toml", mass=co.each([-1.0, 5.0, 4.0, 6.0]), store=tmp_path / "out", workers=1,
        variables=["xi"], progress=False,
    )  # fmt: skip
    assert found.failures == {"refused": 1}
    assert found.summary["refusals"]["0"].startswith("`parameters.mass` must be positive")
    assert np.isnan(found.dataset.final_xi.values).all(axis=1).tolist() == [True, False, False, False]


@pytest.mark.parametrize(
    ("before", "after", "sentence"),
    [
        ("mass = {", "mas = {", "did you mean `mass`"),
        ("[vary.parameters]", "[vary.parametres]", "did you mean `parameters`"),
        ("from = 4.0, to = 6.0", "from = 6.0, to = 4.0", "empty range: `from`, 6, must be less than `to`, 4"),
        ("from = 4.0, to = 6.0, count = 4", "values = []", "list of finite numbers"),
        ("count = 4", "cuont = 4", "did you mean `count`"),
        (", count = 4", "", "has no values of a grid"),
        ("task = 3", 'sampling = "sobbol"', "did you mean `sobol`"),
        ("task = 3", 'sampling = "sobol"', "needs `members`, the number of draws"),
        ('"xi"', '"omega"', "has no variable `omega`"),
        ('run = "top.toml"', 'run = "pot.toml"', "There is no run file"),
    ],
)
def test_what_is_mistaken_is_told_in_a_sentence(tmp_path, before, after, sentence):
    assert before in SWEEP
    file = written(tmp_path, SWEEP.replace(before, after))
    with pytest.raises((co.errors.ArgumentError, co.errors.FileError), match=sentence):
        execute(read_sweep(file), tmp_path / "out", workers=1, progress=False)
    assert not (tmp_path / "out").exists()


def test_another_sweep_has_no_place_in_a_folder(swept, tmp_path):
    other = read_sweep(written(tmp_path, SWEEP.replace("to = 6.0", "to = 7.0")))
    with pytest.raises(co.errors.FileError, match=r"vary\.parameters\.mass"):
        execute(other, swept.folder, "tcp://127.0.0.1:1", progress=False)


def test_two_sweeps_into_one_folder_are_refused(swept, tmp_path):
    from coadjoint.simulation.lock import Lock

    shutil.copytree(swept.folder, tmp_path / "out")
    lock = Lock(tmp_path / "out", ".lock")
    try:
        with pytest.raises(co.errors.FileError, match="in use"):
            execute(read_sweep(swept.folder.parent / "sweep.toml"), tmp_path / "out", "tcp://127.0.0.1:1")
    finally:
        lock.release()


@pytest.mark.long
def test_a_disk_that_is_full_is_told_and_the_sweep_goes_on_later(swept, tmp_path, monkeypatch):
    def full(*given):
        raise OSError(28, "No space left on device")

    sweep = read_sweep(written(tmp_path))
    with monkeypatch.context() as patched:
        patched.setattr("coadjoint.sweeps.store._put", full)
        with pytest.raises(co.errors.FileError, match=r"No space left on device.*the same command again"):
            execute(sweep, tmp_path / "out", workers=1, progress=False)
    found = execute(sweep, tmp_path / "out", workers=1, progress=False)
    assert bits(found.folder) == bits(swept.folder)


def test_a_folder_that_workers_cannot_see_is_told(tmp_path):
    from coadjoint.sweeps.task import read as read_by_worker

    with pytest.raises(co.errors.FileError, match="all workers need the folder"):
        read_by_worker(str(tmp_path / "nowhere"), "0")


def test_statistics_alone_keep_nothing_of_members_and_say_the_same(swept, tmp_path):
    alone = execute(
        read_sweep(written(tmp_path, SWEEP + 'keep = "statistics"\n')), tmp_path / "out", workers=1, progress=False
    )
    assert not (alone.folder / MEMBERS).exists()
    assert alone.statistics.equals(swept.statistics)
    with pytest.raises(co.errors.FileError, match="kept statistics alone"):
        _ = alone.dataset


def test_numbers_that_vary_are_coordinates_without_the_library_too(swept):
    plain = xarray.open_zarr(swept.folder / MEMBERS, consolidated=False, chunks=None)
    assert set(plain.coords) == {"parameters.mass", "initial.euler_zyx_deg[1]"} <= set(swept.dataset.coords)


def test_every_array_has_one_chunk_for_each_task(swept):
    import zarr

    group = zarr.open_group(swept.folder / MEMBERS, mode="r")
    assert {array.chunks[0] for _, array in group.arrays()} == {3}
    assert {array.chunks[1:] == array.shape[1:] for _, array in group.arrays()} == {True}
