"""Crafts: vehicles put together from parts, with controllers in water that moves."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import general_vehicle, paper_form
from coadjoint_vehicles import Controller, Craft, Vehicle
from coadjoint_vehicles.controllers import Cruise
from coadjoint_vehicles.model import craft_of
from coadjoint_vehicles.model.actuators import seen
from coadjoint_vehicles.parts import Damping, Derivatives, Fin, Hull, Propeller
from coadjoint_vehicles.water import LinearShear, UniformWater
from remus import remus

CURRENT = (0.1, 0.2, -0.05)


@pytest.mark.long
def test_inputs_of_the_names_of_parts_command_them_and_other_parts_stay():
    craft = Craft(remus())
    start = craft.start(speed=1.5, actuators={"propeller": 15.0, "rudder": 0.03})
    run = co.simulate(craft.system, start, dt=0.05, duration=2.0, inputs={"stern_planes": co.Held([0.0], [1.0])})
    t = run.dataset.time.values
    limit = np.radians(15)
    np.testing.assert_allclose(run.dataset.internal_stern_planes, limit * (1 - np.exp(-t / 0.1)), atol=1e-13)
    assert np.all(run.dataset.internal_rudder == 0.03) and np.all(run.dataset.internal_propeller == 15.0)


@pytest.mark.long
def test_an_actuator_that_lags_leaves_the_order_two():
    """By extrapolation to h → 0, after 10 s at h = 0.05 s."""
    craft = Craft(remus()).replace(rudder={"lag": 0.5})
    start = craft.start(speed=1.5, actuators={"propeller": 15.0})
    ends = [
        co.simulate(craft.system, start, dt=h, duration=10.0, inputs={"rudder": 0.2}, monitors=False).final.q
        for h in (0.1, 0.05, 0.025)
    ]
    coarse, fine = (float(np.linalg.norm(a - b)) for a, b in pairwise(ends))
    assert coarse / fine == pytest.approx(4.0, abs=0.2)
    assert 4 / 3 * fine == pytest.approx(3.7e-4, rel=0.05)


def test_a_controller_sees_where_the_craft_is_and_how_it_moves():
    craft = Craft(remus(), water=UniformWater(CURRENT))
    angles, place, v, omega = (2.0, -0.4, 0.3), (3.0, 5.0, 10.0), (1.2, 0.1, -0.2), (0.1, 0.2, 0.3)
    start = craft.start(
        position=place, velocity=v, euler_zyx=angles, angular_velocity=omega, actuators={"rudder": 0.1}, t=2.0
    )
    motion = craft.system.motion(start.xi, start.n, start.nu, start.a, start.t, None, start.internal)
    feedback = evaluate(lambda m, p: seen(craft.water, craft.vehicle, m, p, co.Parameters()), motion, craft.parameters)
    qdot = co.attitude.zyx(*angles) @ v + CURRENT
    np.testing.assert_allclose([feedback.heading, feedback.pitch, feedback.roll], angles, rtol=1e-13)
    np.testing.assert_allclose(feedback.position, place, rtol=1e-13)
    np.testing.assert_allclose(feedback.velocity, v, rtol=1e-13)
    np.testing.assert_allclose(feedback.ground_velocity, co.attitude.zyx(*angles).T @ qdot, rtol=1e-13)
    np.testing.assert_allclose([feedback.depth, feedback.sink, feedback.t], [10.0, qdot[2], 2.0], rtol=1e-13)
    np.testing.assert_allclose(feedback.omega, omega, rtol=1e-13)
    assert feedback.actual.rudder == 0.1


@pytest.mark.long
def test_a_function_of_what_a_controller_sees_steers():
    def controller(feedback, p):
        return {"rudder": 1.2 * (feedback.inputs.heading - feedback.heading) - feedback.omega[2]}

    craft = Craft(remus(), controller=controller)
    start = craft.start(speed=1.5, actuators={"propeller": 12.0})
    run = co.simulate(craft.system, start, dt=0.05, duration=60.0, inputs={"heading": co.Held([0.0], [0.5])})
    assert run.dataset.euler_angles[-1, 0] == pytest.approx(0.5, abs=1e-3)
    assert np.all(run.dataset.internal_propeller == 12.0)


def odd(**changes: Any) -> Vehicle:
    """A vehicle without any symmetry, with a part of every kind."""
    random = np.random.default_rng(7)
    A, J = random.normal(size=(6, 6)), random.normal(size=(3, 3))
    shape = {"area": 0.02, "lift_slope": 3.0, "stall": 0.35}
    tail = {**shape, "limit": 0.3, "lag": 0.1, "rate": 1.0, "drag": 0.01}
    angles = {"one": 0.8, "two": 2.4, "three": 3.9, "four": 5.5}
    wheel = {"diameter": 0.14, "thrust": (0.45, -0.4), "torque": (0.07, -0.06), "thrust_deduction": 0.1}
    parts = (
        Damping("damping", linear=np.diag([1.0, 2, 2, 0.1, 1, 1]), quadratic=A @ A.T, forward=np.ones(6)),
        Hull("hull", axial_drag=0.4, axial_area=0.03, crossflow_drag=(1, 0.8), width=0.3, height=0.2, length=1.6),
        *(
            Fin(name, position=(-0.7, 0.1 * np.cos(a), 0.1 * np.sin(a)), normal=(0, -np.sin(a), np.cos(a)), **tail)
            for name, a in angles.items()
        ),
        Fin("sail", position=(0.3, 0, -0.2), normal=(0, 1, 0), **shape),
        Propeller("propeller", **wheel, wake_fraction=0.1, torque_fraction=0.3, limit=25.0, position=(-0.8, 0.02, 0)),
        Derivatives("lift", coefficients={"M_uw": 2.0, "N_uv": -1.0, "Y_ur": 3.0, "K_p|p|": -0.2}),
        Derivatives("bow", coefficients={"Z_uu_bow": -3.0, "M_uu_bow": 2.0, "X_uu_bow_bow": -2.0}, limit=0.3, lag=0.2),
    )
    body = {"mass": 40.0, "inertia": J @ J.T + 3 * np.eye(3), "added_mass": A @ A.T + 5 * np.eye(6), "volume": 0.0395}
    places = {"center_of_mass": (0.02, -0.01, 0.03), "center_of_buoyancy": (0.01, 0.01, -0.02)}
    return Vehicle(**{"name": "odd", **body, **places, "parts": parts, **changes})


MOVED = {"one": 0.1, "two": -0.05, "three": 0.07, "four": 0.02, "propeller": 12.0, "bow": 0.1}


@pytest.mark.long
def test_a_craft_in_a_steady_current_moves_as_in_still_water_carried_along_on_the_grid_too():
    def gone(current):
        craft = Craft(odd(), water=UniformWater(current))
        start = craft.start(velocity=(1.2, 0.1, -0.2), angular_velocity=(0.1, -0.2, 0.3), actuators=MOVED)
        return co.simulate(craft.system, start, dt=0.05, duration=10.0).dataset

    still, carried = gone((0.0, 0.0, 0.0)), gone(CURRENT)
    np.testing.assert_allclose(carried.q, still.q + np.outer(still.time, CURRENT), atol=1e-11)
    np.testing.assert_allclose(carried.R, still.R, atol=1e-12)


def pushed(craft: Craft, name: str, start: co.State) -> Any:
    """The force and torque of a part at a start."""
    motion = craft.system.motion(start.xi, start.n, start.nu, start.a, start.t, None, start.internal)
    return evaluate(lambda motion, p: dict(craft.system.forces or ())[name](motion, p), motion, craft.parameters)


def test_a_fin_meets_the_current_where_it_is():
    """In c_N = 0.3/s · depth, 0.5 m deeper is 0.15 m/s more; a start has its speed through the water at O."""
    shape = {"area": 0.01, "lift_slope": 3.0, "stall": 0.35, "position": (-0.8, 0.0, 0.5)}
    vehicle = remus(parts=(Fin("keel", normal=(0, 1, 0), **shape),))
    east = {"euler_zyx": (np.pi / 2, 0.0, 0.0), "position": (0.0, 0.0, 20.0)}
    sheared, still = Craft(vehicle, water=LinearShear((0, 0, 0), (0.3, 0, 0))), Craft(vehicle)
    one = pushed(sheared, "keel", sheared.start(velocity=(1.5, 0.0, 0.0), **east))
    other = pushed(still, "keel", still.start(velocity=(1.5, 0.15, 0.0), **east))  # north is to port
    np.testing.assert_allclose(one.force, other.force, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(one.torque, other.torque, rtol=1e-12, atol=1e-12)
    assert abs(one.force[1]) > 0.1


def test_a_hull_that_stands_upright_in_a_shear_is_turned_as_one_that_turns_in_still_water():
    """Nose down, back to the north: the shear s pushes the nose, which is deeper, to its back, M = ½ρ C d s²L⁴/32."""
    sheared = Craft(remus(parts=(remus().part("hull"),)), water=LinearShear((0, 0, 0), (0.3, 0, 0)))
    found = pushed(sheared, "hull", sheared.start(euler_zyx=(0.0, -np.pi / 2, 0.0)))
    expected = 0.5 * 1026 * 1.1 * 0.19 * 0.3**2 * 1.6**4 / 32
    np.testing.assert_allclose(found.torque, [0, expected, 0], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found.force, 0, atol=1e-12)


@pytest.mark.long
def test_a_craft_without_parts_is_the_vehicle_of_kirchhoff():
    vehicle = odd(parts=())
    same = ("mass", "inertia", "added_mass", "buoyancy", "center_of_mass", "center_of_buoyancy", "gravity")
    general = general_vehicle(**{key: getattr(vehicle, key) for key in same})
    craft = Craft(vehicle)
    begun = {"position": (1.0, 2.0, 3.0), "euler_zyx": (0.3, 0.2, 0.1), "angular_velocity": (0.1, -0.2, 0.3)}
    R = co.attitude.zyx(0.3, 0.2, 0.1)
    one = co.simulate(craft.system, craft.start(**begun, velocity=(1.2, 0.1, -0.2)), dt=0.05, duration=10.0)
    there = paper_form.start(general, **begun, velocity=R @ [1.2, 0.1, -0.2])
    other = co.simulate(general, there, dt=0.05, duration=10.0)
    np.testing.assert_allclose(one.dataset.q, other.dataset.q, atol=1e-11)
    np.testing.assert_allclose(one.dataset.R, other.dataset.R, atol=1e-11)
    assert "energy_budget" not in one.dataset and one.relative_change("energy") < 1e-2


@pytest.mark.long
def test_the_energy_budget_of_a_craft_with_a_part_of_every_kind_closes_to_second_order():
    craft = Craft(odd())
    start = craft.start(velocity=(1.2, 0.1, -0.2), actuators=MOVED)
    found = []
    for dt in (0.02, 0.01):
        run = co.simulate(craft.system, start, dt=dt, duration=5.0)
        found.append(run.summary()["energy_budget_error_max"])
        lines = {str(name)[5:] for name in run.dataset if str(name).startswith("work_")}
        assert lines == {part.name for part in craft.vehicle.parts}
    assert found[0] < 1e-3 and 3.5 < found[0] / found[1] < 4.5


@pytest.mark.long
def test_port_and_starboard_are_mirrored():
    craft = Craft(remus()).replace(propeller={"torque_fraction": 0.0})
    mirror, turned = np.array([1.0, -1, 1]), np.array([-1.0, 1, -1])
    made = []
    for side in (1.0, -1.0):
        start = craft.start(
            velocity=(1.5, 0.1 * side, -0.05),
            euler_zyx=(0.4 * side, 0.2, 0.3 * side),
            angular_velocity=(0.2 * side, 0.1, -0.3 * side),
            actuators={"rudder": 0.1 * side, "stern_planes": 0.05, "propeller": 12.0},
        )
        made.append(co.simulate(craft.system, start, dt=0.05, duration=20.0).dataset)
    np.testing.assert_allclose(made[1].q, made[0].q * mirror, atol=1e-11)
    np.testing.assert_allclose(made[1].xi, made[0].xi * turned, atol=1e-11)


@pytest.mark.long
def test_every_member_of_a_fleet_has_its_own_rudder_its_own_start_and_its_own_current():
    places, currents = np.arange(9.0).reshape(3, 3), 0.1 * np.arange(9.0)[::-1].reshape(3, 3)
    own = {
        "area": np.array([0.01, 0.014, 0.02]),
        "speed": np.array([1.0, 1.5, 2.0]),
        "place": places,
        "current": currents,
        "angle": np.array([0.1, -0.05, 0.02]),
    }

    def gone(area, speed, place, current, angle):
        craft = Craft(remus(), water=UniformWater()).replace(rudder={"area": area}, water={"velocity": current})
        start = craft.start(position=place, speed=speed, actuators={"rudder": angle, "propeller": 12.0})
        return co.simulate(craft.system, start, dt=0.05, duration=10.0).dataset

    fleet = gone(**{name: co.each(values) for name, values in own.items()})
    for k in range(3):
        alone = gone(**{name: values[k] for name, values in own.items()})
        np.testing.assert_allclose(fleet.q[k], alone.q, atol=1e-12)
        np.testing.assert_allclose(fleet.work_rudder[k], alone.work_rudder, atol=1e-12)


@pytest.mark.long
def test_the_gradient_of_where_a_craft_ends_by_the_area_of_its_rudder_is_that_of_its_differences():
    craft = Craft(remus(parts=tuple(remus().part(name) for name in ("damping", "rudder"))))
    start = craft.start(speed=1.5, actuators={"rudder": 0.1})

    def east(area):
        path = co.trajectory(craft.system.replace(rudder={"area": area}), start, dt=0.05, steps=40, backend="native")
        return path.final.q[1]

    def difference(d):
        return (float(east(0.0133 + d)) - float(east(0.0133 - d))) / (2 * d)

    with co.float64():
        slope = float(jax.grad(east)(0.0133))
    assert slope == pytest.approx((4 * difference(1e-5) - difference(2e-5)) / 3, rel=1e-7) and abs(slope) > 0.1


def test_a_system_knows_the_craft_that_it_was_made_by():
    system = Craft(remus(), water=UniformWater(CURRENT)).system.replace(
        rudder={"area": 0.02}, water={"velocity": [0, 0.5, 0]}
    )
    assert craft_of(system).system.parameters.rudder.area == 0.02  # pyright: ignore[reportOptionalMemberAccess]
    np.testing.assert_allclose(craft_of(system).start(speed=1.5).qdot, [1.5, 0.5, 0])
    with pytest.raises(co.errors.ArgumentError, match="was not made by a Craft"):
        craft_of(co.System(co.SO3(), lambda xi: xi @ xi))


def test_a_start_is_the_same_in_the_axes_of_robotics():
    craft = Craft(remus(), water=UniformWater(CURRENT))
    east, north, up, yaw, pitch, roll = 3.0, 5.0, -10.0, 0.3, 0.2, 0.1
    given = {"position": (east, north, up), "velocity": (1.5, 0.1, -0.2), "angular_velocity": (0.1, 0.2, 0.3)}
    robotic = craft.start(**given, euler_zyx=(yaw, pitch, roll), axes="ENU/FLU")
    there = {"position": (5.0, 3.0, 10.0), "velocity": (1.5, -0.1, 0.2), "angular_velocity": (0.1, -0.2, -0.3)}
    naval = craft.start(**there, euler_zyx=(np.pi / 2 - yaw, -pitch, roll))
    for name in ("g", "n", "nu", "xi", "a"):
        np.testing.assert_allclose(getattr(robotic, name), getattr(naval, name), atol=1e-14)


class Helmsman(Controller):
    """Holds a heading."""

    @property
    def inputs(self):
        return {"heading": "rad"}

    def steer(self, feedback, memory, own, vehicle):
        return {"rudder": feedback.inputs.heading - feedback.heading}, {}


class ByHand(Controller):
    """A person's rudder, damped."""

    @property
    def inputs(self):
        return {"rudder": "rad"}

    def steer(self, feedback, memory, own, vehicle):
        return {"rudder": feedback.inputs.rudder - 0.5 * feedback.omega[2]}, {}


