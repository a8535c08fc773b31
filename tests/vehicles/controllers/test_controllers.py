"""Controllers fly: torpedo shapes with cross and X tails, by gains that are proposed from their mass, damping and
fins.
"""

from __future__ import annotations

import dataclasses
from functools import cache
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint_vehicles import Craft, Vehicle
from coadjoint_vehicles.controllers import design
from coadjoint_vehicles.controllers.allocation import allocation
from coadjoint_vehicles.controllers.cruise import Cruise
from coadjoint_vehicles.controllers.pid import pid
from coadjoint_vehicles.files.file import vehicle_from_text
from coadjoint_vehicles.files.registry import vehicle_text
from coadjoint_vehicles.parts import Fin
from coadjoint_vehicles.trim.under_way import under_way
from coadjoint_vehicles.water import UniformWater
from remus import remus

DT = 0.05
KEPT = ("depth", "heading", "speed")


def x_tail() -> Vehicle:
    """REMUS with four fins of half the area, slanted by 45°, in place of its two pairs."""
    rudder: Any = remus().part("rudder")
    fins = {**{key: getattr(rudder, key) for key in ("lift_slope", "stall", "limit", "lag")}, "area": rudder.area / 2}
    slanted = []
    for k, angle in enumerate(np.radians([45, 135, 225, 315])):
        out, across = np.array([0, np.cos(angle), np.sin(angle)]), np.array([0, -np.sin(angle), np.cos(angle)])
        slanted.append(Fin(f"fin_{k}", position=0.13 * out + rudder.position, normal=across, **fins))
    plain = remus()
    parts = [part for part in plain.parts if not isinstance(part, Fin)]
    return dataclasses.replace(plain, name="X-tail", parts=(*parts, *slanted))


def fly(vehicle, controller, duration, *, water=None, start=None, **signals):
    craft = Craft(vehicle, controller=controller, water=water)
    inputs = {
        name: co.Held(*signal) if isinstance(signal, tuple) else co.Held([0.0], [signal])
        for name, signal in signals.items()
    }
    begin = craft.start(**{"speed": 1.5, "actuators": {"propeller": 15.0}, **(start or {})})
    run = co.simulate(craft.system, begin, dt=DT, duration=duration, inputs=inputs)
    assert run.plan.backend == "native"
    return run


STEP: dict[str, Any] = {
    "depth": ([0.0, 20.0], [0.0, 8.0]),
    "heading": ([0.0, 100.0], [0.0, 1.0]),
    "speed": ([0.0, 160.0], [1.5, 1.8]),
}
VEHICLES = {"cross": remus(), "x": x_tail()}


@cache
def proposed(name: str) -> Cruise:
    """The controller with the gains that it proposes for a vehicle."""
    return Cruise(speed=1.5).fitted(VEHICLES[name])


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("tail", VEHICLES)
def test_steps_of_depth_heading_and_speed_settle_with_little_overshoot_by_the_proposed_gains(tail):
    """Only an X-tail takes the heel away that the propeller's torque gives."""
    run = fly(VEHICLES[tail], proposed(tail), 240.0, water=UniformWater((0.1, 0.2, 0.0)), **STEP)
    made = run.dataset
    through = np.einsum("kji,kj->ki", made.R.values, made.qdot.values - [0.1, 0.2, 0.0])
    depth, heading, speed = made.q.values[:, 2], made.euler_angles.values[:, 0], through[:, 0]
    assert depth[-1] == pytest.approx(8.0, abs=0.02) and depth.max() < 8.0 * 1.06
    assert heading[-1] == pytest.approx(1.0, abs=1e-3) and heading.max() < 1.0 * 1.06
    assert speed[-1] == pytest.approx(1.8, abs=5e-3) and speed[int(160 / DT) :].max() < 1.8 + 0.3 * 0.06
    heel = np.abs(made.euler_angles.values[:, 2])
    assert heel.max() < np.radians(5.0)
    assert heel[int(99 / DT)] > 5e-3 if tail == "cross" else heel[int(99 / DT)] < 5e-4


@pytest.mark.long
def test_the_allocation_of_an_x_tail_turns_about_one_axis_and_about_no_other():
    motion, mixed = under_way(VEHICLES["x"], 1.5), proposed("x").allocation
    assert mixed is not None
    turns = motion.effects[3:] @ mixed.matrix[:, :3]
    np.testing.assert_allclose(turns - np.diag(np.diag(turns)), 0, atol=1e-9 * np.abs(turns).max())
    assert np.all(np.diag(turns) > 0) and np.abs(mixed.matrix).max() == pytest.approx(1.0)


@pytest.mark.filterwarnings("error")
def test_a_mode_that_stays_is_not_damped_and_depth_needs_gains_of_pitch():
    assert design.damping_ratio(np.diag([0.0, -1.0])) == 0.0
    motion = under_way(co.vehicles.load("remus_100"), 1.5)
    mixed = allocation(motion)
    gains = {pitch: design.diving(motion, mixed, np.array([pitch, 0.0, 2 * pitch]), 0.2) for pitch in (0.0, 1.0)}
    assert not gains[0.0].any() and gains[1.0][0] > 0.01
    no_gain = np.zeros(3)
    np.testing.assert_array_equal(design.damped(motion, mixed, "heading", no_gain, 0.2), no_gain)


