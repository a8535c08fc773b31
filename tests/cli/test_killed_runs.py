"""`coadjoint run` is killed before one of its operations on the disk: the same command again finishes the run."""

from __future__ import annotations

import os
import shutil

import numpy as np
import pytest

import coadjoint as co
from coadjoint.manifest import Manifest
from coadjoint.report.verification import verify
from coadjoint.runs.run_file import read
from coadjoint.runs.running import execute
from coadjoint.simulation import store as streaming
from files import TOP, write
from killed import killed_before, places, recorded

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked")
CHANGES = ["run.steps=30", "run.save_every=2", "output.figures=false", "output.folder=out"]


@pytest.mark.long
@pytest.mark.parametrize("moment", ["results", pytest.param("all", marks=pytest.mark.long)])
def test_a_run_that_was_killed_at_any_operation_is_finished_by_the_same_command(tmp_path, monkeypatch, moment):
    monkeypatch.setattr(streaming, "PERIOD", 0.0)
    monkeypatch.setattr(streaming, "BURDEN", 0.0)
    monkeypatch.setattr(os, "fsync", lambda handle: None)  # a kill loses nothing that was written
    file = write(tmp_path, TOP)

    def run(name: str):
        return execute(read(file, CHANGES), tmp_path / name, progress=False)

    operations = recorded(monkeypatch, lambda: run("whole"))
    whole = co.load(tmp_path / "whole" / "trajectory.nc").dataset
    moments = places(operations)
    if moment == "results":  # what the records of the run do in their folder has a test of its own
        results = [("lock", "lock"), ("move", "run.toml"), ("move", "summary.json"), ("remove", "unfinished.partial")]
        results += [("settle", "manifest.json.partial"), ("write", "top.py.partial"), ("unlock", "lock")]
        moments = [index for index in moments if (operations[index][0], operations[index][1]) in results]
    assert len(moments) >= 7, operations
    for index in moments:
        assert killed_before(index, lambda: run("cut")), operations[index]
        written = run("cut")
        found = co.load(tmp_path / "cut" / "trajectory.nc").dataset
        for name, values in whole.variables.items():
            np.testing.assert_array_equal(found[name], values, err_msg=f"{name} after {operations[index]}")
        names = {path.relative_to(tmp_path / "cut").as_posix() for path in (tmp_path / "cut").rglob("*.*")}
        assert names == {*Manifest.read(tmp_path / "cut").files, "manifest.json"}, operations[index]
        assert verify(tmp_path / "cut").passed and written.summary["complete"]
        left = {path.name for path in tmp_path.iterdir()} - {"__pycache__"}  # of top.py, which is imported
        assert left == {"top.toml", "top.py", "whole", "cut"}
        shutil.rmtree(tmp_path / "cut")


@pytest.mark.cases(1)
@pytest.mark.parametrize("done", [True, False])
def test_every_flipped_bit_is_found(tmp_path, monkeypatch, done):
    monkeypatch.chdir(tmp_path)
    file = write(tmp_path, TOP)
    with monkeypatch.context() as patched:
        if not done:
            patched.setattr("coadjoint.runs.running.write", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        try:
            execute(read(file, CHANGES), tmp_path / "out", progress=False)
        except KeyboardInterrupt:
            assert not done
    assert verify(tmp_path / "out").complete is done
    generator = np.random.default_rng(20251125)
    files = [path for path in (tmp_path / "out").rglob("*") if path.is_file()]
    for path in files:
        kept = path.read_bytes()
        place = int(generator.integers(8 * len(kept)))
        data = bytearray(kept)
        data[place // 8] ^= 1 << place % 8
        path.write_bytes(data)
        try:
            problems = verify(tmp_path / "out").problems
        except co.errors.FileError as error:
            problems = [str(error)]
        assert len(problems) == 1 and str(path.name) in problems[0] and "damaged" in problems[0], path
        path.write_bytes(kept)
    assert verify(tmp_path / "out").passed
