"""Bodies on joints in motion, against closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.models.multibody import Joint, Mechanism
from mechanisms import (
    ARM,
    JOINTS,
    LEAN,
    MASS,
    MOMENTS,
    PITCH,
    RADIUS,
    THICK,
    THIN,
    TURNING,
    bricard,
    disk,
    gears,
    rod,
)

pytestmark = pytest.mark.long
G = 9.81


def after_a_second(kind: str, **start: Any) -> tuple[dict[str, float], np.ndarray]:
    """The coordinates of a joint between the ground and a rod ARM below it, and the rod's centre, after 1 s."""
    joint = Joint(kind, "ground", "rod", at=(0, 0, 0), **JOINTS[kind])
    made = Mechanism(bodies={"rod": rod(position=(0, 0, -ARM))}, joints={"joint": joint})
    run = co.simulate(made.system, made.state(**start), dt=0.005, duration=1.0, accuracy=False)
    assert run.extrema["constraint_gap"][1] < 1e-13
    turned = made.joint_data(run.records).isel(time=-1)
    return {str(name): float(turned[name]) for name in turned}, run.final.q


def test_a_body_on_a_guide_swings_on_its_spring() -> None:
    turned, _ = after_a_second("prismatic", coordinates={"joint": 0.2})
    rate, rest = np.sqrt(30.0 / MASS), -G * MASS / 30.0
    assert turned["joint"] == pytest.approx(rest + (0.2 - rest) * np.cos(rate), abs=1e-3)


def test_a_body_on_a_cylinder_falls_and_turns_freely() -> None:
    turned, _ = after_a_second("cylindrical", speeds={"joint": (3.0, 1.0)})
    assert turned["joint_angle"] == pytest.approx(3.0, abs=1e-3)
    assert turned["joint_distance"] == pytest.approx(1 - G / 2, abs=1e-9)


def test_a_nut_on_a_screw_falls_by_its_pitch_and_turns_more_than_once() -> None:
    turned, q = after_a_second("screw", speeds={"joint": -2.0})
    c = PITCH / (2 * np.pi)
    assert turned["joint"] == pytest.approx(-2 - 0.5 * G * MASS * c / (MOMENTS[2] + MASS * c**2), abs=1e-2)
    assert turned["joint"] < -2 * np.pi
    assert q == pytest.approx([0, 0, -ARM + c * turned["joint"]], abs=1e-12)


def test_a_body_in_a_plane_flies_on_a_parabola() -> None:
    _, q = after_a_second("planar", velocities={"rod": (1.0, 0.0, 2.0)})
    assert q == pytest.approx([1, 0, -ARM + 2 - G / 2], abs=1e-9)


def test_gears_turn_at_their_ratio_over_many_turns() -> None:
    pair = gears(20, 30, motor=True)
    start = pair.state(speeds={"one": 4.0})
    run = co.simulate(pair.system, start, dt=0.01, duration=4.0, inputs={"one": 0.7}, accuracy=False, monitors=False)
    turned = pair.joint_data(run.records)
    moment = MOMENTS[2] * (1 + (20 / 30) ** 2)
    assert turned.one.values[-1] == pytest.approx(4 * 4 + 0.5 * 0.7 / moment * 4**2, rel=1e-2)
    assert turned.one.values[-1] > 10 * 2 * np.pi
    assert turned.two.values == pytest.approx(-2 / 3 * turned.one.values, abs=1e-11)


def test_bricards_linkage_has_a_freedom_although_its_rows_are_as_many_as_its_velocities() -> None:
    linkage = bricard()
    assert sum(one.size for one in linkage.system.constraints) == 6 * len(linkage.bodies)
    assert linkage.freedoms(linkage.state()) == 1


def test_a_rolling_disk_stays_on_its_circle_to_second_order() -> None:
    spin = THIN * TURNING * np.cos(LEAN) - 2 * G * RADIUS / (TURNING * np.tan(LEAN))
    rates = np.array([0.0, TURNING * np.sin(LEAN), spin / (THICK + 2 * RADIUS**2)])
    wheel = disk()
    velocity = wheel.bodies["disk"].rotation @ np.cross(rates, [0, RADIUS, 0])
    start = wheel.state(rates={"disk": rates}, velocities={"disk": velocity})
    assert start.xi == pytest.approx(rates, abs=1e-13)
    assert wheel.freedoms(start) == 3
    arm, angle, off = RADIUS * rates[2] / TURNING, TURNING * 2.0, []
    for dt in (0.02, 0.01):
        run = co.simulate(wheel.system, start, dt=dt, duration=2.0, accuracy=False)
        circle = [-arm * np.sin(angle), start.q[1] - arm + arm * np.cos(angle), start.q[2]]
        off.append(np.linalg.norm(run.final.q - circle))
        assert run.extrema["constraint_gap"][1] < 1e-13 and run.extrema["constraint_rate"][1] < 1e-13
    assert np.log2(off[0] / off[1]) == pytest.approx(2, abs=0.1)
