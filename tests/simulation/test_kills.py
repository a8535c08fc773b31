"""A run is killed before one of its operations on the disk: the same call again finishes it, to the same bits."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

import coadjoint as co
from coadjoint.manifest import Manifest
from coadjoint.simulation import driver
from coadjoint.simulation import store as streaming
from killed import killed_before, places, recorded

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked")
RUN = {"dt": 0.01, "steps": 61, "save_every": 2, "progress": False, "monitors": False, "accuracy": False}
RUN |= {"backend": "native"}


@pytest.fixture
def often(monkeypatch):
    """A checkpoint after each stretch, of one step and of all that are left on any machine, and chunks of few rows."""
    monkeypatch.setattr(driver, "PATIENCE", 1e9)
    monkeypatch.setattr(streaming, "PERIOD", 0.0)
    monkeypatch.setattr(streaming, "BURDEN", 0.0)
    monkeypatch.setattr(streaming, "BLOCK_ROWS", 12)
    monkeypatch.setattr(os, "fsync", lambda handle: None)  # a kill loses nothing that was written


def simulate(members: int, place: Path):
    if members == 1:
        body = co.System(co.SO2(), lambda xi: 0.5 * xi @ xi)
    else:
        mass = co.each(np.arange(1.0, 1 + members))
        body = co.System(co.SO2(), lambda xi, p: 0.5 * p.mass * xi @ xi, parameters={"mass": mass})
    return co.simulate(body, body.state(xi=[0.3]), **RUN, store=place / "run")


def require_whole(place: Path, whole, after) -> None:
    """The same call again finishes the run in a folder, and leaves nothing else there."""
    again = simulate(whole.sizes.get("member", 1), place)
    for name, values in whole.variables.items():
        np.testing.assert_array_equal(again.dataset[name], values, err_msg=f"{name} after {after}")
    assert [path.name for path in place.iterdir()] == ["run"], after
    left = {path.relative_to(place / "run").as_posix() for path in place.rglob("*") if path.is_file()}
    manifest = Manifest.read(place / "run")
    assert left == {*manifest.files, "manifest.json"}, after
    assert not list(manifest.problems())


@pytest.mark.long
def test_a_run_that_was_killed_at_any_operation_is_finished_by_the_same_call(tmp_path, monkeypatch, often):
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    whole.mkdir()
    operations = recorded(monkeypatch, lambda: simulate(1, whole))
    expected = simulate(1, whole).dataset.load()
    moments = places(operations)
    assert len(moments) > 20 and len({operation for operation, _ in operations}) == 7, operations
    for index in moments:
        cut.mkdir()
        assert killed_before(index, lambda: simulate(1, cut)), operations[index]
        require_whole(cut, expected, operations[index])
        shutil.rmtree(cut)


@pytest.mark.long
@pytest.mark.parametrize("members", [1, 3])
def test_a_run_that_was_killed_again_and_again_is_finished_by_the_same_call(tmp_path, monkeypatch, often, members):
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    whole.mkdir()
    operations = recorded(monkeypatch, lambda: simulate(members, whole))
    expected = simulate(members, whole).dataset.load()
    generator = np.random.default_rng(20251123)
    for index in places(operations):
        cut.mkdir()
        assert killed_before(index, lambda: simulate(members, cut)), operations[index]
        for _ in range(2):  # a later kill may come after the end
            killed_before(int(generator.integers(len(operations) // 2)), lambda: simulate(members, cut))
        require_whole(cut, expected, operations[index])
        shutil.rmtree(cut)
