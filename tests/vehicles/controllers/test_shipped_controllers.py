"""Five shipped vehicles dive, turn and come up by their own controllers, whose gains nobody tuned."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.kernels.trace.identity import identity
from coadjoint_vehicles import Craft
from coadjoint_vehicles.controllers import Cruise, LineOfSight, design
from coadjoint_vehicles.files.registry import vehicle_names
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


def test_gains_that_come_with_a_vehicle_are_used_and_ignored_once_it_is_changed(monkeypatch):
    def design_begins(*_):
        raise AssertionError("designed")

    monkeypatch.setenv("COADJOINT_CACHE", "")
    monkeypatch.setattr(design, "designed_gains", design_begins)
    vehicle: Any = vehicles.load("remus_100")
    points = np.array([[20.0, 0.0, 2.0], [40.0, 0.0, 2.0]])
    for controller in (vehicle.controller, dataclasses.replace(vehicle.controller)):  # missions take copies
        assert controller.fitted(vehicle).depth_gains[0] > 0
    assert LineOfSight(way_points=points).fitted(vehicle).helm.depth_gains[0] > 0
    heavier = dataclasses.replace(vehicle, mass=vehicle.mass + 1e-12)
    for controller, one in ((vehicle.controller, heavier), (Cruise(speed=1.4), vehicle)):
        with pytest.raises(AssertionError, match="designed"):
            controller.fitted(one)


def cruising() -> dict[str, Any]:
    """The vehicles that are shipped with a cruise controller, by name."""
    shipped = {name: vehicles.load(name) for name in vehicle_names()}
    return {name: one for name, one in shipped.items() if isinstance(one.controller, Cruise)}


def test_gains_come_with_every_vehicle_that_has_a_cruise_controller():
    """`python .ci/gains.py` writes them anew after a change of a vehicle or of the design."""
    digests: Any = {
        name: identity(*design.parts_of_design("cruise", one.controller, one)) for name, one in cruising().items()
    }
    assert {found.digest for found in digests.values()} == {*design.shipped_gains()}


@pytest.mark.long
@pytest.mark.cases(2)
@pytest.mark.parametrize(
    "name", ["kvlcc2", "lrauv_raanan", "lrauv_tethys", "nps_auv_ii", "remus_100", "remus_100_sgarioto"]
)
def test_gains_that_come_with_a_vehicle_are_those_that_are_designed_for_it(name: str):
    vehicle: Any = cruising()[name]
    known: Any = identity(*design.parts_of_design("cruise", vehicle.controller, vehicle))
    shipped, designed = (
        design.shipped_gains()[known.digest],
        design.designed_gains(vehicle.controller, vehicle),
    )
    assert shipped["names"] == designed["names"] and shipped["chosen"].keys() == designed["chosen"].keys()
    np.testing.assert_allclose(shipped["matrix"], designed["matrix"], rtol=1e-9, atol=1e-12)
    for key, value in designed["chosen"].items():
        np.testing.assert_allclose(shipped["chosen"][key], value, rtol=1e-9)
