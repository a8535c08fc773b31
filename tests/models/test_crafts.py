"""Crafts: vehicles put together from parts, with pilots in water that moves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.models.underwater import (
    REMUS_100,
    Craft,
    Damping,
    Fin,
    Hull,
    Propeller,
    UniformWater,
    Vehicle,
    remus_100,
    remus_start,
)

CURRENT = (0.1, 0.2, -0.05)
P: dict[str, Any] = REMUS_100


def remus(**changes: Any) -> Vehicle:
    fins = {
        "area": P["fin_area"],
        "lift_slope": P["fin_lift_slope"],
        "stall": P["fin_stall"],
        "limit": P["fin_limit"],
        "lag": P["fin_lag"],
        "position": (P["fin_position"], 0, 0),
    }
    hull = {"axial_drag": 0.42, "axial_area": np.pi / 4 * 0.19**2, "crossflow_drag": 1.1}
    parts = (
        Damping("damping", linear=P["damping"], fading=P["fading"]),
        Hull("hull", **hull, width=0.19, height=0.19, length=1.6),
        Fin("stern_planes", normal=(0, 0, 1), **fins),
        Fin("rudder", normal=(0, 1, 0), **fins),
        Propeller(
            "propeller",
            diameter=0.14,
            thrust=P["thrust"],
            torque=P["torque"],
            thrust_deduction=0.1,
            wake_fraction=1 - P["advance"],
            torque_fraction=0.1,
            limit=P["revolutions_limit"],
            lag=1.0,
        ),
    )
    body = {key: P[key] for key in ("mass", "inertia", "added_mass", "center_of_mass")}
    return Vehicle(**{"name": "REMUS 100", **body, "parts": parts, **changes})


def test_remus_by_parts_feels_the_forces_of_the_shipped_one_and_moves_as_it_does():
    craft, shipped = Craft(remus(), water=UniformWater(CURRENT)), remus_100(automatic=False)
    attitude = (0.3, 0.2, 0.1)
    moved = {"rudder": 0.1, "stern_planes": 0.02}
    start = craft.start(speed=1.5, euler_zyx=attitude, actuators={**moved, "propeller": 15.0})
    begun = remus_start(shipped, speed=1.5, euler_zyx=attitude, current=CURRENT, revolutions=15.0, **moved)
    one, other = (co.simulate(s, at, dt=0.05, duration=60.0) for s, at in ((craft.system, start), (shipped, begun)))
    assert one.plan.backend == "native"
    np.testing.assert_allclose(one.dataset.q, other.dataset.q, atol=1e-11)
    np.testing.assert_allclose(one.dataset.R, other.dataset.R, atol=1e-12)
    for name in ("damping", "hull", "stern_planes", "rudder", "propeller"):
        work, expected = one.dataset[f"work_{name}"].values, other.dataset[f"work_{name}"].values
        np.testing.assert_allclose(work, expected, atol=1e-11 * np.max(np.abs(expected)))


def test_inputs_of_the_names_of_parts_command_them_and_other_parts_stay():
    craft = Craft(remus())
    start = craft.start(speed=1.5, actuators={"propeller": 15.0, "rudder": 0.03})
    run = co.simulate(craft.system, start, dt=0.05, duration=2.0, inputs={"stern_planes": co.Held([0.0], [1.0])})
    t = run.dataset.time.values
    limit = P["fin_limit"]
    np.testing.assert_allclose(run.dataset.internal_stern_planes, limit * (1 - np.exp(-t / 0.1)), atol=1e-13)
    assert np.all(run.dataset.internal_rudder == 0.03) and np.all(run.dataset.internal_propeller == 15.0)


def test_a_function_of_what_a_pilot_sees_steers():
    def pilot(sight, p):
        return {"rudder": 1.2 * (sight.inputs.heading - sight.heading) - sight.omega[2]}

    craft = Craft(remus(), pilot=pilot)
    start = craft.start(speed=1.5, actuators={"propeller": 12.0})
    run = co.simulate(craft.system, start, dt=0.05, duration=60.0, inputs={"heading": co.Held([0.0], [0.5])})
    assert run.dataset.euler_angles[-1, 0] == pytest.approx(0.5, abs=1e-3)
    assert np.all(run.dataset.internal_propeller == 12.0)
