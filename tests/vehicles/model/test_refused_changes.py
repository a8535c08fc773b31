"""What a model or a vehicle refuses when it is made it refuses when its parameters are replaced; failed thrusters."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.errors import ArgumentError
from coadjoint.models import catalogue
from coadjoint_vehicles import Craft
from coadjoint_vehicles.files import vehicle_to_toml
from coadjoint_vehicles.files.file import vehicle_from_text
from coadjoint_vehicles.parts import Damping, Thrusters

IMPOSSIBLE = {"mass": -15.0, "gravity": -1.0, "inertia": -1.0, "stiffness": -1.0, "density": 0.0, "added_mass": -1.0}
IMPOSSIBLE |= {"radius": -1.0, "circulations": 0.0, "moments": -1.0}
WITHOUT_PARAMETERS = ["toda_lattice"]


@pytest.mark.cases(10)
@pytest.mark.parametrize("name", [name for name in catalogue if name not in ("remus_100", *WITHOUT_PARAMETERS)])
def test_models_refuse_a_replaced_parameter_as_they_refuse_it_when_they_are_made(name):
    system = catalogue[name].make()
    assert system.parameters is not None
    found = system.parameters.asdict()
    tried = 0
    for key, factor in IMPOSSIBLE.items():
        if key not in found:
            continue
        value = factor * np.abs(found[key]) if np.any(found[key]) else np.full(np.shape(found[key]), factor)
        if np.all(value == found[key]):
            continue
        with pytest.raises(ArgumentError, match=f"`{key}`"):
            system.replace(**{key: value})
        tried += 1
    assert tried


def test_a_replaced_diagonal_becomes_the_matrix_that_the_constructor_makes_of_it():
    vehicle = co.models.paper_vehicle()
    assert np.array_equal(vehicle.replace(inertia=[1.0, 2.0, 3.0]).parameters.inertia, np.diag([1.0, 2.0, 3.0]))


def test_every_member_is_checked():
    with pytest.raises(ArgumentError, match="`mass` of member `1` must be positive"):
        co.models.paper_vehicle().replace(mass=co.each([120.0, -1.0]))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mass": -15.0}, "`mass` must be positive"),
        ({"rudder": {"area": -1.0}}, "`area` of the fin `rudder` must be at least 0"),
        ({"controller": {"period": 0.0}}, "`period`"),
        ({"mass": co.each([30.0, -1.0])}, "Of member 1: .*`mass`"),
        ({"center_of_buoyancy": [1e12, 0.0, 0.0]}, "`center_of_buoyancy` must be a point of the vehicle"),
        ({"propeller": {"effectiveness": 1.5}}, "`effectiveness` of the propeller `propeller` must be at most 1"),
    ],
)
def test_the_system_of_a_craft_refuses_what_its_vehicle_refuses(changes, words):
    vehicle = vehicles.load("remus_100")
    with pytest.raises(ArgumentError, match=words):
        Craft(vehicle, controller=vehicle.controller).system.replace(**changes)


def test_centres_far_beyond_the_hull_are_refused_with_one_sentence():
    with pytest.raises(ArgumentError, match=r"1e\+12 m from the origin") as caught:
        co.models.paper_vehicle().replace(center_of_buoyancy=[1e12, 0.0, 0.0])
    assert "\n" not in str(caught.value)


def four(**changes):
    """A box with four thrusters ahead, two on either side."""
    places = [[0.0, 0.2, 0.0], [0.0, -0.2, 0.0], [0.0, 0.4, 0.0], [0.0, -0.4, 0.0]]
    given = {"curve": {"linear": 2.0}, "positions": places, "directions": [[1.0, 0.0, 0.0]] * 4, "limit": 20.0}
    return vehicles.Vehicle(
        name="box",
        mass=10.0,
        inertia=[0.3, 0.3, 0.3],
        added_mass=[5.0] * 3 + [0.1] * 3,
        center_of_mass=[0.0, 0.0, 0.02],
        parts=(Thrusters("jets", **{**given, **changes}), Damping("damping", linear=[9.0] * 6)),
    )


def test_a_dead_thruster_of_a_vehicle_pushes_nothing_and_the_others_make_up_for_it():
    part = four(effectiveness=[0.0, 1.0, 1.0, 1.0]).part("jets")
    wrench = [12.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    commands = part.allocate(wrench)
    assert commands[0] == 0.0
    assert part.nominal_matrix @ (2.0 * commands) == pytest.approx(wrench)
    whole = four().part("jets")
    assert four(effectiveness=1.0).part("jets").allocate(wrench) == pytest.approx(whole.allocate(wrench), abs=0)


@pytest.mark.long
def test_a_thruster_that_fails_in_a_run_turns_the_craft_with_the_moment_that_is_missing():
    craft = Craft(four())
    stepper = co.Stepper(
        craft.system, craft.start(), dt=0.05, inputs={"jets": np.zeros(4)}, observe={"r": lambda s: s.xi[2]}
    )
    ahead = {"jets": np.full(4, 5.0)}
    assert stepper.step(ahead, n=20)["r"] == pytest.approx(0.0, abs=1e-12)
    stepper.change(jets={"effectiveness": [0.0, 1.0, 1.0, 1.0]})
    found = stepper.step(ahead, n=400)["r"]
    assert found == pytest.approx(10.0 * 0.2 / 9.0, rel=1e-3)  # N = 0.2 m times 10 N against 9 N m s of damping


def test_effectiveness_is_read_and_written_and_refused_outside_0_to_1():
    text = vehicle_to_toml(four(effectiveness=[0.0, 0.5, 1.0, 1.0]))
    assert vehicle_from_text(text).part("jets").effectiveness == pytest.approx([0.0, 0.5, 1.0, 1.0])
    assert "effectiveness" not in vehicle_to_toml(four())
    for wrong, words in (
        ([0.0, 1.2, 1.0, 1.0], "from 0, dead, to 1"),
        ([1.0, 1.0], r"have shape \(4,\)"),
    ):
        with pytest.raises(ArgumentError, match=words):
            four(effectiveness=wrong)


@pytest.mark.long
def test_one_thruster_takes_one_number_and_several_are_told_by_their_columns():
    one = four(positions=[[0.0, 0.0, 0.0]], directions=[[1.0, 0.0, 0.0]])
    craft = Craft(one)
    found = [
        co.simulate(craft.system, craft.start(), dt=0.05, steps=10, inputs={"jets": value}).final.nu[0]
        for value in (5.0, [5.0])
    ]
    assert found[0] == found[1] > 0
    craft = Craft(four())
    with pytest.raises(ArgumentError, match=r"these are the columns `jets\[1\]` to `jets\[4\]`"):
        co.simulate(craft.system, craft.start(), dt=0.05, steps=10, inputs={"jets": 5.0})


@pytest.mark.long
def test_functions_of_the_motion_see_place_and_attitude_and_errors_list_what_there_is():
    craft = Craft(four())
    start = craft.start(position=(1.0, 2.0, 3.0), euler_zyx=(0.5, 0.1, 0.2))
    run = co.simulate(
        craft.system, start, dt=0.05, steps=4, inputs={"jets": lambda m: jnp.append(m.g[0] + m.q, m.xi[0])}
    )
    expected = np.asarray(run.records.g)[:, 0] + np.asarray(run.records.q)
    assert run.dataset.inputs_jets.values[:-1, :3] == pytest.approx(expected[:-1], rel=1e-14)
    with pytest.raises(co.errors.CoadjointError, match="has no `psi`: it has xi, n, nu, a, t, inputs, internal, g, q"):
        co.simulate(craft.system, start, dt=0.05, steps=4, inputs={"jets": lambda m: m.psi})
    with pytest.raises(co.errors.CoadjointError, match="A state has no `psi`: it has t, g, q"):
        co.simulate(craft.system, start, dt=0.05, steps=4, until=lambda s: s.psi)


@pytest.mark.long
def test_a_controller_sees_place_and_attitude_as_g_and_q():
    seen = []

    def helm(feedback, p):
        seen.append((feedback.g, feedback.q, feedback.position, feedback.down))
        return {"jets": jnp.append(feedback.g[0] + feedback.q - feedback.position, 0.0)}

    craft = Craft(four(), controller=helm)
    run = co.simulate(craft.system, craft.start(euler_zyx=(0.5, 0.1, 0.2)), dt=0.1, steps=3)
    given = run.dataset.internal_controller_value_jets.values[1, :3]
    assert given == pytest.approx(np.asarray(run.records.g)[1][0], rel=1e-12)
    asked = Craft(four(), controller=lambda feedback, p: {"jets": feedback.wibble})
    with pytest.raises(ArgumentError, match=r"it has position, .*actual, g, q"):
        co.simulate(asked.system, asked.start(), dt=0.1, steps=3)
