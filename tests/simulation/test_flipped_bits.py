"""One bit of one file is flipped: it is found, and no number that is read is another one."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from test_store import stopped_after

import coadjoint as co
from coadjoint.manifest import Manifest
from coadjoint.report.verification import verify
from coadjoint.runs.run_file import read
from coadjoint.runs.running import execute
from coadjoint.simulation import store as streaming
from files import TOP, write

SEED = 20251125
RUN = {"dt": 0.01, "steps": 600, "save_every": 2, "progress": False, "monitors": False, "accuracy": False}
RUN |= {"backend": "native"}
BODY = co.System(co.SO3(), lambda xi: 0.5 * xi @ (np.array([1.0, 2.0, 3.0]) * xi))
CHANGES = ["run.steps=30", "run.save_every=2", "output.figures=false", "output.folder=out"]
FLIPS = [4, pytest.param(200, marks=pytest.mark.long)]


def simulate(place):
    return co.simulate(BODY, BODY.state(xi=[0.1, 0.2, 0.3]), **RUN, store=place)


def flipped(place, generator):
    """Flip a bit of a file, each file being as likely as the others; the file, and what it held."""
    files = sorted(path for path in place.rglob("*") if path.is_file() and not path.name.endswith("lock"))
    path = files[generator.integers(len(files))]
    kept = path.read_bytes()
    data = np.frombuffer(kept, np.uint8).copy()
    data[generator.integers(len(data))] ^= 1 << generator.integers(8)
    path.write_bytes(data.tobytes())
    return path, kept


def is_found(place):
    try:
        return bool(verify(place).problems)
    except co.errors.FileError:
        return True


def unused(place):
    """The checkpoint before the last one, which no manifest names and nothing reads."""
    return {"checkpoint-0.npz": "checkpoint-1.npz"}.get(Manifest.read(place).facts["checkpoint"], "checkpoint-0.npz")


def require_unchanged(load, expected):
    """What is read is what was written, as far as it goes, or the call says what is wrong."""
    try:
        found = load()
        rows = len(found.time)
        for name, values in expected.variables.items():
            now, then = found[name].values, values.values
            np.testing.assert_array_equal(now, then[:rows] if "time" in values.dims else then)
    except co.errors.FileError:
        pass


@pytest.mark.long
@pytest.mark.parametrize("flips", FLIPS)
@pytest.mark.parametrize("done", [True, False], ids=["finished", "interrupted"])
def test_of_a_stored_run(tmp_path, monkeypatch, done, flips):
    monkeypatch.setattr(streaming, "PERIOD", 0.0)
    monkeypatch.setattr(streaming, "BURDEN", 0.0)
    monkeypatch.setattr(streaming, "BLOCK_ROWS", 64)
    whole = simulate(tmp_path / "whole").dataset.load()
    place = tmp_path / ("whole" if done else "cut")
    if not done:
        with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
            patched.setattr("coadjoint.simulation.driver.PATIENCE", 0.0)
            stopped_after(patched, 100)
            simulate(place)
        assert 0 < len(co.load(place).dataset.time) < len(whole.time)
    generator, again = np.random.default_rng(SEED), tmp_path / "again"
    for _ in range(flips):
        shutil.copytree(place, again)
        path, _ = flipped(again, generator)
        assert is_found(again) or path.name == unused(again), path
        require_unchanged(lambda: co.load(again).dataset, whole)
        require_unchanged(lambda: simulate(again).dataset, whole)
        require_unchanged(lambda: co.resume(again, BODY).dataset, whole)
        shutil.rmtree(again)


@pytest.mark.long
@pytest.mark.parametrize("flips", FLIPS)
def test_of_a_folder_of_results(tmp_path, monkeypatch, flips):
    monkeypatch.chdir(tmp_path)
    file = write(tmp_path, TOP)
    place = tmp_path / "out"
    execute(read(file, CHANGES), place, progress=False)
    whole = co.load(place / "trajectory.nc").dataset.load()
    generator = np.random.default_rng(SEED)
    for _ in range(flips):
        path, kept = flipped(place, generator)
        assert is_found(place), path
        require_unchanged(lambda: co.load(place / "trajectory.nc").dataset, whole)
        with pytest.raises(co.errors.FileError):
            execute(read(file, CHANGES), place, progress=False)
        path.write_bytes(kept)
    assert verify(place).passed