@pytest.mark.long
def test_a_set_point_of_a_controller_may_have_the_name_of_the_part_that_it_steers():
    craft = Craft(remus(), controller=ByHand())
    start = craft.start(speed=1.5, actuators={"propeller": 15.0})
    run = co.simulate(craft.system, start, dt=0.05, duration=20.0, inputs={"rudder": 0.05, "stern_planes": 0.02})
    made = run.dataset
    assert made.internal_rudder[-1] == pytest.approx(0.05 - 0.5 * made.xi[-1, 2].item(), abs=1e-5)
    assert made.internal_stern_planes[-1] == pytest.approx(0.02, rel=1e-12)


STILL = co.Held([0.0], [0.0])


def steered(controller, **inputs: Any):
    craft = Craft(remus(), controller=controller)
    return co.simulate(craft.system, craft.start(speed=1.0), dt=0.05, steps=2, inputs=inputs or None)


def towed(**inputs: Any):
    craft = Craft(remus(parts=(remus().part("hull"),)))
    return co.simulate(craft.system, craft.start(speed=1.0), dt=0.05, steps=2, inputs=inputs or None)


def drifting(**inputs: Any):
    craft = Craft(remus(parts=()))
    return co.simulate(craft.system, craft.start(speed=1.0), dt=0.05, steps=2, inputs=inputs)


