"""A bottom on a grid in a mission: the altitude over it is in the dataset, and it ends the run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import coadjoint_vehicles as vehicles
from coadjoint.errors import CoadjointError

MISSION = """
[vehicle]
name = "remus_100"
[water.bottom]
file = "bottom.csv"
[mission]
depth_m = 5
heading_deg = 0
speed_m_s = 1.5
ends = "bottom"
clearance_m = 1
[initial]
position_m = [0, 0, 5]
speed_m_s = 1.5
[run]
dt = 0.05
duration = 20
[output]
figures = false
"""


@pytest.mark.long
def test_a_mission_ends_over_a_rising_bottom_and_knows_its_altitude(tmp_path: Path) -> None:
    """d = 8 − 0.1 n: 1 m above it at n ≈ 20 m, at a depth of about 5 m."""
    rows = [f"{n},{e},{8 - 0.1 * n!r}" for n in range(-10, 61, 10) for e in (-50, 50)]
    (tmp_path / "bottom.csv").write_text("north,east,depth\n" + "\n".join(rows) + "\n")
    (tmp_path / "mission.toml").write_text(MISSION)
    run = vehicles.load_mission(tmp_path / "mission.toml").run()
    q, altitude = run.dataset.q.values, run.dataset.altitude.values
    np.testing.assert_allclose(altitude, 8 - 0.1 * q[:, 0] - q[:, 2], atol=1e-9)
    assert run.event is not None and altitude[-1] == pytest.approx(1.0, abs=1e-6)


def test_a_bottom_that_is_not_there_has_a_sentence(tmp_path: Path) -> None:
    for text, expected in (
        (MISSION, "bottom.csv"),
        (MISSION.replace('[water.bottom]\nfile = "bottom.csv"\n', ""), "there is none"),
        (MISSION.replace("file =", "flie ="), "needs file"),
    ):
        (tmp_path / "mission.toml").write_text(text)
        with pytest.raises(CoadjointError, match=expected):
            _ = vehicles.load_mission(tmp_path / "mission.toml").setup
