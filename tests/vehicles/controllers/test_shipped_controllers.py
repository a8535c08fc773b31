"""Five shipped vehicles dive, turn and come up by their own controllers, whose gains nobody tuned."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint_vehicles import Craft
from coadjoint_vehicles.water import UniformWater

CURRENT = (0.05, 0.1, 0.0)
SPEEDS = {
    "remus_100": 1.5,
    "nps_auv_ii": 1.5,
    "bluerov2_heavy_von_benzon": 0.5,
    "rexrov": 0.6,
    "lrauv_tethys": 1.0,
}


@pytest.mark.long
@pytest.mark.cases(2)
@pytest.mark.parametrize("name", SPEEDS)
def test_five_vehicles_dive_turn_and_surface_by_their_own_controllers(name):
    vehicle, speed = vehicles.load(name), SPEEDS[name]
    legs = [0.0, 20.0, 120.0, 220.0]
    mission = {
        "depth": co.Held(legs, [1.0, 10.0, 10.0, 1.0]),
        "heading": co.Held(legs, np.radians([0.0, 0.0, 90.0, 90.0])),
        "speed": speed,
    }
    craft = Craft(vehicle, controller=vehicle.controller, water=UniformWater(CURRENT))
    start = craft.start(speed=speed, position=(0, 0, 1))
    run = co.simulate(craft.system, start, dt=0.05, duration=320.0, inputs=mission)
    assert run.plan.backend == "native"
    made = run.dataset
    depth, angles = made.q.values[:, 2], np.degrees(made.euler_angles.values)
    ahead = np.einsum("kji,kj->ki", made.R.values, made.qdot.values - CURRENT)[:, 0]
    for moment, wanted, course in ((119.0, 10.0, 0.0), (219.0, 10.0, 90.0), (319.0, 1.0, 90.0)):
        k = int(moment / 0.05)
        assert depth[k] == pytest.approx(wanted, abs=0.25 if name == "lrauv_tethys" else 0.05)
        assert angles[k, 0] == pytest.approx(course, abs=0.05)
        assert ahead[k] == pytest.approx(speed, rel=0.002)
    assert depth.max() < 10.7 and depth[int(220 / 0.05) :].min() > 0.3
    assert angles[:, 0].max() < 95.0 and np.abs(angles[:, 1]).max() < 32.0 and np.abs(angles[:, 2]).max() < 5.0
    assert run.summary()["energy_budget_error_max"] < 1e-3
    for part in vehicle.commanded:
        limit, moved = part.parameters().get("limit"), f"internal_{part.name}"
        if limit is not None and np.ndim(limit) == 0:
            assert np.abs(made[moved].values).max() <= limit + 1e-12
