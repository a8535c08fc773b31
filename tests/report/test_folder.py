"""Output folders hold one run each."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from coadjoint.errors import FileError
from coadjoint.manifest import MANIFEST, Manifest
from coadjoint.report.companion_files import keep_beside
from coadjoint.report.folder import INPUTS, RUN_FILE, SUMMARY, UNFINISHED, claimed, held, kept_inputs, require_free

RUN = "[run]\ndt = 0.01\n"
OTHER = "[run]\ndt = 0.02\n"


def finish(folder: Path, text: str = RUN, overwrite: bool = False, **inputs: Path) -> bool:
    """Whether a run was begun there."""
    with claimed(folder, text, overwrite, inputs) as claim:
        before = claim.complete
        if not before:
            claim.results(summarized)
    return not before


def summarized(stage: Path) -> None:
    (stage / SUMMARY).write_text("{}")


def test_a_folder_is_made_and_marked_with_its_configuration(tmp_path):
    folder = tmp_path / "a" / "b"
    finish(folder)
    assert (folder / RUN_FILE).read_text() == RUN
    assert {path.name for path in folder.iterdir()} == {RUN_FILE, SUMMARY, MANIFEST}
    assert not list(Manifest.read(folder).problems())


@pytest.mark.parametrize("overwrite", [False, True])
def test_another_run_is_never_overwritten(tmp_path, overwrite):
    finish(tmp_path)
    with pytest.raises(FileError, match=r"holds another run already: run.dt is 0.01 there and 0.02 here"):
        finish(tmp_path, OTHER, overwrite)
    with pytest.raises(FileError, match=r"run.steps is given here and not there"):
        finish(tmp_path, RUN + "steps = 3\n", overwrite)
    assert (tmp_path / RUN_FILE).read_text() == RUN


def test_the_same_run_is_repeated_only_when_asked(tmp_path):
    assert finish(tmp_path)
    assert not finish(tmp_path)
    assert finish(tmp_path, "# a comment changes nothing\n" + RUN, overwrite=True)


def test_input_files_are_kept_under_names_of_their_own(tmp_path):
    places = {"one": "run.toml", "two": "sea/table.csv", "three": "air/table.csv", "four": "unfinished"}
    inputs = {name: tmp_path / "from" / place for name, place in places.items()}
    for path in inputs.values():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(str(path))
    folder = tmp_path / "out"
    with claimed(folder, RUN, False, inputs) as claim:
        kept = {name: folder / copy for name, copy in claim.manifest.facts["inputs"].items()}
        assert {name: path.read_text() for name, path in kept.items()} == {
            name: str(path) for name, path in inputs.items()
        }
        claim.results(summarized)
    assert kept_inputs(folder / RUN_FILE) == kept
    assert (folder / RUN_FILE).read_text() == RUN
    inputs["two"].write_text("other")
    with pytest.raises(FileError, match=r"the file table.csv has other contents there"):
        finish(folder, RUN, **inputs)


def test_what_an_input_file_needs_is_kept_beside_it(tmp_path):
    source = tmp_path / "hull.toml"
    (tmp_path / "wamit").mkdir()
    (tmp_path / "far").mkdir()
    for path in (source, tmp_path / "wamit" / "hull.1", tmp_path / "far.1"):
        path.write_text(path.name)
    keep_beside(source, "wamit/hull.1", tmp_path / "wamit" / "hull.1")
    with claimed(tmp_path / "out", RUN, False, {"hull.toml": source}) as claim:
        assert (claim.folder / "inputs" / "1" / "wamit" / "hull.1").read_text() == "hull.1"
        claim.results(summarized)
    (tmp_path / "wamit" / "hull.1").write_text("another")
    with pytest.raises(FileError, match=r"the file hull.1 has other contents there"):
        finish(tmp_path / "out", RUN, **{"hull.toml": source})
    keep_beside(source, "../far.1", tmp_path / "far.1")
    with pytest.raises(FileError, match=r"names \.\./far\.1, which is not in its folder"):
        finish(tmp_path / "other", RUN, **{"hull.toml": source})
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize(("name", "text"), [("cayley.nc", ""), (SUMMARY, ""), (RUN_FILE, "[run")])
def test_results_without_a_configuration_or_with_a_damaged_one_are_another_run(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(FileError, match="holds another run"):
        require_free(tmp_path, RUN)


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


def test_what_was_computed_before_a_failure_is_kept(tmp_path):
    with pytest.raises(ZeroDivisionError), claimed(tmp_path / "a", RUN, overwrite=False) as claim:
        (claim.folder / UNFINISHED).mkdir()
        raise ZeroDivisionError
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == [MANIFEST, RUN_FILE, UNFINISHED]


def test_a_run_file_that_was_there_before_stays(tmp_path):
    (tmp_path / RUN_FILE).write_text("# mine\n" + RUN)
    with pytest.raises(ZeroDivisionError), claimed(tmp_path, RUN, overwrite=False):
        raise ZeroDivisionError
    assert [path.read_text() for path in tmp_path.iterdir()] == ["# mine\n" + RUN]


def test_a_folder_that_is_deleted_meanwhile_is_told(tmp_path):
    def deleted() -> None:
        with claimed(tmp_path / "a", RUN, False) as claim:
            shutil.rmtree(tmp_path / "a")
            claim.results(summarized)

    with pytest.raises(FileError, match="was deleted or moved while the run wrote to it"):
        deleted()
    assert not (tmp_path / "a").exists()


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


def test_of_two_runs_at_once_one_gets_the_folder(tmp_path):
    with claimed(tmp_path, RUN, False), pytest.raises(FileError, match=f"in use by process {os.getpid()}"):
        finish(tmp_path)


def test_what_a_kill_left_among_the_inputs_is_removed(tmp_path):
    source = tmp_path / "data.csv"
    source.write_text("1")
    with claimed(tmp_path / "out", RUN, False, {"data.csv": source}) as claim:
        claim.results(lambda stage: (stage / SUMMARY).write_text("{}"))
    left = tmp_path / "out" / INPUTS / "1" / ".data.csv.partial"
    left.write_text("half of it")
    with claimed(tmp_path / "out", RUN, False, {"data.csv": source}):
        assert not left.exists()


def test_a_folder_whose_manifest_lists_no_run_file_is_refused(tmp_path):
    finish(tmp_path)
    manifest = Manifest.read(tmp_path)
    del manifest.files[RUN_FILE]
    manifest.write()
    for begin in (lambda: finish(tmp_path), lambda: require_free(tmp_path, RUN), lambda: held(tmp_path).__enter__()):
        with pytest.raises(FileError, match=r"run.toml is not among those of the manifest: put back a copy"):
            begin()
