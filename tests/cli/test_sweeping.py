"""`coadjoint sweep`: what it prints, writes and refuses."""

from __future__ import annotations

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from coadjoint.cli.main import main
from coadjoint.cli.sweeping import SHOWN, show

RUN = """
[system]
model = "simo_wong_top"
[run]
dt = 0.001
steps = 20
"""
SWEEP = """
[sweep]
run = "top.toml"
[vary.parameters]
mass = { values = [4.0, 5.0, 6.0] }
[results]
variables = ["xi"]
"""


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "top.toml").write_text(RUN)
    (tmp_path / "masses.toml").write_text(SWEEP)
    return "masses.toml"


def test_a_sweep_prints_its_statistics_and_leaves_a_folder(file, tmp_path, capsys):
    assert main(["sweep", file, "--workers", "1"]) == 0
    shown = capsys.readouterr().out
    assert "3 × heavy top" in shown and "final_xi[2]" in shown and "Results: masses/" in shown
    assert {path.name for path in (tmp_path / "masses").iterdir()} >= {"members.zarr", "statistics.nc", "summary.json"}
    assert main(["sweep", file, "--json"]) == 0  # it is there: nothing is run
    assert json.loads(capsys.readouterr().out)["members"] == 3
    assert main(["verify", "masses"]) == 0
    assert main(["info", "masses"]) == 0
    assert "3 × heavy top" in capsys.readouterr().out


def test_the_warnings_of_most_members_come_first(monkeypatch, capsys):
    monkeypatch.setattr("coadjoint.sweeps.results.facts", lambda plan: [("members", "9")])
    statistics = SimpleNamespace(data_vars=[], statistic=SimpleNamespace(values=np.zeros(0)))
    counts = {f"word {k}": count for k, count in enumerate((2, 7, *[1] * SHOWN))}
    plan = {"warnings": counts, "refusals": {"4": "No."}}
    made: Any = SimpleNamespace(summary=plan, statistics=statistics, folder="here", compared=True)
    show(made)
    lines = capsys.readouterr().out.splitlines()
    told = [line for line in lines if line.startswith("Warning")]
    assert told[:2] == ["Warning, of 7 members: word 1", "Warning, of 2 members: word 0"] and len(told) == SHOWN
    assert lines[-3:] == ["2 more warnings are in summary.json.", "Member 4 was refused: No.", "Results: here/"]


def test_a_check_runs_nothing(file, tmp_path, capsys):
    assert main(["sweep", file, "--check"]) == 0
    assert "a sweep of 3 members, 20 steps each" in capsys.readouterr().out
    assert not (tmp_path / "masses").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["top.toml"], "is not a sweep file"),
        (["nothing.toml"], "There is no sweep file"),
        (["masses.toml", "--workers", "0"], "must be a whole number from 1, but is 0"),
        (["masses.toml", "--scheduler", "somewhere://x"], "tcp://HOST:8786"),
    ],
)
def test_what_cannot_be_done_is_told_in_a_sentence(file, arguments, words, capsys):
    if "--scheduler" in arguments:
        pytest.importorskip("distributed", reason="schedulers need dask.distributed, the extra [cluster]")
    assert main(["sweep", *arguments]) == 2
    told = capsys.readouterr().err
    assert words in told and len(told.strip().splitlines()) == 1


def test_a_sweep_file_is_no_run_file(file, capsys):
    assert main(["run", file]) == 2
    assert "coadjoint sweep" in capsys.readouterr().err
