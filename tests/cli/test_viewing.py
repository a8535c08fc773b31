"""The command `view`: it writes a page of one run or several, opens it, and says what stands in its way."""

from __future__ import annotations

import json
import re
import webbrowser

import pytest

import coadjoint as co
from coadjoint.cli import viewing
from coadjoint.cli.main import main
from coadjoint.cli.results_folder import recordings, streams, summary
from coadjoint.manifest import Manifest
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


@pytest.mark.long
def test_the_page_is_written_beside_the_run_and_opened(run, monkeypatch, capsys):
    seen = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(webbrowser, "open", lambda address: seen.append(address) or True)
    assert main(["view", str(run)]) == 0
    assert seen == [(run / "view.html").as_uri()]
    assert capsys.readouterr().out == f"Written: {run}/view.html.\n"


@pytest.mark.long
def test_the_folder_of_a_streamed_run_is_read_and_stays_as_it_was_written(tmp_path, monkeypatch, capsys):
    body, folder = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi), tmp_path / "spin"
    co.simulate(body, body.state(xi=[1.0, 2.0, 3.0]), dt=0.1, steps=4, accuracy=False, monitors=False, store=folder)
    assert list(recordings(folder)) == ["spin"] and summary(folder)
    monkeypatch.setattr("coadjoint.plotting.scene_of_runs.scene", lambda *given, **named: None)
    monkeypatch.setattr("coadjoint.plotting.player.page", lambda shown: "")
    assert main(["view", str(folder), "--no-open"]) == 0
    assert capsys.readouterr().out == f"Written: {tmp_path}/view.html.\n"


def test_a_folder_streams_by_the_kind_of_its_manifest(tmp_path):
    assert not streams(tmp_path)
    for kind in ("records", "results"):
        Manifest(tmp_path, {"kind": kind, "complete": True}).write()
        assert streams(tmp_path) == (kind == "records")


def test_without_a_browser_a_sentence_says_what_to_open(run, monkeypatch, capsys):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(viewing.sys, "platform", "linux")
    assert main(["view", str(run)]) == 0
    assert f"No browser was found on this machine: open {run}/view.html" in capsys.readouterr().out


@pytest.mark.long
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


@pytest.mark.parametrize("command", [["view", "--no-open"], ["report"], ["plot"]])
def test_of_a_sweep_it_is_told_what_shows_it(command, tmp_path, capsys):
    folder = tmp_path / "s"
    folder.mkdir()
    (folder / "statistics.nc").write_bytes(b"statistics of members")
    (folder / "summary.json").write_text(json.dumps({"card": "sweep", "members": 24, "figures": ["parallel.png"]}))
    facts = {"format": 2, "kind": "results", "inputs": {}, "complete": True, "sweep": {"digest": "0", "members": 24}}
    held = Manifest(folder, facts)
    held.enter("statistics.nc")
    held.write()
    assert main([*command, str(folder)]) == 2
    told = capsys.readouterr().err
    assert f"holds a sweep of 24 members, not a single run: its results are drawn in {folder}/parallel.png" in told
    assert "co.sweeps.load_sweep(" in told
    facts["complete"] = False
    held.write()
    assert main([*command, str(folder)]) == 2
    assert "a sweep that has not finished" in capsys.readouterr().err


@pytest.mark.parametrize("command", [["view", "--no-open"], ["report"]])
def test_of_a_run_without_a_good_step_it_is_told_why(command, tmp_path, capsys):
    (tmp_path / "run.toml").write_text("")
    failure = "Step 0 of 200 (t = 0 s) did not converge in 25 Newton iterations with dt = 0.05; take a smaller dt."
    (tmp_path / "summary.json").write_text(json.dumps({"card": "steps  0", "failure": failure}))
    assert main([*command, str(tmp_path)]) == 2
    told = capsys.readouterr().err
    assert "has no good step" in told and failure in told and "did not finish" not in told


@pytest.mark.long
@pytest.mark.parametrize(
    ("listed", "drawn"),
    [
        ("false", ["mission", "track", "depth", "speeds"]),
        ("true", ["mission", "track", "depth", "speeds"]),
        ('["depth", "animation", "mission"]', ["depth", "mission"]),
    ],
)
def test_a_report_draws_what_the_run_file_lists_else_the_mission_first(run, listed, drawn):
    (run / "run.toml").write_text(f"[output]\nfigures = {listed}\n")
    assert main(["report", str(run)]) == 0
    found = re.findall("<figcaption><b>(.*?)</b>", (run / "report.html").read_text())
    assert found[: len(drawn)] == drawn and (not listed.startswith("[") or found == drawn)
