"""Shipped vehicles from their own logs, as on the page: by commands, with actuators that lag."""

from __future__ import annotations

import importlib.util
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

import coadjoint as co
from coadjoint.cli.main import main
from coadjoint.errors import ArgumentError
from coadjoint.identification import identify, synthetic_log
from coadjoint.identification.channels import VEHICLE, Channels
from coadjoint.identification.problem import setting
from coadjoint.identification.unknowns import unknowns
from coadjoint_vehicles.logs import write_log

PAGE = Path(__file__).parents[2] / "docs" / "figures" / "identification.py"
spec = importlib.util.spec_from_file_location("identification_page", PAGE)
assert spec is not None and spec.loader is not None
page = importlib.util.module_from_spec(spec)
spec.loader.exec_module(page)


@pytest.fixture(scope="module")
def remus():
    return page.torpedo()


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("vehicle", ["torpedo", "hovering"])
def test_intervals_of_a_vehicle_hold_the_truth(vehicle):
    """Two logs; misses are binomial, 5 % of the intervals."""
    system, start, run, guess, names = getattr(page, vehicle)()
    scores = []
    for seed in range(2):
        found = identify(guess, synthetic_log(run, noise=page.NOISE, seed=seed), start=start, parameters=names)
        assert not found.warnings
        scores += [(e.value - page.truth(system, n)) / e.standard_error for n, e in found.estimates.items()]
    print(np.round(scores, 1))
    assert np.sum(np.abs(scores) > 1.96) <= stats.binom.ppf(1 - 1 / 2000, len(scores), 0.05)
    assert 0.6 < np.std(scores) < 1.5


@pytest.mark.long
@pytest.mark.parametrize("vehicle", ["torpedo", "hovering"])
def test_each_interval_of_a_vehicle_covers_the_truth_in_at_least_90_of_100_logs(vehicle):
    made = getattr(page, vehicle)()
    found = page.coverage(made, 100)
    for name in found[0].estimates:
        assert sum(one[name].covers(page.truth(made[0], name)) for one in found) >= 90, name


@pytest.mark.long
@pytest.mark.parametrize("step", [pytest.param(None, marks=pytest.mark.long), 0.05])
def test_commands_move_actuators_to_second_order(remus, step):
    """What the sensors would say, with the true parameters, on dt = 0.05, 0.025 and 0.0125 s."""
    system, start, run, _, _ = remus
    log = synthetic_log(run, noise=page.NOISE, seed=1).between(0.0, 30.0)
    asked = setting(
        unknowns(system, ["added_mass[5,5]"], []), log, start, Channels(VEHICLE), co.Midpoint(), "held", step, 0.0
    )
    said: list[Any] = []
    for h in (0.05, 0.025, 0.0125):
        shooting = asked.shooting(h, 10.0)
        found = shooting.predict(np.zeros(1), np.zeros((3, shooting.size)))
        assert found is not None
        said.append(shooting.predict(np.zeros(1), np.zeros((3, shooting.size)), shooting.internal(found)))
    yaw = [found.values[..., VEHICLE.index("r")] for found in said]
    ratio = np.linalg.norm(yaw[0] - yaw[1]) / np.linalg.norm(yaw[1] - yaw[2])
    assert abs(np.log2(ratio) - 2) < 0.3


@pytest.mark.long
def test_a_measured_log_of_a_craft_is_fitted_on_steps_that_are_fine_enough(remus):
    system, start, run, _, _ = remus
    log = synthetic_log(run, noise=page.NOISE, seed=1).between(0.0, 40.0)
    names = ["hull.axial_drag", "added_mass[1,1]"]
    assert identify(system, log, start=start, parameters=names).dt == 0.05
    assert identify(system, replace(log, step=None), start=start, parameters=names).dt < 0.05


