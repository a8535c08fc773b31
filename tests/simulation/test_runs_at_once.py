"""Two and three processes begin the same run in the same folder at once, and some of them are killed."""

from __future__ import annotations

import os
import shutil

import pytest

import coadjoint as co
from at_once import at_once, require_sound, summed
from coadjoint.report.verification import verify
from coadjoint.simulation import store as streaming
from killed import places, recorded

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked")
RUN = {"dt": 0.01, "steps": 23, "save_every": 2, "progress": False, "monitors": False, "accuracy": False}
RUN |= {"backend": "native"}


@pytest.mark.long
@pytest.mark.parametrize(("processes", "rounds"), [(2, 3), (3, 2)])
def test_one_of_them_or_the_same_call_again_finishes_the_run(tmp_path, monkeypatch, processes, rounds):
    monkeypatch.setattr(streaming, "PERIOD", 0.0)
    monkeypatch.setattr(streaming, "BURDEN", 0.0)
    monkeypatch.setattr(streaming, "BLOCK_ROWS", 6)
    monkeypatch.setattr(os, "fsync", lambda handle: None)
    body = co.System(co.SO2(), lambda xi: 0.5 * xi @ xi)

    def run(name):
        return summed(co.simulate(body, body.state(xi=[0.3]), **RUN, store=tmp_path / name / "run").dataset)

    (tmp_path / "whole").mkdir()
    operations = recorded(monkeypatch, lambda: run("whole"))
    expected, place = run("whole"), tmp_path / "shared"
    kills = [None, *places(operations)]
    for number, kill in enumerate(kills * rounds):
        place.mkdir()
        others = [None if number % 2 else kills[-1 - number % len(kills)]] * (processes - 1)
        outcomes = at_once(lambda: run("shared"), [kill, *others], number)
        require_sound(outcomes, expected)
        assert run("shared") == expected, outcomes
        checked = verify(place / "run")
        assert checked.complete and checked.passed and not checked.unknown, outcomes
        assert [path.name for path in place.iterdir()] == ["run"] and not (place / "run" / "lock").exists()
        shutil.rmtree(place)
