"""Folders and files of others: links in them lead to no file elsewhere, and no name of a file is an address."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import xarray

import coadjoint as co
from coadjoint import disk
from coadjoint.disk import write_text
from coadjoint.errors import FileError
from coadjoint.report.folder import claimed
from coadjoint.simulation.lock import Lock
from coadjoint.simulation.saved import SavedRun
from coadjoint_vehicles.hydrodynamics import capytaine_added_mass
from coadjoint_vehicles.water import Bottom
from made_runs import dataset


@pytest.fixture
def other(tmp_path) -> Path:
    """A file of one's own, to which links in a folder of somebody else lead."""
    found = tmp_path / "other"
    found.write_text("as it was")
    return found


def test_a_lock_that_is_a_link_is_refused_and_nothing_is_written_to_what_it_leads_to(tmp_path, other):
    for target in (other, tmp_path / "none"):
        folder = tmp_path / "run"
        folder.mkdir(exist_ok=True)
        (folder / ".lock").unlink(missing_ok=True)
        (folder / ".lock").symlink_to(target)
        with pytest.raises(FileError, match="is a link, to which nothing is written: remove it"):
            Lock(folder, ".lock")
        with pytest.raises(FileError, match="is a link"), claimed(folder, "[run]\n", False):
            pass
    assert other.read_text() == "as it was" and not (tmp_path / "none").exists()


def test_a_file_is_written_in_place_of_a_link_and_not_through_it(tmp_path, other):
    target = tmp_path / "data"
    disk.partial(target).symlink_to(other)
    with pytest.raises(OSError):
        disk.write(target, [b"numbers"])
    disk.write(target, [b"numbers"])  # the link has been removed
    target.unlink()
    target.symlink_to(other)
    disk.write(target, [b"numbers"])
    assert target.read_bytes() == b"numbers" and not target.is_symlink() and other.read_text() == "as it was"


def test_the_name_under_which_a_page_is_written_cannot_be_known_before(tmp_path, other):
    (tmp_path / f".view.html.{os.getpid()}").symlink_to(other)
    write_text(tmp_path / "view.html", "a page")
    assert (tmp_path / "view.html").read_text() == "a page" and other.read_text() == "as it was"


@pytest.mark.parametrize("name", ["zip::x.nc", pytest.param("http::x.nc", marks=pytest.mark.long), "~/x.nc"])
def test_a_name_of_a_file_is_no_address_and_no_home(tmp_path, monkeypatch, name):
    """xarray takes such relative names for chains of addresses, or for the folder of a user."""
    monkeypatch.chdir(tmp_path)
    Path("~").mkdir()
    made = dataset(5)
    made.attrs["card"] = "a card"
    SavedRun(made).save(name)
    assert co.load(name).dataset.identical(co.load(Path(name).absolute()).dataset)
    axis = np.arange(3.0)
    depths = xarray.DataArray(np.ones((3, 3)), {"north": axis, "east": axis}, name="depth")
    depths.to_netcdf(Path(name).absolute(), engine="h5netcdf")
    assert Bottom.from_netcdf(name).depth.shape == (3, 3)
    monkeypatch.setattr("coadjoint.sealed.tried", lambda path: path == Path(name))  # without the time of a child
    with pytest.raises(FileError, match="holds no added_mass, but depth"):
        capytaine_added_mass(name, axes="z_up")
