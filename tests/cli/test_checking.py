"""`coadjoint run --check`: what it refuses, and what it says of the folder."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from coadjoint.cli.catalogue import example
from coadjoint.cli.main import main
from coadjoint.plotting.plots import available
from coadjoint.runs.prepared import prepared
from coadjoint.simulation.dataset import outline
from coadjoint_vehicles.files.registry import load_vehicle, vehicle_text
from coadjoint_vehicles.missions.mission import load_mission


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
    assert "`parameters.mass` must be positive" in capsys.readouterr().err
    assert main(["run", "top.toml", "--check"]) == 2
    told = capsys.readouterr().err
    assert told.startswith("top.toml is a run file") and "holds another run already" in told
    assert main(["run", "top.toml", "--check", "--out", "free", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"valid": True, "warnings": []}
    assert not Path("free").exists()


MISSION = """
[vehicle]
{vehicle}
[controller]
kind = "none"
{more}
[initial]
speed_m_s = 0.5
[run]
dt = 0.1
steps = 2
[output]
figures = false
csv = false
"""
HEAVY = "-50.0 %: it sinks unless something holds it."


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("more", "beginning"),
    [("[parameters]\nmass = {twice}", "With [parameters] its weight is"), ("", "mine.toml: its weight is")],
)
def test_a_check_tells_the_warnings_on_a_doubtful_vehicle_that_the_run_tells(
    more, beginning, tmp_path, monkeypatch, capsys, recwarn
):
    monkeypatch.chdir(tmp_path)
    text, mass = vehicle_text("ellipsoid"), float(load_vehicle("ellipsoid").mass)
    if more:
        given = MISSION.format(vehicle='name = "ellipsoid"', more=more.format(twice=2 * mass))
    else:
        given = MISSION.format(vehicle='file = "mine.toml"', more="")
        buoyancy = f'buoyancy = {{ value = {mass * 9.81 / 2}, unit = "N", source = "LAMB" }}'
        Path("mine.toml").write_text(text.replace("neutral = true", buoyancy))
    Path("dive.toml").write_text(given)
    assert main(["run", "dive.toml", "--check", "--json"]) == 0
    warnings = json.loads(capsys.readouterr().out)["warnings"]
    assert any(sentence.startswith(beginning) and HEAVY in sentence for sentence in warnings)
    assert main(["run", "dive.toml"]) == 0
    assert set(warnings) <= set(json.loads(Path("dive/summary.json").read_text())["warnings"])
    assert not [one for one in recwarn if issubclass(one.category, UserWarning)]


def test_a_mission_from_python_warns_of_its_parameters(tmp_path):
    file = tmp_path / "dive.toml"
    twice = 2 * float(load_vehicle("ellipsoid").mass)
    file.write_text(MISSION.format(vehicle='name = "ellipsoid"', more=f"[parameters]\nmass = {twice}"))
    with pytest.warns(UserWarning, match=r"With \[parameters\] its weight is"):
        _ = load_mission(file).setup


def test_a_figure_that_an_ensemble_will_not_have_is_refused_before_it_runs(tmp_path, monkeypatch, capsys):
    """Members in waters of their own have no `current` in their dataset, though each of them alone has."""
    monkeypatch.chdir(tmp_path)
    water = "[water]\nvelocity_m_s = [0.0, 0.1, 0.0]\n[perturb]\nwater.velocity_m_s = [0.1, 0.1, 0.0]"
    text = MISSION.format(vehicle='name = "bluerov2_heavy_blue"', more=water)
    Path("dive.toml").write_text(text.replace("[run]", "[run]\nmembers = 2"))
    figures = ["--set", 'output.figures=["current"]']
    for more in (["--check"], []):
        assert main(["run", "dive.toml", *figures, *more]) == 2
        assert "has nothing to draw for `current`" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["dive.toml"]
    alone = ["--set", "run.members=1", "--set", "perturb="]
    assert main(["run", "dive.toml", *figures, *alone, "--check"]) == 0


@pytest.mark.long
@pytest.mark.parametrize("varied", [False, True])
def test_the_outline_of_an_ensemble_has_the_figures_of_its_dataset(varied, tmp_path):
    file = tmp_path / "dive.toml"
    perturbed = "water.velocity_m_s = [0.1, 0.1, 0.0]" if varied else 'mass = "2 %"'
    water = f"[water]\nvelocity_m_s = [0.0, 0.1, 0.0]\n[perturb]\n{perturbed}"
    text = MISSION.format(vehicle='name = "bluerov2_heavy_blue"', more=water)
    file.write_text(text.replace("[run]", "[run]\nmembers = 2"))
    mission = load_mission(file)
    foreseen = available(outline(prepared(mission.file, mission.setup)), films=True)
    assert foreseen == available(mission.run().dataset, films=True) and ("current" in foreseen) is not varied
