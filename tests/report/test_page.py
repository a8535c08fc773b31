"""The report of a folder: every number with where it is from, every figure, and how to run it again."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path

import pytest

import coadjoint_vehicles as vehicles
from coadjoint.cli.main import main
from coadjoint.manifest import Manifest
from coadjoint.report.numbers import numbers, shown

TOP = """[system]
model = "free_rigid_body"
[parameters]
inertia = [1.0, 2.0, 3.0]
[run]
dt = 0.05
duration = 1.0
[output]
figures = ["energy", "attitude"]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("report") / "top"
    (made.parent / "top.toml").write_text(TOP)
    assert main(["run", str(made.parent / "top.toml"), "--out", str(made)]) == 0
    assert main(["report", str(made)]) == 0
    return made


def cells(text: str) -> list[list[str]]:
    rows = re.findall(r"<tr>(<td>.*?)</tr>", text, re.DOTALL)
    return [[html.unescape(cell) for cell in re.findall(r"<td>(.*?)</td>", row, re.DOTALL)] for row in rows]


@pytest.mark.long
def test_a_report_holds_certificate_figures_and_every_number(folder: Path):
    text = (folder / "report.html").read_text()
    summary = json.loads((folder / "summary.json").read_text())
    linked = re.sub(r'<a href="#([^"]+)">', lambda found: "" if f'id="{found[1]}"' in text else "lost", text)
    assert html.escape(summary["card"]) in linked.replace("</a>", "")
    assert text.count("<svg") == 2 and 'aria-label="energy: ' in text
    told = {row[0]: row[1] for row in cells(text)}
    for key in ("steps", "dt", "energy_initial", "group_defect_max", "xi_final"):
        assert told[key] == shown(summary[key])


@pytest.mark.long
def test_every_number_given_has_its_source(folder: Path):
    rows = cells((folder / "report.html").read_text())
    assert ["parameters.inertia", "[1, 2, 3]", "run.toml"] in rows
    assert ["run.dt", "0.05", "run.toml"] in rows
    assert any(row[0] == "initial.angular_velocity" and "catalogue" in row[-1] for row in rows)


@pytest.mark.long
def test_it_says_how_to_run_it_again_and_lists_what_was_written(folder: Path):
    text = (folder / "report.html").read_text()
    assert html.escape(TOP) in text
    assert "coadjoint run run.toml --out again" in text
    files = Manifest.read(folder).files
    assert {row[0]: row[2] for row in cells(text) if row[0] in files} == {n: check for n, (_, check) in files.items()}
    assert f"All {len(files)} files are unchanged since they were written." in text


def test_a_damaged_file_is_told(folder: Path, tmp_path: Path):
    import shutil

    other = tmp_path / "other"
    shutil.copytree(folder, other)
    (other / "energy.png").write_bytes(b"no picture")
    assert main(["report", str(other), "--figures", "energy", "--json"]) == 0
    text = (other / "report.html").read_text()
    assert "files are unchanged since" not in text and "energy.png" in text.split("How to run it again")[1]
    assert text.count("<svg") == 1


def test_a_report_needs_no_network(folder: Path):
    text = (folder / "report.html").read_text()
    assert not re.findall(r"(?:src|href)=[\"'](?!#)", text)
    assert "default-src 'none'" in text


def test_the_numbers_of_a_mission_have_the_citations_of_its_vehicle(tmp_path: Path):
    (tmp_path / "run.toml").write_text(
        '[vehicle]\nname = "remus_100"\n[parameters]\nrudder.area_cm2 = 140\n[run]\ndt = 0.05\nduration = 1\n'
    )
    found = numbers(tmp_path)
    rows = {row.name: row for row in found["of the vehicle REMUS 100"]}
    vehicle = vehicles.load("remus_100")
    assert set(rows) == set(vehicle.provenance)
    assert rows["rudder.area"].source == vehicle.sources["MSS"]
    assert rows["rudder.area"].note.startswith("changed by [parameters] of the run file; ")
    assert not rows["stern_planes.area"].note.startswith("changed")
    assert ("parameters.rudder.area_cm2", "140") in {row[:2] for row in found["of the run file, run.toml"]}


def test_what_is_no_folder_of_results_is_refused(tmp_path: Path, capsys):
    assert main(["report", str(tmp_path / "nothing")]) == 2
    assert "is none" in capsys.readouterr().err
    assert main(["report", str(tmp_path)]) == 2
    assert "holds no results of coadjoint" in capsys.readouterr().err
