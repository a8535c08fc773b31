"""Output folders hold one run each."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from coadjoint.errors import FileError
from coadjoint.report.folder import RUN_FILE, SUMMARY, claimed, require_free

RUN = "[run]\ndt = 0.01\n"
OTHER = "[run]\ndt = 0.02\n"


def finish(folder: Path, text: str = RUN, overwrite: bool = False) -> None:
    with claimed(folder, text, overwrite):
        (folder / SUMMARY).write_text("{}")


def test_a_folder_is_made_and_marked_with_its_configuration(tmp_path):
    finish(tmp_path / "a" / "b")
    assert (tmp_path / "a" / "b" / RUN_FILE).read_text() == RUN


@pytest.mark.parametrize("overwrite", [False, True])
def test_another_run_is_never_overwritten(tmp_path, overwrite):
    finish(tmp_path)
    with pytest.raises(FileError, match="holds another run"):
        finish(tmp_path, OTHER, overwrite)
    assert (tmp_path / RUN_FILE).read_text() == RUN


def test_the_same_run_is_repeated_only_when_asked(tmp_path):
    finish(tmp_path)
    with pytest.raises(FileError, match="--overwrite"):
        finish(tmp_path)
    finish(tmp_path, "# a comment changes nothing\n" + RUN, overwrite=True)


@pytest.mark.parametrize("name", ["cayley.nc", SUMMARY])
def test_results_without_a_configuration_are_another_run(tmp_path, name):
    (tmp_path / name).write_text("")
    with pytest.raises(FileError, match="holds another run"):
        require_free(tmp_path, RUN, overwrite=True)


def test_a_damaged_configuration_is_another_run(tmp_path):
    (tmp_path / RUN_FILE).write_text("[run")
    with pytest.raises(FileError, match="holds another run"):
        require_free(tmp_path, RUN, overwrite=True)


def test_files_of_the_user_do_not_stand_in_the_way(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    finish(tmp_path)
    assert (tmp_path / "notes.txt").read_text() == "mine"


def test_a_run_that_writes_nothing_leaves_nothing(tmp_path):
    with pytest.raises(KeyboardInterrupt), claimed(tmp_path / "a" / "b", RUN, overwrite=False):
        raise KeyboardInterrupt
    assert not (tmp_path / "a").exists()
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(ZeroDivisionError), claimed(tmp_path, RUN, overwrite=False):
        raise ZeroDivisionError
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_what_was_written_before_a_failure_is_kept(tmp_path):
    with pytest.raises(ZeroDivisionError), claimed(tmp_path / "a", RUN, overwrite=False) as folder:
        (folder / "trajectory.nc").write_text("")
        raise ZeroDivisionError
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == [RUN_FILE, "trajectory.nc"]


def test_a_file_in_the_place_of_the_folder_is_told(tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(FileError, match="is a file, not a folder"):
        finish(tmp_path / "taken")
    with pytest.raises(FileError, match="cannot be written to"):
        finish(tmp_path / "taken" / "below")


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission_is_told(tmp_path):
    (tmp_path / "closed").mkdir(mode=0o555)
    with pytest.raises(FileError, match="cannot be written to: Permission denied"):
        finish(tmp_path / "closed")


def test_a_disk_that_refuses_is_told_and_nothing_stays(tmp_path, monkeypatch):
    def refuse(self, *_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(FileError, match="cannot be written to: Permission denied"):
        finish(tmp_path / "a")
    assert not (tmp_path / "a").exists()


def test_of_two_runs_that_start_at_once_one_gets_the_folder(tmp_path, monkeypatch):
    monkeypatch.setattr("coadjoint.report.folder.require_free", lambda *_: None)
    monkeypatch.setattr(Path, "exists", lambda self: self != tmp_path / RUN_FILE and os.path.exists(self))
    (tmp_path / RUN_FILE).write_text(OTHER)
    with pytest.raises(FileError, match="just been taken"):
        finish(tmp_path)
    assert (tmp_path / RUN_FILE).read_text() == OTHER
