"""Two and three processes run the same run file into the same folder at once, and some of them are killed."""

from __future__ import annotations

import os
import shutil

import pytest

import coadjoint as co
from at_once import at_once, require_sound, summed
from coadjoint.report.verification import verify
from coadjoint.runs.run_file import read
from coadjoint.runs.running import execute
from coadjoint.simulation import store as streaming
from files import TOP, write
from killed import places, recorded

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked")
CHANGES = ["run.steps=30", "run.save_every=2", "output.figures=false", "output.folder=out"]


@pytest.mark.long
@pytest.mark.parametrize("processes", [2, 3])
def test_one_of_them_or_the_same_call_again_finishes_the_run(tmp_path, monkeypatch, processes):
    monkeypatch.setattr(streaming, "PERIOD", 0.0)
    monkeypatch.setattr(streaming, "BURDEN", 0.0)
    monkeypatch.setattr(os, "fsync", lambda handle: None)
    file = write(tmp_path, TOP)

    def run(name):
        execute(read(file, CHANGES), tmp_path / name / "out", progress=False)
        return summed(co.load(tmp_path / name / "out" / "trajectory.nc").dataset)

    (tmp_path / "whole").mkdir()
    operations = recorded(monkeypatch, lambda: run("whole"))
    expected, place = run("whole"), tmp_path / "shared"
    kills = [None, *places(operations)]
    for number, kill in enumerate(kills):
        place.mkdir()
        others = [None if number % 2 else kills[-1 - number % len(kills)]] * (processes - 1)
        outcomes = at_once(lambda: run("shared"), [kill, *others], number)
        require_sound(outcomes, expected)
        assert run("shared") == expected, outcomes
        checked = verify(place / "out")
        assert checked.complete and checked.passed and not checked.unknown, outcomes
        assert [path.name for path in place.iterdir()] == ["out"] and not list(place.glob("out/.*"))
        shutil.rmtree(place)
