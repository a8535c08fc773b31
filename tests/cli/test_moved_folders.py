"""A folder of results is complete: it is read where the files that it was made from are gone."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from coadjoint.cli.main import main
from coadjoint.manifest import MANIFEST, Manifest
from coadjoint.report.folder import RUN_FILE
from coadjoint.report.numbers import numbers
from coadjoint_vehicles.files.registry import vehicle_text

MISSION = """
[vehicle]
file = "own/mine.toml"
[water]
kind = "table"
file = "current.csv"
[mission]
depth_m = 3
heading_deg = 0
speed_m_s = 1.5
[initial]
position_m = [0, 0, 3]
speed_m_s = 1.5
[run]
dt = 0.05
duration = 2
[output]
figures = ["track"]
"""


def kept(folder: Path) -> Path:
    """A folder of results of a vehicle of one's own, of which only what reports read is there."""
    copy = folder / "inputs" / "1" / "mine.toml"
    copy.parent.mkdir(parents=True)
    copy.write_text(vehicle_text("ellipsoid"), encoding="utf-8")
    (folder / RUN_FILE).write_text(MISSION, encoding="utf-8")
    inputs = {"own/mine.toml": "inputs/1/mine.toml"}
    Manifest(folder, {"kind": "results", "complete": True, "inputs": inputs}).write()
    return folder


def test_a_report_reads_the_folders_own_copy_of_a_vehicle(tmp_path):
    kept(tmp_path / "made").rename(tmp_path / "moved")
    found = numbers(tmp_path / "moved")
    mass = next(row for row in found["of the vehicle Ellipsoid"] if row.name == "body.mass")
    assert (mass.value, mass.unit) == ("125.6637061", "kg")


@pytest.mark.long
def test_every_command_reads_a_folder_that_was_moved(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    home = tmp_path / "home"
    (home / "own").mkdir(parents=True)
    (home / "own" / "mine.toml").write_text(vehicle_text("remus_100"), encoding="utf-8")
    (home / "current.csv").write_text("depth,north,east\n0,0.1,0\n50,0,0.1\n")
    (home / "dive.toml").write_text(MISSION)
    assert main(["run", "home/dive.toml", "--out", "home/out"]) == 0
    shutil.copytree("home/out", "there")
    shutil.move("home/out", "elsewhere")
    shutil.rmtree(home)
    for arguments in (
        ["info", "there"],
        ["verify", "there"],
        ["report", "there"],
        ["view", "there", "--no-open"],
        ["plot", "there"],
        ["plot", "there", "animation", "--format", "gif"],
        ["compare", "there", "elsewhere"],
        ["resume", "there"],
        ["run", "there/run.toml", "--check"],
        ["run", "there/run.toml", "--out", "again"],
        ["report", "again"],
    ):
        assert main(arguments) == 0, (arguments, capsys.readouterr().err)
    assert (tmp_path / "there" / MANIFEST).exists() and "mine.toml" in (tmp_path / "there" / "report.html").read_text()
