"""The power fails while `coadjoint run` writes to its folder: the same command again finishes the run."""

from __future__ import annotations

import os
import shutil

import numpy as np
import pytest

import coadjoint as co
from coadjoint.report.verification import verify
from coadjoint.runs.run_file import read
from coadjoint.runs.running import execute
from coadjoint.simulation import store as streaming
from files import TOP, write
from power_loss import LOST, losses, put, recorded

CHANGES = ["run.steps=30", "run.save_every=2", "output.figures=false", "output.folder=out"]


@pytest.mark.long
@pytest.mark.parametrize("begun", [False, True])
def test_results_are_written_again_after_a_loss_of_power_at_any_moment(tmp_path, monkeypatch, begun):
    """`begun`: the folder holds this run already, which is begun again."""
    monkeypatch.setattr(streaming, "PERIOD", 0.0)
    monkeypatch.setattr(streaming, "BURDEN", 0.0)
    file = write(tmp_path, TOP)

    def run(place, overwrite=False):
        return execute(read(file, CHANGES), place / "out", overwrite, progress=False)

    first, place = tmp_path / "first", tmp_path / "left"
    first.mkdir()
    if begun:
        run(first)
    history = recorded(first, lambda: run(first, begun))
    whole = co.load(first / "out" / "trajectory.nc").dataset.load()
    put(history.left(len(history.trees) - 1, LOST), tmp_path / "ended")
    checked = verify(tmp_path / "ended" / "out")
    assert checked.complete and checked.passed, "what was told to be finished is on the disk"
    monkeypatch.setattr(os, "fsync", lambda handle: None)
    for number, (moment, left) in enumerate(losses(history, 2)):
        if number % 3:
            continue
        put(left, place)
        assert run(place).summary["complete"]
        found = co.load(place / "out" / "trajectory.nc").dataset
        for name, values in whole.variables.items():
            np.testing.assert_array_equal(found[name], values, err_msg=f"{name} after moment {moment}")
        checked = verify(place / "out")
        assert checked.complete and checked.passed and not checked.unknown
        assert not list((place / "out").glob(".*"))
        shutil.rmtree(place)
    assert number > 60
