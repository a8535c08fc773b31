"""The power fails while a run writes to its folder: the same call again finishes it, to the same bits."""

from __future__ import annotations

import json
import os
import shutil

import numpy as np
import pytest

import coadjoint as co
from coadjoint import disk
from coadjoint.report.verification import verify
from coadjoint.simulation import store as streaming
from power_loss import LOST, losses, put, recorded

RUN = {"dt": 0.01, "steps": 23, "save_every": 2, "progress": False, "monitors": False, "accuracy": False}
RUN |= {"backend": "native"}


def simulate(members, place):
    if members == 1:
        body = co.System(co.SO2(), lambda xi: 0.5 * xi @ xi)
    else:
        mass = co.each(np.arange(1.0, 1 + members))
        body = co.System(co.SO2(), lambda xi, p: 0.5 * p.mass * xi @ xi, parameters={"mass": mass})
    return co.simulate(body, body.state(xi=[0.3]), **RUN, store=place / "run")


@pytest.fixture
def told(monkeypatch):
    """What is synced to disk, and what takes which name, in turn."""
    found: list[tuple[str, str]] = []

    def synced(handle):
        found.append(("sync", os.path.basename(os.readlink(f"/proc/self/fd/{handle}"))))

    def replaced(source, target, move=os.replace):
        found.append(("move", os.path.basename(target)))
        move(source, target)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(os, "replace", replaced)
    return found


@pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="no names of open files")
def test_a_file_is_on_the_disk_before_it_takes_its_name_and_its_name_after(tmp_path, told):
    place = tmp_path / "folder" / "file"
    disk.make(place.parent)
    assert told == [("sync", tmp_path.name)]
    disk.write(place, [b"one", b"two"])
    assert told[1:] == [("sync", ".file.partial"), ("move", "file"), ("sync", "folder")]
    disk.write(place, [b"more"], forced=False, named=False)
    assert told[4:] == [("move", "file")] and place.read_bytes() == b"more"
    disk.remove(place.parent)
    assert told[5:] == [("move", ".folder.partial"), ("sync", tmp_path.name)] and not list(tmp_path.iterdir())


@pytest.mark.long
@pytest.mark.parametrize(
    ("members", "seeds", "share"),
    [(1, 3, 1), (3, 2, 2)],
)
def test_a_run_goes_on_after_a_loss_of_power_at_any_moment(tmp_path, monkeypatch, members, seeds, share):
    monkeypatch.setattr(streaming, "PERIOD", 0.0)
    monkeypatch.setattr(streaming, "BURDEN", 0.0)
    monkeypatch.setattr(streaming, "BLOCK_ROWS", 6)
    (tmp_path / "whole").mkdir()
    history = recorded(tmp_path / "whole", lambda: simulate(members, tmp_path / "whole"))
    whole = simulate(members, tmp_path / "whole").dataset.load()
    put(history.left(len(history.trees) - 1, LOST), tmp_path / "ended")
    assert verify(tmp_path / "ended" / "run").complete, "what was returned is on the disk"
    monkeypatch.setattr(os, "fsync", lambda handle: None)
    place = tmp_path / "left"
    for number, (moment, left) in enumerate(losses(history, seeds)):
        if number % share:
            continue
        put(left, place)
        promised = counted(history.left(moment, LOST))
        assert promised is None or len(co.load(place / "run").dataset.time) >= promised
        found = simulate(members, place).dataset
        for name, values in whole.variables.items():
            np.testing.assert_array_equal(found[name], values, err_msg=f"{name} after moment {moment}")
        checked = verify(place / "run")
        assert checked.complete and checked.passed and not checked.unknown
        assert [path.name for path in place.iterdir()] == ["run"]
        shutil.rmtree(place)
    assert number > 60


def counted(left):
    """The records that are on the disk for certain."""
    manifest = left.get("run/manifest.json")
    return None if manifest is None else json.loads(manifest)["facts"]["records"]