@pytest.mark.cases(8)
@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: remus(parts=(Damping("drag"), Damping("drag"))), "Two parts are named `drag`"),
        (lambda: remus(parts=(Damping("controller"),)), "The name `controller` is taken"),
        (lambda: remus(parts=(Damping("water_brake"),)), "`water_brake` begins like the records"),
        (lambda: remus(parts=({"kind": "fin"},)), "`parts` must be a part such as Fin"),
        (lambda: remus().part("ruder"), "has no part `ruder`: did you mean `rudder`. It knows damping, hull"),
        (lambda: Craft(remus(), water=CURRENT), r"`water` must be a Water such as UniformWater"),
        (lambda: Craft(remus()).replace(ruder_area=1.0), "There is no `ruder_area` to replace"),
        (lambda: Craft(remus()).replace(rudder_area=1.0), "it is `rudder.area`, replaced by rudder={'area': …}"),
        (lambda: Craft(remus()).replace(**{"rudder.area": 1.0}), "within `rudder`: replace it by rudder={'area': …}."),
        (lambda: Craft(remus()).replace(rudder=1.0), "`rudder` is several numbers, position, normal, area"),
        (lambda: Craft(remus()).replace(mass={"area": 1.0}), "`mass` is one array of numbers"),
        (lambda: remus(parts=(Damping("mass"),)), "`mass` is taken"),
        (lambda: Craft(remus()).replace(mass=-5.0), "`mass` must be positive"),
        (
            lambda: Craft(remus()).replace(rudder={"normal": [0, 2, 0]}),
            "`normal` of the fin `rudder` must be a unit vector",
        ),
        (lambda: Craft(remus()).replace(hull={"length": [1, 2]}), "`length` of the hull `hull` must be one number"),
        (
            lambda: Craft(remus(), controller=Helmsman()).replace(water={"velocity": 1.0}),
            r"`velocity` must have shape \(3,\)",
        ),
        (
            lambda: Craft(remus()).start(actuators={"ruder": 0.1}),
            "`actuators` names `ruder`, but .* did you mean `rudder`",
        ),
        (lambda: Craft(remus()).start(actuators={"rudder": [0.1, 0.2]}), r"`rudder` .* must be one number, .* \(2,\)"),
        (lambda: Craft(remus()).start(actuators={"rudder": 10.0}), "`rudder` cannot start at 10 rad: it goes"),
        (lambda: Craft(remus()).start(actuators={"rudder": co.each([0.1, -0.3])}), "cannot start at -0.3 rad"),
        (lambda: Craft(remus()).start(speed=1.0, velocity=(1, 0, 0)), "one of `speed` and `velocity`, not both"),
        (lambda: Craft(remus()).start(velocity=1.0), r"`velocity` must have shape \(3,\)"),
        (lambda: Craft(remus()).start(actuators={"rudder": co.each([[0.1], [0.2]])}), r"one number, .* \(1,\)"),
        (lambda: Craft(remus()).start(speed=co.each([[1.0], [2.0]])), r"`speed` must have shape \(members,\)"),
        (lambda: Craft(remus()).start(position=co.each([1.0, 2.0])), r"`position` must have shape \(members, 3\)"),
        (lambda: steered(Helmsman()), r"needs the input `heading` \(rad\): give it to co.simulate"),
        (lambda: steered(Helmsman(), heading=STILL, depth=STILL), "knows the input `depth`: .* take heading, stern"),
        (lambda: steered(None, depth=STILL), "knows the input `depth`: .* take stern_planes, rudder, propeller"),
        (lambda: steered(Helmsman(), heading=STILL, rudder=STILL), "The controller commands `rudder` already"),
        (lambda: towed(rudder=STILL), "knows the input `rudder`: controller and actuators take none"),
        (lambda: drifting(rudder=STILL), "Nothing takes these inputs"),
        (lambda: steered(None, rudder=co.Held([0.0], [[0.0, 1.0]])), r"`rudder` with shape \(2,\), but it takes one"),
        (
            lambda: steered(lambda feedback, p: {"sail": 0.0}),
            "The controller commands `sail`, but REMUS",
        ),
        (
            lambda: steered(lambda feedback, p: {"rudder": feedback.omega}),
            r"`rudder` with shape \(3,\), but it takes one",
        ),
        (lambda: steered(lambda feedback, p: feedback.omega), "must return a dictionary of commands"),
    ],
)
def test_what_no_craft_can_do_is_said_in_one_sentence(call, sentence):
    with pytest.raises((co.errors.ArgumentError, co.errors.LagrangianError), match=sentence):
        call()


