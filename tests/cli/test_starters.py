"""Files to start from are commented, and run unchanged: of models, sweeps and vehicles."""

from __future__ import annotations

from pathlib import Path

import pytest

from coadjoint.cli.main import main
from coadjoint.errors import ArgumentError
from coadjoint.sweeps.example import example


def printed(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    assert main(arguments) == 0
    return capsys.readouterr().out


def test_the_run_file_of_a_model_has_sections_and_keys_with_their_meaning(capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(["models", "heavy_top"], capsys)
    assert (
        "dt = 0.0001  # the length of a step, s" in text
        and "angular_velocity = [0.0, 150.0, -4.61538]  # rad/s" in text
    )
    assert "# also: rotation, euler_zxz, euler_zyx, euler_rates" in text and "# format = " in text
    assert all("  # " in line for line in text.splitlines() if line.startswith("["))


def test_a_sweep_of_a_run_file_varies_a_number_of_it_and_is_valid(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    run = printed(["models", "heavy_top"], capsys).replace("duration = 2.0", "duration = 0.001")
    Path("top.toml").write_text(run)
    text = printed(["sweep", "top.toml", "--starter"], capsys)
    assert "[vary.parameters]\nmass = { from = 14.25, to = 15.75, count = 5 }" in text
    Path("masses.toml").write_text(text)
    assert "is a sweep of 5 members" in printed(["sweep", "masses.toml", "--check"], capsys)
    Path("bare.toml").write_text("[system]\nmodel = 'heavy_top'\n")
    with pytest.raises(ArgumentError, match=r"bare\.toml has no number in \[parameters\]"):
        example(Path("bare.toml"))


def test_a_new_vehicle_loads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text(printed(["vehicles", "new"], capsys))
    shown = printed(["vehicles", "show", "mine.toml"], capsys)
    assert "Mine" in shown and "Warning" not in shown
    assert main(["vehicles", "new", "remus_100"]) == 2 and "takes nothing else" in capsys.readouterr().err
