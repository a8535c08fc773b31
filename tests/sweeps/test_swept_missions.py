"""Sweeps of missions: numbers with units, parts of arrays, random currents."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.program import Code
from coadjoint.runs.run_file import read
from coadjoint.runs.running import simulate
from coadjoint.sweeps.file import Sweep, of_tables, table_of
from coadjoint.sweeps.task import Task, _part, ensemble

MISSION = """
[vehicle]
name = "ellipsoid"
[water]
kind = "gauss_markov"
deviation_m_s = [0.1, 0.1, 0.0]
correlation_time_s = 20
[controller]
kind = "none"
[initial]
position_m = [0, 0, 5]
speed_m_s = 1.0
[run]
dt = 0.1
duration_s = 2
"""


def swept(folder: Path, vary: dict, **own) -> Sweep:
    file = folder / "drift.toml"
    file.write_text(MISSION)
    own = {"run": "drift.toml", "sampling": "random", "members": 6, **own}
    table = {"sweep": {key: value for key, value in own.items() if value is not None}, "vary": vary}
    return of_tables(table, table_of(file, "mission file"), file, {})


VARY = {
    "parameters": {"mass_kg": {"from": 100.0, "to": 140.0}},
    "initial": {"position_m": [0, 0, {"from": 4.0, "to": 9.0}], "heading_deg": {"from": 0.0, "to": 90.0}},
}


def run(sweep: Sweep, members: slice, quick: bool = True) -> co.State:
    numbers = np.arange(sweep.members)[members]
    made = ensemble(sweep, sweep.rows(members), numbers, quick, 10)
    from coadjoint.simulation.execution import execute

    return execute(made, False, 0.0).final


@pytest.mark.long
def test_a_member_swims_the_mission_with_its_numbers(tmp_path, monkeypatch):
    monkeypatch.setattr("test_swept_missions.MISSION", MISSION.replace('"gauss_markov"', '"uniform"').replace(
        "deviation_m_s = [0.1, 0.1, 0.0]\ncorrelation_time_s = 20", "velocity_m_s = [0.1, 0.0, 0.0]"))  # fmt: skip
    sweep = swept(tmp_path, VARY)
    found, rows = run(sweep, slice(0, 6)), sweep.rows(slice(0, 6))
    mass, depth, heading = (float(values[4]) for values in rows.values())
    changes = [f"parameters.mass_kg={mass}", f"initial.position_m=[0,0,{depth}]", f"initial.heading_deg={heading}"]
    file = read(tmp_path / "drift.toml", changes)
    alone = simulate(file, file.set_up(), False).final
    np.testing.assert_allclose(found.q[4], alone.q, rtol=1e-10)
    np.testing.assert_allclose(found.g[4], alone.g, rtol=1e-9, atol=1e-12)


@pytest.mark.long
def test_random_currents_belong_to_members_and_not_to_tasks(tmp_path):
    sweep = swept(tmp_path, VARY)
    whole, part = run(sweep, slice(0, 6)), run(sweep, slice(3, 6))
    assert np.array_equal(whole.q[3:], part.q)
    other = run(swept(tmp_path, VARY, seed=1), slice(3, 6))
    assert not np.allclose(other.internal.water.z, part.internal.water.z)
    assert len({*whole.internal.water.z[:, 0].tolist()}) == 6


@pytest.mark.long
def test_members_set_up_alone_are_those_set_up_together(tmp_path):
    sweep = swept(tmp_path, VARY)
    whole, alone = run(sweep, slice(0, 3)), run(sweep, slice(2, 3), quick=False)
    np.testing.assert_allclose(alone.q[0], whole.q[2], rtol=1e-12)


@pytest.mark.long
def test_a_member_whose_steps_fail_has_nan_and_a_code_and_the_others_go_on(tmp_path):
    sweep = swept(tmp_path, {"initial": {"speed_m_s": {"values": [1.0, 1e160, 2.0]}}}, sampling="list", members=None)
    task = Task("", "", 0, 0, sweep.rows(slice(0, 3)), 3, 10, ("q", "euler_angles"), True, {}, 3, {})
    (piece,) = _part(sweep, task, np.arange(3))
    assert piece.run.codes.tolist() == [0, Code.NOT_FINITE, 0]
    found = piece.reduction.results(piece.run.codes != 0)
    assert np.isnan(found["final_euler_angles"]).all(axis=1).tolist() == [False, True, False]
    alone = _part(sweep, replace(task, rows=sweep.rows(slice(2, 3)), first=2, count=1), np.arange(1))[0]
    for name, values in alone.reduction.results(alone.run.codes != 0).items():
        assert np.array_equal(values[0], found[name][2])


@pytest.mark.long
def test_a_refused_member_is_told_without_its_number_within_the_task(tmp_path):
    varied = {"mass_kg": {"values": [120.0, -1.0]}, "volume": {"values": [0.12, 0.13]}}
    sweep = swept(tmp_path, {"parameters": varied}, sampling="list", members=None)
    task = Task("", "", 0, 0, sweep.rows(slice(0, 2)), 2, 10, ("q",), True, {}, 2, {})
    (told,) = [piece.refusal for piece in _part(sweep, task, np.arange(2)) if piece.refusal]
    assert told.startswith("Argument `mass`")


def test_a_mission_with_members_of_its_own_is_refused(tmp_path):
    file = tmp_path / "fleet.toml"
    file.write_text(MISSION.replace("dt = 0.1", "dt = 0.1\nmembers = 3") + '[perturb]\nmass = "2 %"\n')
    with pytest.raises(co.errors.ArgumentError, match="must be of one member"):
        of_tables({"vary": VARY}, table_of(file, "mission file"), file, {})