def test_pitch_and_heading_have_the_poles_that_their_gains_are_placed_for():
    """k_p = (ω² + a_θ)/b, k_d = (2ζω + a_q)/b: s² + (b k_d − a_q)s + b k_p − a_θ has frequency ω and damping ζ."""
    turn = design.Turn(rate=-0.5, stiffness=0.4, effect=3.0)
    k_p, _, k_d = design.placed(turn, 0.8, 10.0)
    poles = np.roots([1, 3.0 * k_d + 0.5, 3.0 * k_p - 0.4])
    np.testing.assert_allclose(np.abs(poles), 0.8, rtol=1e-12)
    np.testing.assert_allclose(-poles.real / np.abs(poles), design.DAMPING_RATIO, rtol=1e-12)


def test_a_round_hull_turns_alike_in_pitch_and_heading_and_the_munk_moment_turns_it_away():
    """Without its weight's righting torque; and without fins the torque by slip is Munk's, (Y_v̇ − X_u̇) U w."""
    plain = remus()
    round_hull = remus(center_of_mass=(0, 0, 0), parts=[part for part in plain.parts if part.name != "damping"])
    motion = under_way(round_hull, 1.5)
    pitch, heading = (design.turning(motion, allocation(motion), axis) for axis in ("pitch", "heading"))
    np.testing.assert_allclose(pitch, heading, rtol=1e-9)
    bare = remus(center_of_mass=(0, 0, 0), parts=[part for part in plain.parts if part.name in ("hull", "propeller")])
    motion = under_way(bare, 1.5)
    M = motion.mass
    assert motion.damping[4, 2] == pytest.approx((M[2, 2] - M[0, 0]) * 1.5, rel=1e-9)
    assert motion.damping[5, 1] == pytest.approx(-(M[1, 1] - M[0, 0]) * 1.5, rel=1e-9)


@pytest.mark.long
def test_an_integral_does_not_wind_up_while_its_controller_is_saturated():
    """Half a minute of the largest pitch: an integral that wound up would take the vehicle 9.5 m too deep."""
    made = fly(VEHICLES["cross"], proposed("cross"), 200.0, depth=60.0, heading=0.0, speed=1.5).dataset
    assert 60.0 < made.q.values[:, 2].max() < 60.4 and abs(made.q.values[-1, 2] - 60.0) < 0.1


def test_pid_saturates_about_what_is_known_beforehand_and_between_its_own_limits():
    u, I = evaluate(lambda e: pid((2.0, 1.0, 0.0), e, 0.0, 0.5, 0.1, 1.0, base=0.4, low=0.0), np.float64(-0.1))
    assert (u, I) == (pytest.approx(0.4 - 0.2 + 0.49), pytest.approx(0.49))
    u, I = evaluate(lambda e: pid((2.0, 1.0, 0.0), e, 0.0, 0.5, 0.1, 1.0, base=0.4, low=0.0), np.float64(-2.0))
    assert (u, I) == (0.0, 0.5)


@pytest.mark.long
def test_an_altitude_is_kept_over_a_flat_bottom():
    controller = dataclasses.replace(proposed("cross"), vertical="altitude", bottom=20.0)
    made = fly(VEHICLES["cross"], controller, 80.0, altitude=14.0, heading=0.0, speed=1.5).dataset
    assert made.q.values[-1, 2] == pytest.approx(6.0, abs=0.1)


@pytest.mark.long
def test_a_controller_that_only_damps_a_turn_has_finite_numbers():
    controller: Any = Cruise(heading_gains=(0.0, 0.0, 0.5)).fitted(VEHICLES["cross"])
    assert controller.heading_reach == np.pi and controller.pitch_reach < 1.0


@pytest.mark.long
def test_a_longer_period_and_delay_take_damping_away():
    """The same gains by a slower computer: the heading swings further beyond its set point."""
    craft = Craft(VEHICLES["cross"], controller=proposed("cross"))
    start, beyond = craft.start(speed=1.5, actuators={"propeller": 15.0}), []
    for period, delay in ((0.1, 0.0), (0.6, 0.6)):
        slower = craft.system.replace(controller={"period": period, "delay": delay})
        made = co.simulate(slower, start, dt=DT, duration=40.0, inputs={"depth": 0.0, "heading": 0.3, "speed": 1.5})
        beyond.append(float(made.dataset.euler_angles.values[:, 0].max()) - 0.3)
    assert beyond[1] > beyond[0] + 0.01


FILE = """
[controller]
kind = "cruise"
vertical = "altitude"
bottom = { value = 20, unit = "m" }
period = { value = 200, unit = "ms" }
heading_gains = { value = [0.9, 0.01, 0.4], unit = "SI" }
heading_reach = { value = 10, unit = "deg" }
"""


@pytest.mark.long
def test_a_controller_in_a_vehicle_file_has_the_gains_that_it_gives_and_proposes_the_others():
    text = vehicle_text("remus_100")
    vehicle = vehicle_from_text(text[: text.index("[controller]")] + FILE, "mine.toml")
    controller: Any = Craft(vehicle, controller=vehicle.controller).controller
    assert (controller.vertical, float(controller.period), float(controller.bottom)) == ("altitude", 0.2, 20.0)
    np.testing.assert_allclose(controller.heading_gains, [0.9, 0.01, 0.4])
    assert controller.heading_reach == pytest.approx(np.radians(10)) and controller.pitch_gains[0] > 0


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"depth_gains": (1.0, 2.0)}, "depth_gains"),
        ({"period": 0.0}, "period"),
        ({"delay": 0.3}, "at most the period"),
        ({"vertical": "up"}, "vertical"),
        ({"vertical": "altitude"}, "bottom"),
        ({"speed": 9.0}, "cannot go 9 m/s"),
    ],
)
def test_controllers_that_cannot_be_are_refused_with_a_sentence(fields, sentence):
    with pytest.raises(ArgumentError, match=sentence):
        Cruise(**fields).fitted(VEHICLES["cross"])