@pytest.mark.long
def test_the_command_prints_the_card_draws_and_writes_json(remus, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_log(synthetic_log(remus[2], noise=page.NOISE, seed=1).between(0.0, 40.0), "log.csv")
    asked = ["identify", "remus_100", "log.csv", "--parameters", "hull.axial_drag", "added_mass[5,5]"]
    assert main([*asked, "--out", "fit.png"]) == 0
    shown = capsys.readouterr().out
    assert "95% interval" in shown and "added_mass[5,5]" in shown and shown.splitlines()[-1] == "Figure: fit.png."
    assert (tmp_path / "fit.png").read_bytes()[:4] == b"\x89PNG"
    both = ["inertia[0,0]", "added_mass[3,3]"]
    assert main([*asked, *both, "--noise", "u=0.01", "--settle", "1", "--process-noise", "X", "--json"]) == 0
    found = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    wanders = found["process_noise"]["X"]
    assert 0 < wanders["deviation"] < 0.5 and wanders["correlation_time_s"] > 0 and wanders["unit"] == "N"
    assert wanders["deviation_interval"][0] <= wanders["deviation"] and len(wanders["correlation_time_interval_s"]) == 2
    assert found["settled"] is True
    assert [found["parameters"][name]["high"] for name in both] == [None, None]
    drag = found["parameters"]["hull.axial_drag"]
    assert drag["low"] < 0.42 < drag["high"] and found["noise"]["u"] == 0.01


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["remus_10", "log.csv", "--parameters", "hull"], "No vehicle `remus_10`"),
        (["remus_100", "none.csv", "--parameters", "hull"], "There is no file none.csv"),
        (["remus_100", "log.csv", "--parameters", "hul_axial"], "did you mean `hull.axial_drag`"),
        (["remus_100", "log.csv", "--parameters", "hull", "--noise", "u"], "--noise must be NAME=VALUE"),
        (["remus_100", "log.csv", "--parameters", "hull", "--settle", "99"], "shorter than the log"),
        (["remus_100", "log.csv", "--parameters", "hull", "--out", "none/fit.png"], "The folder none does not exist"),
        (["remus_100", "log.csv", "--parameters", "hull", "--still", "rudder"], "the log holds its commands"),
        (["remus_100", "log.csv", "--parameters", "hull", "--ignore", "wind"], "no column `wind`"),
        (["remus_100", "log.csv", "--parameters", "hull", "--process-noise", "winds"], "no `winds` that process noise"),
    ],
)  # fmt: skip
def test_the_command_refuses_in_a_sentence(remus, tmp_path, capsys, monkeypatch, arguments, sentence):
    monkeypatch.chdir(tmp_path)
    write_log(synthetic_log(remus[2], noise=page.NOISE).between(0.0, 20.0), "log.csv")
    assert main(["identify", *arguments]) == 2
    assert sentence in capsys.readouterr().err


@pytest.mark.cases(2)
@pytest.mark.parametrize(
    ("header", "sentence"),
    [
        ("command_propeller_rad_s", "of `propeller` are in rad/s, but `propeller` takes 1/s"),
        ("command_propeller_deg", "of `propeller` are in rad, but"),
        ("set_propeller", "no commands of propeller: add `command_propeller`"),
    ],
)
def test_commands_in_another_unit_and_missing_ones_are_refused(remus, tmp_path, capsys, header, sentence):
    path = tmp_path / "log.csv"
    write_log(synthetic_log(remus[2], noise=page.NOISE).between(0.0, 20.0), path)
    text = path.read_text()
    left_out = text.replace(",command_propeller_", ",c_").replace(",propeller_", ",set_actual_propeller_")
    path.write_text(
        left_out.replace(next(n for n in left_out.splitlines()[1].split(",") if n.startswith("c_")), header)
    )
    assert main(["identify", "remus_100", str(path), "--parameters", "hull.axial_drag"]) == 2
    assert sentence in capsys.readouterr().err


@pytest.mark.long
def test_a_column_that_the_simulation_misses_is_told(remus):
    system, start, run, _, _ = remus
    log = synthetic_log(run, noise=page.NOISE, seed=1).between(0.0, 40.0)
    names = ["hull.axial_drag"]
    assert not any("misses" in warning for warning in identify(system, log, start=start, parameters=names).warnings)
    wrong = replace(log, columns={**log.columns, "roll": np.degrees(log.columns["roll"])})
    warnings = identify(system, wrong, start=start, parameters=names).warnings
    assert any(
        warning.startswith("The simulation misses roll (") and "axes and units" in warning for warning in warnings
    )


def test_the_tables_of_all_thrusters_are_too_many_numbers_to_seek():
    system = co.vehicles.Craft(co.vehicles.load("bluerov2_heavy_von_benzon")).system
    with pytest.raises(ArgumentError, match=r"stands for \d+ numbers \(.*thrusters\..* \d+.*\), but at most 40"):
        unknowns(system, ["thrusters"], [])
