"""The command `view`: it writes a page of one run or several, opens it, and says what stands in its way."""

from __future__ import annotations

import json
import webbrowser

import pytest

from coadjoint.cli import viewing
from coadjoint.cli.main import main
from made_runs import dataset


def saved(run, folder):
    run.attrs["card"] = "system  made up"
    run.to_netcdf(folder / "trajectory.nc", engine="h5netcdf")


@pytest.fixture
def run(tmp_path):
    folder = tmp_path / "dive"
    folder.mkdir()
    saved(dataset(), folder)
    return folder


def test_the_page_is_written_beside_the_run_and_opened(run, monkeypatch, capsys):
    seen = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(webbrowser, "open", lambda address: seen.append(address) or True)
    assert main(["view", str(run)]) == 0
    assert seen == [(run / "view.html").as_uri()]
    assert capsys.readouterr().out == f"Written: {run}/view.html.\n"


def test_without_a_browser_a_sentence_says_what_to_open(run, monkeypatch, capsys):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(viewing.sys, "platform", "linux")
    assert main(["view", str(run)]) == 0
    assert f"No browser was found on this machine: open {run}/view.html" in capsys.readouterr().out


def test_several_runs_are_told_apart_by_their_folders(run, tmp_path, capsys):
    other = tmp_path / "other"
    other.mkdir()
    saved(dataset(50), other)
    page = tmp_path / "both" / "page.html"
    assert main(["view", str(run), str(other), "--out", str(page), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == str(page)
    text = page.read_text()
    assert '"label":"dive"' in text and '"label":"other"' in text


@pytest.mark.parametrize(("arguments", "words"), [([], "Which run?"), (["nowhere"], "There is no folder or file")])
def test_what_cannot_be_shown_is_refused(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["view", *arguments, "--no-open"]) == 2
    assert words in capsys.readouterr().err
