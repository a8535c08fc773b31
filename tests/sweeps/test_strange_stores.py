"""Folders of sweeps from strangers and from broken disks: an error in a sentence, or the numbers that were written."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from strange_stores import VALUES, copied, damaged, entered, hostile, made

import coadjoint as co
from coadjoint.manifest import Manifest
from coadjoint.report.verification import verify
from coadjoint.sweeps.figures import columns


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return made(tmp_path_factory.mktemp("made") / "sweep")


def read(folder: Path) -> dict[str, np.ndarray]:
    """All that is read of a sweep; raises what reading raises."""
    found = co.sweeps.load_sweep(folder)
    dataset = found.dataset.load()
    assert repr(found) and repr(dataset) and isinstance(found.failures, dict) and columns(found)
    assert found.statistics.sizes["statistic"] >= 0
    return {str(name): dataset[name].values for name in dataset.variables}


def same(found: dict[str, np.ndarray]) -> bool:
    return found.keys() >= VALUES.keys() and all(np.array_equal(found[name], value) for name, value in VALUES.items())


def verified(folder: Path) -> bool:
    """Whether `coadjoint verify` finds everything right."""
    try:
        return verify(folder).passed
    except co.errors.FileError:
        return False


def test_a_sweep_that_was_written_is_read(whole):
    assert same(read(whole)) and verified(whole)


@pytest.mark.parametrize("seeds", [range(24), pytest.param(range(1000), marks=pytest.mark.long)], ids=["24", "1000"])
def test_no_hostile_store_raises_a_raw_error_or_runs_code(whole, tmp_path, monkeypatch, seeds):
    monkeypatch.setattr("numcodecs.registry.get_codec", None)
    monkeypatch.setattr("pickle.loads", None)
    mark, refused = tmp_path / "mark", 0
    for seed in seeds:
        folder = copied(whole, tmp_path / "out")
        told = hostile(folder, seed, mark)
        try:
            read(folder)
        except co.errors.FileError as error:
            refused += 1
            assert "\n" not in str(error), told
        except Exception as error:
            raise AssertionError(f"{seed} {told}") from error
        assert not mark.exists(), told
        shutil.rmtree(folder)
    print(f"{refused} of {len(seeds)} refused")
    assert refused > 0.7 * len(seeds)


@pytest.mark.parametrize("seeds", [range(24), pytest.param(range(1000), marks=pytest.mark.long)], ids=["24", "1000"])
def test_damage_is_found_by_reading_and_verifying_or_has_no_effect(whole, tmp_path, seeds):
    for seed in seeds:
        folder = copied(whole, tmp_path / "out")
        told = damaged(folder, seed)
        try:
            assert same(read(folder)), told
        except co.errors.FileError as error:
            assert not verified(folder), f"{told} {error}"
        except Exception as error:
            raise AssertionError(f"{seed} {told}") from error
        else:
            touched = {path for path in ("run.toml",) if path in told}
            assert touched or verified(folder), told
        shutil.rmtree(folder)


def test_a_chunk_that_was_deleted_is_no_nan(whole, tmp_path):
    folder = copied(whole, tmp_path / "out")
    (folder / "members.zarr" / "final_xi" / "c.1.0").unlink()
    dataset = co.sweeps.load_sweep(folder).dataset
    with pytest.raises(co.errors.FileError, match="missing"):
        _ = dataset.final_xi.values


def test_arrays_of_version_2_are_refused_before_they_are_opened(whole, tmp_path, monkeypatch):
    folder = copied(whole, tmp_path / "out")
    hostile(folder, 1, tmp_path / "mark")
    assert list(folder.rglob(".zarray"))
    monkeypatch.setattr("zarr.open_group", None)
    with pytest.raises(co.errors.FileError, match=r"zarr.json|zarr format 3"):
        _ = co.sweeps.load_sweep(folder).dataset


@pytest.mark.parametrize("changed", [{"more": 1}, {"attributes": {"units": {"m": 1}}}, {"attributes": None}])
def test_metadata_that_is_not_written_is_refused(whole, tmp_path, changed):
    folder = copied(whole, tmp_path / "out")
    path = folder / "members.zarr" / "final_xi" / "zarr.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changed))
    entered(Manifest.read(folder))
    with pytest.raises(co.errors.FileError, match="has metadata that coadjoint does not write"):
        _ = co.sweeps.load_sweep(folder).dataset


@pytest.mark.parametrize("counts", [[10**15, 0], [10**15, 10**15], [1, 10**9]])
def test_a_manifest_whose_files_fall_into_more_blocks_than_bytes_is_refused(whole, tmp_path, counts):
    """Every block is a turn of a loop."""
    manifest = Manifest.read(copied(whole, tmp_path / "out"))
    chunk = manifest.files["members.zarr/final_xi/c.1.0"]
    chunk[2:] = counts
    manifest.write()
    with pytest.raises(co.errors.FileError, match="not a manifest that coadjoint wrote"):
        co.sweeps.load_sweep(manifest.folder)


def test_the_summary_of_a_sweep_is_read_up_to_its_limit(whole, tmp_path):
    """One of 100 MB of zeros takes no place on the disk."""
    folder = copied(whole, tmp_path / "out")
    with open(folder / "summary.json", "r+b") as file:
        file.truncate(100_000_000)
    manifest = Manifest.read(folder)
    manifest.enter("summary.json")
    manifest.write()
    with pytest.raises(co.errors.FileError, match="larger than the 64 MB"):
        co.sweeps.load_sweep(folder)
    with pytest.raises(co.errors.FileError, match=r"There is no folder .*gone"):
        co.sweeps.load_sweep(tmp_path / "gone")
