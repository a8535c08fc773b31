"""The script of a glider's log finds mass and drag of a log in the same format that is drawn from a known glider."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from coadjoint.estimation import ModelProcess, RandomWalk
from coadjoint_vehicles.water import DensityTable

sys.path.insert(0, str(Path(__file__).parents[2] / "docs" / "figures"))
import glider_log  # pyright: ignore[reportMissingImports]

WATER = DensityTable([0.5, 20.5, 41.5], [1004.5, 1005.5, 1007.0])


def written(path: Path, mass: float, drag: float) -> Path:
    """Four hundred seconds down and up at 1 Hz, with the noise of the sensors, and the exact speed as that of a DVL."""
    one, random = glider_log.craft(WATER, mass, drag), np.random.default_rng(4)
    start = one.start(position=(0, 0, 3.0), velocity=(0.3, 0, 0.03), euler_zyx=(0, -0.38, 0))
    process = ModelProcess(
        one.system, start, inputs={"pump": -230e-6}, drifting={"center_of_mass": RandomWalk([1e-5, 0, 0])},
        noise={"torque": [0, 0.02, 0], "force": [0.05, 0, 0.05]},
    )  # fmt: skip
    rows, pumped, shift = [process.example[None]], [-230e-6], -3
    for k in range(400):
        pumped.append(-230e-6 if k < 200 else 230e-6)
        last = process.with_inputs(rows[-1], {"pump": pumped[-1]})
        last[:, shift] = 2e-3 * (1 if k < 200 else -1)
        rows.append(process.drawn(last, 1.0, random))
    states = process.state(np.concatenate(rows))
    depth = states.q[:, 2] + 0.05 * random.normal(size=401)
    pitch = np.arcsin(-states.g[:, 2, 0]) + 0.005 * random.normal(size=401)
    density = np.interp(states.q[:, 2], [0.5, 20.5, 41.5], [1004.5, 1005.5, 1007.0])
    bar = depth * density.mean() * 9.81 / 1e5
    squeezed = glider_log.VOLUME * glider_log.COMPRESSIBILITY * 1e5 * bar
    rows_of_file = 1e9 + np.arange(401.0), bar, pitch, 1e6 * (np.array(pumped) + squeezed), density
    np.save(path, np.stack([*rows_of_file, np.linalg.norm(states.nu, axis=1)]))
    return path


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("mass", "drag"), [(70.04, 0.17), (70.12, 0.13)])
def test_mass_and_drag_of_a_log_are_those_of_its_glider(mass: float, drag: float, tmp_path: Path) -> None:
    log, _ = glider_log.read(written(tmp_path / "log.npy", mass, drag))
    found = glider_log.filtered(log, WATER, (-1.0, 1e4), 0.05)
    for value, truth, size in ((found.mass, mass, 0.01), (found.drag, drag, 0.01)):
        assert abs(value[-1, 0] - truth) < 4 * value[-1, 1] < 4 * size
    assert np.std(glider_log.off(found)) < 0.01 and abs(glider_log.off(found).mean()) < 0.005


def test_steady_glides_carry_their_net_weight() -> None:
    """Lift and drag along and across a path that is steeper than the pitch by the angle of attack."""
    pitch, net, drag, induced, lift = 0.38, 2.0, 8.0, 500.0, 370.0
    speed = glider_log.glide(pitch, net, drag, induced, lift)
    angles = np.linspace(0.0, 0.2, 2001)
    across, along = lift * angles * speed**2, (drag + induced * angles**2) * speed**2
    up = across * np.cos(pitch + angles) + along * np.sin(pitch + angles)
    ahead = across * np.sin(pitch + angles) - along * np.cos(pitch + angles)
    k = int(np.argmin(np.abs(ahead)))
    assert up[k] == pytest.approx(net, rel=1e-3)


def test_glides_are_averaged_where_the_glider_neither_turns_nor_surfaces() -> None:
    depth = np.array([5.0, 20.0, 30.0, 30.0, 36.0])
    pitch, speed = np.array([-0.4, -0.4, 0.4, 0.1, 0.38]), np.array([0.9, 0.3, 0.28, 0.7, np.nan])
    pump = 70.1 / 1005.0 - glider_log.VOLUME + np.array([0.0, -2e-4, 2e-4, 0.0, 0.0])
    log = glider_log.Log(np.arange(5.0), depth, pitch, pump, speed)
    found = glider_log.steady(log, DensityTable([0.0, 50.0], [1005.0, 1005.0]))
    assert found == pytest.approx((0.4, 9.81 * 1005.0 * 2e-4, 0.29))