@pytest.mark.cases(6)
@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"rudder": {"lag": -0.1}}, "`lag` of the fin `rudder` must be at least 0, but is -0.1"),
        ({"rudder": {"area": -0.0133}}, "`area` of the fin `rudder` must be at least 0"),
        ({"rudder": {"normal": [0, 5, 0]}}, "`normal` of the fin `rudder` must be a unit vector"),
        (
            {"rudder": {"limit": co.each([0.2, -0.1, 0.3])}},
            "Of member 1: .*`limit` of the fin `rudder` must be pos",
        ),
        ({"rudder": {"normal": co.each([[0, 1, 0], [0, 0, 1], [0, 2, 0]])}}, "Of member 2: .*unit vector"),
        ({"mass": -3.0}, "`mass` must be positive"),
        ({"center_of_mass": [0, 0.02]}, r"`center_of_mass` must have shape \(3,\)"),
        ({"inertia": [1.0, 2.0, 2.0]}, r"`inertia` must have shape \(3, 3\), but has shape \(3,\)"),
        ({"inertia": np.diag([1.0, -2.0, 2.0])}, "`inertia` must be positive definite"),
        ({"water": {"velocity": [0.1, 0.2]}}, r"`velocity` must have shape \(3,\)"),
        ({"controller": {"period": 0.0}}, "`period` of the controller `Cruise` must be positive"),
        ({"controller": {"allocation": [1.0]}}, r"`controller.allocation` must have shape"),
    ],
)
def test_what_replaces_a_parameter_is_checked_as_where_it_was_made(changed, sentence):
    with pytest.raises(ArgumentError, match=sentence):
        Craft(remus(), controller=Cruise()).replace(**changed)


