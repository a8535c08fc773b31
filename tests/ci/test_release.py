"""A release: one version everywhere, dated and short changes, archives that hold what they must."""

from __future__ import annotations

import re
import sys
import zipfile
from pathlib import Path
from types import SimpleNamespace

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / ".ci"))
import release  # noqa: E402

CHANGES = (ROOT / "CHANGELOG.md").read_text("utf-8")
LINES = 60
"""Lines that the changes of a version may have: what a user must know."""


def test_every_place_states_one_version_which_has_a_dated_section() -> None:
    found = release.versions()
    assert len(found) == 5 and len(set(found.values())) == 1, found
    titles = re.findall(r"^## (.*)$", CHANGES, re.MULTILINE)
    assert release.dated()[1] in titles, "The date of CITATION.cff is that of the section of CHANGELOG.md."
    assert re.fullmatch(r"\d+\.\d+\.\d+, \d{4}-\d{2}-\d{2}", release.dated()[1])


def test_the_changes_of_a_version_are_short() -> None:
    for section in CHANGES.split("\n## ")[1:]:
        title, _, text = section.partition("\n")
        assert text.count("\n") <= LINES, f"The section {title} of CHANGELOG.md has more than {LINES} lines."


def wheel(folder: Path, package: str, *names: str) -> None:
    with zipfile.ZipFile(folder / f"{package}-1-py3-none-any.whl", "w") as archive:
        for name in names:
            archive.writestr(name, "")


def test_a_wheel_that_lacks_a_notice_or_holds_a_stranger_is_found(tmp_path: Path) -> None:
    about = "coadjoint-1.dist-info"
    notices = [f"{about}/licenses/{name}" for name in release.NOTICES["coadjoint"]]
    wheel(tmp_path, "coadjoint", "coadjoint/py.typed", *notices[:-1], "tests/test_a.py")
    other = [f"coadjoint_vehicles-1.dist-info/licenses/{name}" for name in ("LICENSE", "NOTICE")]
    wheel(tmp_path, "coadjoint_vehicles", "coadjoint_vehicles/py.typed", *other)
    file = "coadjoint-1-py3-none-any.whl"
    assert release.lacking(tmp_path) == [f"{file} lacks {notices[-1]}", f"{file} holds tests/test_a.py"]


def test_two_builds_are_compared_by_all_their_bytes(tmp_path: Path) -> None:
    for name, text in (("first", "a"), ("second", "b")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "x.whl").write_text(text)
    assert release.sums(tmp_path / "first") != release.sums(tmp_path / "second")
    (tmp_path / "second/x.whl").write_text("a")
    assert release.sums(tmp_path / "first") == release.sums(tmp_path / "second")


def test_the_notices_that_wheels_must_hold_are_those_that_projects_declare() -> None:
    for folder, package in ((".", "coadjoint"), ("vehicles", "coadjoint_vehicles")):
        text = (ROOT / folder / "pyproject.toml").read_text("utf-8")
        (declared,) = re.findall(r"^license-files = \[(.*)\]$", text, re.MULTILINE)
        assert tuple(re.findall(r'"(.*?)"', declared)) == release.NOTICES[package]


def test_a_release_replaces_the_archives_of_an_earlier_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(release, "ROOT", tmp_path)
    built, target, noted = tmp_path / "built", tmp_path / "dist", []
    for folder, name in ((built, "coadjoint-2.whl"), (target, "coadjoint-1.whl"), (target, "coadjoint-1.tar.gz")):
        folder.mkdir(exist_ok=True)
        (folder / name).write_text(name)
    release._written(SimpleNamespace(note=noted.append), built, release.sums(built))
    assert sorted(path.name for path in target.iterdir()) == ["SHA256SUMS", "coadjoint-2.whl"]
    assert (target / "SHA256SUMS").read_text().split() == [release.sums(built)["coadjoint-2.whl"], "coadjoint-2.whl"]


def test_a_version_without_files_in_tests_stored_is_no_release(monkeypatch: pytest.MonkeyPatch) -> None:
    noted: list[str] = []
    checks = SimpleNamespace(note=noted.append, run=lambda part, command: command == "true")
    monkeypatch.setattr(release, "dated", lambda: ("9.9.9, today", "9.9.9, today"))
    monkeypatch.setattr(release, "_git", lambda *words: "")
    for version, kept in (("9.9.9", False), (release.versions()["CITATION.cff"], True)):
        monkeypatch.setattr(release, "versions", lambda version=version: {"./pyproject.toml": version})
        assert release.stated(checks) == kept
    assert noted == ["tests/stored/9.9.9.tar.gz is missing: python .ci/stored.py writes it"]
