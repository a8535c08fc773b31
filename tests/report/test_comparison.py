"""Two runs side by side: the differences are those of the states at common times, and what does not fit is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import coadjoint as co
import made_runs
from coadjoint.cli.comparing import show
from coadjoint.cli.main import main
from coadjoint.errors import ArgumentError
from coadjoint.report.comparison import compare, merits


def body(omega=(0.3, 0.0, 1.0), dt=0.1, method=None, duration=2.0, save_every=1, group=None):
    system = co.System(
        group or co.SO3(),
        lambda xi: 0.5 * xi @ (np.arange(1.0, 4.0) * xi) if group is None else 0.5 * xi @ xi,
        name="free body",
    )
    xi = omega if group is None else (*omega, 0.0, 0.0, 0.0)
    start = system.state(xi=list(xi))
    return co.simulate(system, start, dt=dt, duration=duration, method=method or co.Midpoint(), save_every=save_every)


@pytest.fixture(scope="module")
def coarse():
    return body()


def test_a_run_is_not_apart_from_itself(coarse):
    found = compare(coarse.dataset, coarse.dataset)
    assert found.common == 21
    assert set(found.largest.values()) == {0.0}


def test_runs_of_two_steps_are_compared_at_their_common_times(coarse):
    fine = body(dt=0.05)
    found = compare(coarse.dataset, fine.dataset, ("h", "h/2"))
    assert (found.common, found.last) == (21, pytest.approx(2.0))
    gap = np.linalg.norm(coarse.dataset.mu.values - fine.dataset.mu.values[::2], axis=1)
    assert found.final["mu"] == pytest.approx(gap[-1])
    assert found.largest["mu"] == pytest.approx(gap.max())
    assert found.setting["dt"] == (0.1, 0.05)
    energies = found.conserved["energy_error_max"]
    assert energies == (coarse.relative_change("energy"), fine.relative_change("energy"))
    assert energies[0] > 3 * energies[1] > 0


def test_a_shorter_run_is_compared_as_far_as_it_goes(coarse):
    found = compare(coarse.dataset, body(duration=1.0).dataset)
    assert (found.common, found.last) == (11, pytest.approx(1.0))
    assert found.largest["mu"] == 0.0


def test_what_only_one_of_the_runs_conserves_is_shown_for_that_one(coarse):
    other = coarse.dataset.copy()
    error = other.attrs.pop("energy_error_max")
    assert compare(coarse.dataset, other).conserved["energy_error_max"] == (error, None)
    assert compare(other, coarse.dataset).conserved["energy_error_max"] == (None, error)
    assert "energy_error_max" not in compare(other, other).conserved


def test_figures_of_missions_and_trials_are_side_by_side(coarse, capsys):
    trial = {"manoeuvre": "zigzag", "period": 6.2}
    first = {"mission": {"duration": 120.0, "times_real_time": 9e3, "position_final": [1.0, 2.0], "trial": trial}}
    second = {"mission": {"duration": 100.0, "ended_by": "surface", "tracking": {"depth": {"error_rms": 0.25}}}}
    found = merits(first, second)
    assert list(found)[:2] == ["trial.manoeuvre", "trial.period"]
    assert found == {
        "trial.manoeuvre": ("zigzag", None),
        "trial.period": (6.2, None),
        "duration": (120.0, 100.0),
        "position_final.0": (1.0, None),
        "position_final.1": (2.0, None),
        "ended_by": (None, "surface"),
        "tracking.depth.error_rms": (None, 0.25),
    }
    assert merits({}, {}) == {}
    compared = replace(compare(coarse.dataset, coarse.dataset), merits=found)
    assert compared.summary()["mission"]["trial.period"] == [6.2, None]
    show(compared)
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["mission", "first", "second"] in rows and ["duration", "120", "100"] in rows


def test_the_command_reads_the_figures_of_both_folders(coarse, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name, period in (("a", 6.2), ("b", 4.7)):
        Path(name).mkdir()
        coarse.save(f"{name}/run.nc")
        Path(name, "summary.json").write_text(json.dumps({"mission": {"trial": {"period": period}}}))
    assert main(["compare", "a", "b", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["mission"] == {"trial.period": [6.2, 4.7]}


def test_angles_are_compared_within_half_a_turn(coarse):
    turned = coarse.dataset.copy(deep=True)
    turned["euler_angles"] = turned.euler_angles + 2 * np.pi
    assert compare(coarse.dataset, turned).largest["euler_angles"] < 1e-7


def test_attitudes_are_compared_by_the_angle_between_them(coarse):
    """Near pitch 90° yaw and roll differ by 1 rad, the attitudes by 0.01 rad."""
    one, other = coarse.dataset.copy(deep=True), coarse.dataset.copy(deep=True)
    one["euler_angles"][:] = [0.0, np.pi / 2, 0.0]
    other["euler_angles"][:] = [1.0, np.pi / 2, 1.01]
    assert compare(one, other).largest["euler_angles"] == pytest.approx(0.01)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("other", "words"),
    [
        (lambda: body(group=co.SE3()), r"is on SO3\(\), but second on SE3\(\)"),
        (lambda: body(dt=0.07, duration=0.63), "have 1 saved times in common"),
    ],
)
def test_runs_that_do_not_fit_are_refused(coarse, other, words):
    with pytest.raises(ArgumentError, match=words) as caught:
        compare(coarse.dataset, other().dataset)
    assert "\n" not in str(caught.value)


@pytest.mark.long
def test_the_command_compares_folders_and_draws_both(coarse, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    coarse.save("coarse.nc")
    body(dt=0.05).save("fine.nc")
    assert main(["compare", "coarse.nc", "fine.nc", "--out", "both"]) == 0
    assert "free body" in capsys.readouterr().out
    assert (tmp_path / "both" / "energy.png").exists()
    told = json.loads(Path("both/comparison.json").read_text())
    assert main(["compare", "coarse.nc", "fine.nc", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == told
    assert told["difference_final"]["mu"] > 0
    assert main(["compare", "coarse.nc", "nothing.nc"]) == 2
    assert "nothing.nc" in capsys.readouterr().err
    assert main(["compare", "coarse.nc", "fine.nc", "--out", "fine.nc"]) == 2
    said = capsys.readouterr()
    assert "The folder fine.nc cannot be made" in said.err
    assert said.out == ""


def test_variables_of_another_shape_are_of_another_system_and_ensembles_are_not_compared():
    """Also where the last of several numbers could be repeated over the others."""
    one, other = made_runs.dataset(11, pi=np.zeros((11, 1))), made_runs.dataset(11)
    with pytest.raises(ArgumentError, match=r"Variable `pi` has shape \(1,\) in a, but \(3,\) in b"):
        compare(one, other, ("a", "b"))
    assert compare(other, other).units["q"] == "m"
    with pytest.raises(ArgumentError, match="b holds an ensemble"):
        compare(other, other.expand_dims("member"), ("a", "b"))
    with pytest.raises(ArgumentError, match="have no state in common"):
        compare(other[["energy"]], other)
