"""`coadjoint stability`: what it prints, draws and refuses."""

from __future__ import annotations

import json

import pytest

from coadjoint.cli.main import main


@pytest.mark.long
def test_it_prints_trim_modes_and_verdict(capsys):
    assert main(["stability", "remus_100", "--speed", "1.5", "--without", "stern_planes", "rudder"]) == 0
    shown = capsys.readouterr().out
    assert "1.5 m/s, straight, level" in shown and "grows, time constant 0.471 s" in shown
    assert shown.splitlines()[-1].split() == ["verdict", "unstable"]


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("arguments", "motion"),
    [
        (["--climb", "10"], "straight, climbing at 10.00°"),
        (["--climb", "-10"], "straight, diving at 10.00°"),
        (["--rudder", "5"], "turning to starboard"),
        (["--rudder", "-5"], "turning to port"),
    ],
)
def test_it_says_which_way_the_motion_goes(arguments, motion, capsys):
    assert main(["stability", "remus_100", *arguments]) == 0
    assert motion in capsys.readouterr().out


@pytest.mark.long
def test_several_speeds_make_a_table_and_a_figure_and_json_has_it_all(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["stability", "remus_100", "--speed", "1:2:0.5", "--out", "growth.png"]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in shown[1:4]] == ["1", "1.5", "2"] and shown[-1] == "Figure: growth.png."
    assert (tmp_path / "growth.png").read_bytes()[:4] == b"\x89PNG"
    assert main(["stability", "remus_100", "--rudder", "5", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    motion = found["motions"][0]
    assert motion["verdict"] == "stable" and 7 < motion["radius"] < 9 and len(motion["modes"]) >= 6


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["remus_10"], "No vehicle `remus_10` is shipped"),
        (["nothing.toml"], "nothing.toml"),
        (["remus_100", "--speed", "fast"], "--speed must be a speed in m/s"),
        (["remus_100", "--speed", "0:1:0"], "--speed must be a speed in m/s"),
        (["remus_100", "--hold", "propeller"], "--hold must be NAME=VALUE"),
        (["remus_100", "--hold", "sail=1"], "has no actuator `sail`"),
        (["remus_100", "--rudder", "5", "--free", "rudders"], "has no actuator `rudders`"),
        pytest.param(
            ["remus_100", "--rudder", "5", "--free", "propeller"], "moved propeller, and not ", marks=pytest.mark.long
        ),
        (["remus_100", "--hold", "propeller=nan"], "finite number, but is 'propeller=nan'"),
        (["remus_100", "--climb", "200"], "must be a number from -90 to 90, but is 200"),
        (["remus_100", "--without", "sail"], "has no part `sail`"),
    ],
)
def test_what_cannot_be_done_is_one_sentence(arguments, sentence, capsys):
    assert main(["stability", *arguments]) == 2
    assert sentence in capsys.readouterr().err
