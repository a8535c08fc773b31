"""Section 5 of the paper: its numbers, its figures, and a report that says what was measured."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from coadjoint.errors import FileError
from coadjoint.report.reproduce import reproduce
from coadjoint.report.reproduction import FIGURES, Reproduction, compute
from coadjoint.report.text import report
from coadjoint.simulation.saved import load

KEYS = {
    "steps", "dt", "energy_initial", "energy_error_max", "energy_error_final", "kelvin_noether_initial",
    "kelvin_noether_error_max", "balance_residual_max", "group_defect_max", "newton_iterations_mean",
    "position_final", "angular_velocity_final", "seconds",
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reproduction") / "paper"
    reproduce(folder, progress=False)
    return folder


@pytest.fixture(scope="module")
def summary(folder):
    return json.loads((folder / "summary.json").read_text())


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["cayley", "exponential"])
def test_the_paper_run_conserves_what_the_paper_says(summary, name):
    run = summary[name]
    assert set(run) >= KEYS
    assert (run["steps"], run["dt"]) == (50_000, 0.01)
    assert 4.2e-4 <= run["energy_error_max"] <= 4.4e-4
    assert summary[f"{name}_half_step"]["energy_error_max"] == pytest.approx(run["energy_error_max"] / 2, rel=5e-3)
    assert run["kelvin_noether_error_max"] <= 3e-11
    assert run["balance_residual_max"] <= 1e-13
    assert run["newton_residual_max"] <= 1e-14
    assert run["group_defect_max"] <= 1e-12
    assert run["energy_initial"] == pytest.approx(58.77204288383771, rel=1e-12)


@pytest.mark.long
def test_the_midpoint_rule_loses_less_energy_at_the_same_step(summary):
    assert summary["midpoint"]["energy_error_max"] <= 3e-7
    assert summary["midpoint"]["kelvin_noether_error_max"] <= 6e-11


@pytest.mark.long
def test_figures_trajectories_and_report_are_written(folder, summary):
    names = {path.name for path in folder.iterdir()}
    runs = {"cayley.nc", "exponential.nc", "midpoint.nc"}
    assert names == {*FIGURES.values(), *runs, "report.md", "manifest.json", "run.toml", "summary.json"}
    saved = load(folder / "cayley.nc").dataset
    assert saved.sizes["time"] == 50_001
    assert np.array_equal(saved.q.values[-1], summary["cayley"]["position_final"])
    assert np.array_equal(saved.xi_step.values[-1], summary["cayley"]["angular_velocity_final"])


@pytest.mark.long
def test_the_report_quotes_what_was_measured(folder, summary):
    text = (folder / "report.md").read_text()
    assert "the paper's run." in text
    for name in ("cayley", "exponential"):
        assert f"{summary[name]['energy_error_max']:.3e}" in text
        assert f"{summary[name]['kelvin_noether_error_max']:.1e}" in text
    assert "first order in h" in text
    assert "first dives" in text
    for figure in re.findall(r"\]\((.*?\.png)\)", text):
        assert (folder / figure).stat().st_size > 10_000


@pytest.mark.long
def test_a_second_reproduction_into_the_folder_finds_the_first(folder):
    assert reproduce(folder) is None
    with pytest.raises(FileError, match="another run"):
        reproduce(folder, duration=1.0, overwrite=True)


@pytest.fixture(scope="module")
def short():
    return compute(duration=2.0, progress=False)


@pytest.mark.long
def test_a_short_one_is_written_and_says_that_it_is_not_the_papers(short, tmp_path, monkeypatch):
    monkeypatch.setattr("coadjoint.report.reproduce.compute", lambda *_: short)
    monkeypatch.setattr("coadjoint.report.reproduce.draw", lambda *_: None)
    assert reproduce(tmp_path / "short", duration=2.0) is short
    assert "NOT the paper's run" in (tmp_path / "short" / "report.md").read_text()
    written = json.loads((tmp_path / "short" / "summary.json").read_text())
    assert written["midpoint"]["energy_error_max"] < 1e-2 * written["cayley"]["energy_error_max"]
    assert written["cayley"]["steps"] == 200 and load(tmp_path / "short" / "cayley.nc").dataset.sizes["time"] == 201


def test_the_explanation_is_given_up_where_the_runs_do_not_show_it(short):
    found = short
    equal = Reproduction({**found.runs, "cayley_half_step": found.runs["cayley"]})
    text = report(equal)
    assert "do not determine the cause: the error does not halve with h" in text
    assert "NOT the paper's run" in text
    unsolved = replace(found.runs["cayley"].position, extrema={**found.runs["cayley"].extrema})
    unsolved.extrema["newton_residual"] = (np.zeros(()), np.asarray(1e-3))
    loose = replace(found.runs["cayley"], position=unsolved)
    assert "not solved to round-off" in report(Reproduction({**found.runs, "cayley": loose}))