def test_what_can_be_replaces_a_parameter_also_where_it_is_traced():
    craft = Craft(remus(), controller=Cruise()).replace(rudder={"area": co.each(np.linspace(0, 0.1, 5))}, mass=32.0)
    assert len(craft.parameters.rudder.area) == 5

    def area(value):
        return Craft(remus()).replace(rudder={"area": value, "lag": -value}).parameters.rudder.area ** 2

    assert evaluate(jax.grad(area), np.float64(0.3)) == 0.6


@pytest.mark.long
def test_a_lag_of_zero_is_none():
    """exp(−h/τ) → 0: the rudder is where its command is at once, without dividing by zero."""
    craft = Craft(remus()).replace(rudder={"lag": 0.0})
    run = co.simulate(craft.system, craft.start(speed=1.5), dt=0.05, steps=3, inputs={"rudder": 0.1})
    assert run.plan.backend == "native"
    np.testing.assert_array_equal(run.dataset.internal_rudder, [0.1, 0.1, 0.1, 0.1])


def test_a_system_knows_the_units_of_the_parameters_of_its_craft():
    """Those that measure one thing, of body, parts and water, by their paths."""
    units = dict(Craft(remus(), water=LinearShear((0.3, 0.0, 0.0), (0.0, 0.0, 0.0))).system.units)
    assert {key: units[key] for key in ("mass", "inertia", "rudder.area", "propeller.lag", "hull.axial_drag")} == {
        "mass": "kg", "inertia": "kg m²", "rudder.area": "m²", "propeller.lag": "s", "hull.axial_drag": "1"
    }  # fmt: skip
    assert dict(Craft(remus()).system.units)["water.velocity"] == "m/s" and "added_mass" not in units


def test_a_vehicle_takes_its_buoyancy_in_the_place_of_its_volume():
    from dataclasses import replace
    from inspect import signature

    body = {"name": "float", "mass": 30.0, "inertia": (0.5, 0.5, 0.5), "added_mass": (17, 17, 17, 0, 0, 0)}
    made = Vehicle(**body, buoyancy=330.0, fluid_density=1000.0, gravity=9.8)
    assert made.buoyancy == pytest.approx(330.0) and made.volume == pytest.approx(330.0 / 9800)
    assert replace(made, mass=31.0).buoyancy == pytest.approx(330.0)
    assert Vehicle(**body, volume=0.03).buoyancy == pytest.approx(0.03 * 1026 * 9.81)
    assert "buoyancy" in signature(Vehicle).parameters
    with pytest.raises(ArgumentError, match="`volume` or `buoyancy`"):
        Vehicle(**body, buoyancy=330.0, volume=0.03)
    with pytest.raises(ArgumentError, match="gravity is 0"):
        Vehicle(**body, buoyancy=330.0, gravity=0.0)
    with pytest.raises(ArgumentError, match="`buoyancy` must be positive"):
        Vehicle(**body, buoyancy=-1.0)
