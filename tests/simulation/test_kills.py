"""A run is killed before one of its operations on the disk: the same call again finishes it, to the same bits."""

from __future__ import annotations

import os
import shutil

import numpy as np
import pytest

import coadjoint as co
from coadjoint.manifest import Manifest
from coadjoint.simulation import store as streaming
from killed import killed_before, places, recorded

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked")
RUN = {"dt": 0.01, "steps": 61, "save_every": 2, "progress": False, "monitors": False, "accuracy": False}
RUN |= {"backend": "native"}


@pytest.fixture
def often(monkeypatch):
    """A checkpoint after each stretch, and chunks of few rows."""
    monkeypatch.setattr(streaming, "PERIOD", 0.0)
    monkeypatch.setattr(streaming, "BURDEN", 0.0)
    monkeypatch.setattr(streaming, "BLOCK_ROWS", 12)
    monkeypatch.setattr(os, "fsync", lambda handle: None)  # a kill loses nothing that was written


def test_a_run_that_was_killed_at_any_operation_is_finished_by_the_same_call(tmp_path, monkeypatch, often):
    body = co.System(co.SO2(), lambda xi: 0.5 * xi @ xi)

    def run(name: str):
        return co.simulate(body, body.state(xi=[0.3]), **RUN, store=tmp_path / name / "run")

    (tmp_path / "whole").mkdir()
    operations = recorded(monkeypatch, lambda: run("whole"))
    whole = run("whole").dataset.load()
    moments = places(operations)
    assert len(moments) > 20 and len({operation for operation, _ in operations}) == 7, operations
    for index in moments:
        place = tmp_path / "cut"
        place.mkdir()
        assert killed_before(index, lambda: run("cut")), operations[index]
        again = run("cut")
        for name, values in whole.variables.items():
            np.testing.assert_array_equal(again.dataset[name], values, err_msg=f"{name} after {operations[index]}")
        assert [path.name for path in place.iterdir()] == ["run"], operations[index]
        left = {path.relative_to(place / "run").as_posix() for path in place.rglob("*") if path.is_file()}
        manifest = Manifest.read(place / "run")
        assert left == {*manifest.files, "manifest.json"}, operations[index]
        assert not list(manifest.problems())
        shutil.rmtree(place)
