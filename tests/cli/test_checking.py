"""`coadjoint run --check`: what it refuses, and what it says of the folder."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from coadjoint.cli.catalogue import example
from coadjoint.cli.main import main


@pytest.mark.parametrize(
    "change",
    [
        "parameters.mass=-15",
        "parameters.mass=nan",
        "parameters.inertia=[1, 2, -3]",
        "run.dt=5",
        "run.dt=nan",
        "run.duration=1e300",
        "initial.euler_zxz_deg=[1800000, 0, 0]",
        "method.coefficients=[1, 2]",
        "method.name=Suzuki5",
        'output.figures=["track"]',
        'output.figures=["budget"]',
        "output.folder=/proc/none",
    ],
)
def test_a_check_refuses_what_a_run_refuses_in_the_same_words_and_leaves_nothing(change, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("top.toml").write_text(example("heavy_top"))
    changes = ["--set", change, *(["--set", "run.steps="] if "duration" in change else [])]
    found = []
    for more in (["--check"], []):
        assert main(["run", "top.toml", *changes, *more]) == 2
        found.append(capsys.readouterr().err.strip())
    assert found[0].endswith(found[1])
    assert [path.name for path in tmp_path.iterdir()] == ["top.toml"]


def test_a_check_speaks_of_the_file_before_it_speaks_of_the_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("top.toml").write_text(example("heavy_top"))
    Path("top").mkdir()
    Path("top/run.toml").write_text("[run]\ndt = 1.0\n")
    assert main(["run", "top.toml", "--check", "--set", "parameters.mass=-15"]) == 2
    assert "`mass` must be positive" in capsys.readouterr().err
    assert main(["run", "top.toml", "--check"]) == 2
    told = capsys.readouterr().err
    assert told.startswith("top.toml is a run file") and "holds another run already" in told
    assert main(["run", "top.toml", "--check", "--out", "free", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"valid": True, "warnings": []}
    assert not Path("free").exists()
