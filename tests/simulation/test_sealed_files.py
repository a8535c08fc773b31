"""netCDF files of runs say of themselves whether they are what was written; files of others cannot hang or crash."""

import random

import numpy as np
import pytest

import coadjoint as co
from coadjoint import sealed
from coadjoint.simulation.saved import SavedRun
from made_runs import dataset


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    file = tmp_path_factory.mktemp("sealed") / "run.nc"
    made = dataset()
    made.attrs["card"] = "a card"
    SavedRun(made).save(file)
    return file


def test_a_file_that_was_saved_is_read_without_a_child(written, monkeypatch):
    monkeypatch.setattr(sealed.subprocess, "run", lambda *_, **__: pytest.fail("a child"))
    assert sealed.sealed(written) is True
    assert co.load(written).dataset.energy.shape == (200,)


@pytest.mark.long
def test_no_single_bit_changes_a_number_that_is_read(written, tmp_path):
    content, generator = written.read_bytes(), random.Random(20261123)
    before = co.load(written).dataset
    file = tmp_path / "flipped.nc"
    # In the mark as well, where a child reads what is whole.
    places = [*(generator.randrange(len(content)) for _ in range(60)), len(content) - sealed.SIZE + 3]
    for place in places:
        flipped = content[place] ^ (1 << generator.randrange(8))
        file.write_bytes(content[:place] + bytes([flipped]) + content[place + 1 :])
        try:
            found = co.load(file).dataset
        except co.errors.FileError as error:
            assert "damaged" in str(error) or "not a netCDF file" in str(error)
            continue
        assert len(content) - sealed.SIZE <= place < len(content) - sealed.SIZE + len(sealed.MARK)
        for name in before.variables:
            np.testing.assert_array_equal(found[name], before[name])


@pytest.mark.long
def test_a_file_of_others_that_is_whole_is_read(written, tmp_path):
    file = tmp_path / "other.nc"
    file.write_bytes(written.read_bytes()[: -sealed.SIZE])
    assert sealed.sealed(file) is None
    np.testing.assert_array_equal(co.load(file).dataset.xi, co.load(written).dataset.xi)
