"""Missions from Python, without the command line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import coadjoint_vehicles as vehicles
from coadjoint.errors import ArgumentError

SQUARE = Path(__file__).parents[3] / "examples" / "square.toml"
SHORT = ("run.duration_min=", "run.duration=5")


@pytest.mark.long
def test_a_mission_runs_from_python_and_is_what_the_command_writes(tmp_path: Path) -> None:
    mission = vehicles.load_mission(SQUARE, SHORT)
    run = mission.run()
    assert run.dataset.attrs["way_points"][:3] == [60.0, 0.0, 3.0]
    written = mission.write(tmp_path / "square")
    assert np.array_equal(run.dataset.q, written.run.dataset.q)
    assert {"summary.json", "trajectory.nc", "trajectory.csv", "mission.png"} <= {
        p.name for p in written.folder.iterdir()
    }


@pytest.mark.long
def test_a_mission_needs_no_command_line() -> None:
    code = (
        "import sys, coadjoint as co\n"
        f"run = co.vehicles.load_mission({str(SQUARE)!r}, {SHORT!r}).run()\n"
        "assert run.good_steps == 100\n"
        "assert not [name for name in sys.modules if name.startswith('coadjoint.cli') or name == 'tyro']\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_run_file_of_no_vehicle_is_no_mission(tmp_path: Path) -> None:
    file = tmp_path / "top.toml"
    file.write_text('[system]\nmodel = "heavy_top"\n[run]\ndt = 0.01\nsteps = 2\n')
    with pytest.raises(ArgumentError, match=r"needs a section \[vehicle\]"):
        vehicles.load_mission(file)
