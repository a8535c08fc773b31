"""Faults of mission files: they come when they should, stand on the card, and mistakes have a sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import coadjoint_vehicles as vehicles
from coadjoint.errors import ArgumentError

MISSION = """
[vehicle]
name = "remus_100"
[mission]
depth_m = 5
heading_deg = 0
speed_m_s = 1.5
[initial]
position_m = [0, 0, 5]
speed_m_s = 1.5
[run]
dt = 0.05
duration = 4
[output]
figures = false
"""


def written(folder: Path, faults: str) -> Path:
    path = folder / "mission.toml"
    path.write_text(MISSION + faults)
    return path


@pytest.mark.long
def test_a_rudder_that_sticks_turns_the_vehicle_and_stands_on_the_card(tmp_path: Path) -> None:
    fault = '[faults.stuck_rudder]\npart = "rudder"\nstuck_deg = 10\ntime_s = 2\n'
    mission = vehicles.load_mission(written(tmp_path, fault))
    run = mission.run()
    rudder = run.dataset.internal_rudder.values
    np.testing.assert_allclose(rudder[40:], np.radians(10.0), rtol=1e-14)
    assert np.all(np.abs(rudder[:39]) < np.radians(5.0)) and run.final.xi[2] > 0.02
    assert any("From t = 2 s on, fault `stuck_rudder` of rudder: stuck_deg = 10" in line for line in run.warnings)


@pytest.mark.long
def test_a_fault_by_depth_that_does_not_come_is_told(tmp_path: Path) -> None:
    fault = '[faults.screw]\npart = "propeller"\nout = true\ndepth_m = 50\n'
    run = vehicles.load_mission(written(tmp_path, fault)).run()
    assert any("did not come" in line for line in run.warnings)


WRONG = {
    '[faults.a]\npart = "ruder"\nstuck = true\ntime_s = 1': "did you mean",
    '[faults.a]\npart = "rudder"\ntime_s = 1': "needs one of `stuck`",
    '[faults.a]\npart = "rudder"\nstuck = true\nout = true\ntime_s = 1': "needs one of `stuck`",
    '[faults.a]\npart = "rudder"\nstuck = true': "needs one of `time_s` and `depth_m`",
    '[faults.a]\npart = "rudder"\nstuck = true\ntime_m = 1': "time",
    '[faults.a]\npart = "rudder"\nstuck_deg = 90\ntime_s = 1': "the range",
    '[faults.a]\npart = "rudder"\nstuck_rpm = 3\ntime_s = 1': "stuck_rpm is in 1/s, but rudder stands in rad",
    '[faults.a]\npart = "rudder"\nstuck = false\ntime_s = 1': "must be a number, or true",
    '[faults.a]\npart = "rudder"\nstuck = "hard"\ntime_s = 1': "must be a number, or true",
    '[faults.a]\npart = "rudder"\ndropped = true\ntime_s = 1': "of a payload",
    '[faults.a]\npart = "rudder"\nout = 0\ntime_s = 1': "the numbers of thrusters from 1",
    '[faults.a]\npart = "rudder"\nstukc = true\ntime_s = 1': "did you mean",
    "[faults]\nrudder = 1": "holds tables",
}


@pytest.mark.parametrize("fault", WRONG)
def test_a_wrong_fault_has_a_sentence(fault: str, tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=WRONG[fault]):
        _ = vehicles.load_mission(written(tmp_path, fault + "\n")).setup
