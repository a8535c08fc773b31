"""Addresses of schedulers that are none, or where nobody answers."""

from __future__ import annotations

import gc
import sys
import warnings
from pathlib import Path

import pytest

import coadjoint as co
from coadjoint.sweeps import cluster
from coadjoint.sweeps.file import read_sweep
from coadjoint.sweeps.sweep import execute

distributed = pytest.importorskip("distributed", reason="schedulers need dask.distributed, the extra [cluster]")


def sweep_file(folder: Path) -> Path:
    (folder / "top.toml").write_text('[system]\nmodel = "simo_wong_top"\n[run]\ndt = 0.001\nsteps = 40\n')
    file = folder / "sweep.toml"
    file.write_text('[sweep]\nrun = "top.toml"\n[vary.parameters]\nmass = { values = [4.0, 5.0] }\n')
    return file


@pytest.mark.parametrize("address", ["foo", "tcp://x", "http://127.0.0.1:1", "nowhere://x:1", "tcp://x:port", ""])
def test_what_is_no_address_is_told_before_anything_is_written(tmp_path, address):
    with pytest.raises(co.errors.ArgumentError, match="tcp://HOST:8786"):
        execute(read_sweep(sweep_file(tmp_path)), tmp_path / "out", address, progress=False)
    assert not (tmp_path / "out").exists()


def test_a_scheduler_that_does_not_answer_is_told_before_anything_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr("coadjoint.sweeps.cluster.PATIENCE", 0.3)
    with (
        pytest.warns(UserWarning, match="it is waited for") as warned,
        pytest.raises(co.errors.FileError, match="does not answer"),
    ):
        execute(read_sweep(sweep_file(tmp_path)), tmp_path / "out", "127.0.0.1:9", progress=False)
    assert len(warned) == 1 and not (tmp_path / "out").exists()


@pytest.mark.long
def test_a_client_that_reached_nobody_is_closed_silently(monkeypatch):
    monkeypatch.setattr("coadjoint.sweeps.cluster.ANSWER", 0.3)
    with warnings.catch_warnings():
        warnings.simplefilter("error", pytest.PytestUnraisableExceptionWarning)
        with pytest.raises(cluster._Lost), cluster.connected("tcp://127.0.0.1:9"):
            pass
        gc.collect()


@pytest.mark.parametrize(
    ("given", "sentence"),
    [({"mass": 31.0}, r"parameters\.mass is 31\.0: give co\.each"), ({"mass": [4, 5]}, r"co\.each"), ({}, r"co\.each")],
)
def test_what_does_not_vary_is_told_in_words_of_python(tmp_path, given, sentence):
    sweep_file(tmp_path)
    with pytest.raises(co.errors.ArgumentError, match=sentence):
        co.sweep(tmp_path / "top.toml", store=tmp_path / "out", **given)


@pytest.mark.parametrize(
    ("steps", "members", "size"), [(40, 24, 24), (10**6, 24, 2), (40_000, 100, 25), (40, 4096, 256), (10**6, 4096, 64)]
)
def test_members_are_shared_among_tasks_that_are_worth_it(tmp_path, steps, members, size):
    file = sweep_file(tmp_path)
    (tmp_path / "top.toml").write_text(f'[system]\nmodel = "simo_wong_top"\n[run]\ndt = 0.001\nsteps = {steps}\n')
    file.write_text(file.read_text().replace("[4.0, 5.0]", str([4.0 + k / members for k in range(members)])))
    assert read_sweep(file).size == size


def test_a_check_names_what_members_cannot_differ_in_together(tmp_path, capsys):
    from coadjoint.cli.main import main

    file = sweep_file(tmp_path)
    file.write_text('[sweep]\nrun = "top.toml"\n[vary.run]\ndt = { values = [0.001, 0.002, 0.004] }\n')
    assert main(["sweep", str(file), "--check"]) == 0
    told = capsys.readouterr().out
    assert "in 1 task of 3" in told and "differ in run.dt" in told and "3 groups in all" in told


@pytest.mark.long
def test_workers_of_a_scheduler_compute_a_sweep(tmp_path):
    quiet = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
    sweep = read_sweep(sweep_file(tmp_path))
    with distributed.LocalCluster(**quiet) as there:
        made = execute(sweep, tmp_path / "out", there.scheduler_address, progress=False)
    here = execute(sweep, tmp_path / "here", workers=1, progress=False)
    assert made.dataset.equals(here.dataset) and made.dataset.sizes["member"] == 2


def test_a_sweep_without_a_scheduler_needs_no_dask(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    sweep = read_sweep(sweep_file(tmp_path))
    with pytest.raises(co.errors.ArgumentError, match=r"coadjoint\[cluster\]"):
        execute(sweep, tmp_path / "out", "tcp://127.0.0.1:9", progress=False)
    monkeypatch.setattr("socket.socket.bind", None)
    assert execute(sweep, tmp_path / "out", workers=1, progress=False).failures == {}
