"""Faults and changes between steps: velocities are continuous, and what follows is what the changed system does."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import tabulate
from coadjoint.mechanics.continuous import velocities
from coadjoint_vehicles import Craft
from coadjoint_vehicles.water.water import UniformWater
from pinned import PIN, pinned
from pinned import start as start_pinned

H = 0.05
COMMANDS = {"rudder": 0.0, "stern_planes": 0.0, "propeller": 15.0}
CHANGING = ("water.velocity", "center_of_mass", "inertia")


@pytest.fixture(scope="module")
def craft() -> Craft:
    return Craft(vehicles.load("remus_100"), water=UniformWater((0.0, 0.0, 0.0)))


@pytest.fixture(scope="module")
def remus(craft) -> co.Stepper:
    start = craft.start(speed=1.5, actuators={"propeller": 15.0})
    observe = {"q": lambda s: s.q, "rudder": lambda s: s.internal.rudder, "mass": lambda s, p: p.mass}
    return co.Stepper(craft.system, start, dt=H, inputs=COMMANDS, observe=observe, changing=CHANGING)


@pytest.fixture
def under_way(remus) -> co.Stepper:
    body = remus.clone()
    body.reset()
    body.step({"rudder": 0.1, "stern_planes": -0.05}, n=40)
    return body


@pytest.fixture(scope="module")
def moving(remus):
    """(ξ, ν) of the node of a stepper, of its momenta."""
    system = Craft(vehicles.load("remus_100"), water=UniformWater((0.0, 0.0, 0.0))).system
    found = tabulate(lambda s, p: velocities(system.replace(**p.asdict()), s), remus.state, remus.parameters)
    return lambda body: found(body.state, body.parameters)


@pytest.mark.long
def test_a_dropped_mass_leaves_the_velocities_alone_and_takes_its_momentum_away(under_way, craft, moving):
    before, state, mass = moving(under_way), under_way.state, craft.vehicle.mass
    whole = under_way.clone()
    under_way.change(mass=mass - 2.0, center_of_mass=[0.0, 0.001, 0.02])
    after = moving(under_way)
    for old, new in zip(before, after, strict=True):
        np.testing.assert_allclose(new, old, rtol=1e-12, atol=1e-14)
    xi, nu = before
    # π = (m + M_a)ν + m ξ × r_G of a body with its mass at r_G: what is dropped is the change.
    old, new = (m * (nu + np.cross(xi, r)) for m, r in ((mass, [0, 0, 0.02]), (mass - 2.0, [0, 0.001, 0.02])))
    np.testing.assert_allclose(under_way.state.pi - state.pi, new - old, rtol=1e-11, atol=1e-12)
    for body in (under_way, whole):
        body.step(n=100)
    assert under_way.observation["q"][2] < whole.observation["q"][2] - 0.1  # lighter: it rises


@pytest.mark.long
def test_the_start_keeps_its_velocities_too(under_way, remus, craft):
    under_way.change(mass=29.0)
    under_way.reset()
    start = craft.replace(mass=29.0).start(speed=1.5, actuators={"propeller": 15.0})
    np.testing.assert_allclose(under_way.state.pi, start.pi, rtol=1e-13)
    remus.reset()
    assert abs(remus.state.pi[0] - start.pi[0]) > 1.0  # a clone changes alone


@pytest.mark.long
def test_momenta_stay_where_that_is_asked_for(under_way):
    state = under_way.state
    under_way.change(mass=25.0, keep="momentum")
    assert np.array_equal(under_way.state.pi, state.pi)


@pytest.mark.long
def test_what_does_not_enter_the_lagrangian_changes_no_bit_of_the_state(under_way):
    state = under_way.state
    under_way.change(rudder={"lift_slope": 1.0}, propeller={"thrust": [0.2, -0.2]})
    for name in ("mu", "pi", "g", "n"):
        assert np.array_equal(getattr(under_way.state, name), getattr(state, name))


@pytest.mark.long
def test_a_stuck_fin_stays_where_it_stands_and_a_free_one_follows(under_way):
    angle = float(under_way.observation["rudder"])
    free = under_way.clone()
    under_way.change(rudder={"lag": 1e30})
    for body in (under_way, free):
        body.step({"rudder": -0.2}, n=60)
    assert under_way.observation["rudder"] == angle
    assert free.observation["rudder"] == pytest.approx(-0.2, abs=1e-6)
    assert np.linalg.norm(under_way.observation["q"] - free.observation["q"]) > 0.1


@pytest.mark.long
def test_a_dead_thruster_goes_on_as_a_vehicle_that_was_built_without_it(under_way, craft):
    state = under_way.state
    under_way.change(propeller={"thrust": [0.0, 0.0], "torque": [0.0, 0.0]})
    dead = craft.replace(propeller={"thrust": [0.0, 0.0], "torque": [0.0, 0.0]})
    built = co.Stepper(
        dead.system, state, dt=H, inputs=COMMANDS, changing=(*CHANGING, "propeller.thrust", "propeller.torque")
    )
    built.restore(state)
    speed = np.linalg.norm(state.nu)
    for body in (under_way, built):
        body.step(n=200)
    assert np.array_equal(under_way.state.n, built.state.n)
    assert np.linalg.norm(under_way.state.nu) < 0.7 * speed


@pytest.mark.long
def test_a_front_of_current_carries_the_vehicle_away(under_way, moving):
    still = under_way.clone()
    under_way.change(water={"velocity": [0.0, 0.5, 0.0]})
    np.testing.assert_allclose(moving(under_way)[1], moving(still)[1], rtol=1e-12, atol=1e-13)
    for body in (under_way, still):
        body.step(n=400)
    drift = under_way.observation["q"] - still.observation["q"]
    assert 5.0 < drift[1] < 10.5  # 20 s in 0.5 m/s


@pytest.mark.long
def test_members_change_by_a_mask_and_by_a_value_each(craft):
    start = craft.start(speed=1.5, actuators={"propeller": 15.0})
    observe = {"mass": lambda s, p: p.mass, "q": lambda s: s.q}
    fleet = co.Stepper(craft.system, start, dt=H, inputs=COMMANDS, observe=observe, members=11)
    mask = np.arange(11) % 2 == 0
    fleet.change(mass=29.0, mask=mask)
    fleet.change(rudder={"area": np.linspace(0.01, 0.02, 11)})
    fleet.step({"rudder": 0.1}, n=40)
    assert np.array_equal(fleet.observation["mass"] == 29.0, mask)
    assert np.array_equal(fleet.parameters.rudder.area, np.linspace(0.01, 0.02, 11))
    assert len(set(fleet.observation["q"][:, 1])) == 11
    fleet.change(mass=31.0, rudder={"area": 0.015})
    assert fleet.parameters.mass == 31.0


def test_a_number_that_is_compiled_in_is_compiled_anew_with_a_sentence():
    wheel = co.System(
        co.SO2(),
        lambda xi, p: 0.5 * p.inertia * xi[0] ** 2,
        parameters=co.Parameters(inertia=2.0, grip=1.0),
        forces=lambda motion, p: co.Force(torque=p.grip * motion.inputs.torque),
    )
    inputs = {"torque": np.zeros(1)}
    body = co.Stepper(wheel, wheel.state(xi=[1.0]), dt=0.1, inputs=inputs, observe={"mu": lambda s: s.mu})
    with pytest.warns(UserWarning, match="Parameter `grip` was compiled in as 0 or 1"):
        body.change(grip=0.5)
    body.step([2.0])
    np.testing.assert_allclose(body.observation["mu"], [2.0 + 0.1 * 0.5 * 2.0], rtol=1e-15)
    ready = co.Stepper(wheel, wheel.state(xi=[1.0]), dt=0.1, inputs=inputs, changing="grip")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ready.change(grip=0.0)
    wrong = [
        ({"grop": 1.0}, "There is no parameter `grop`; there is: inertia, grip"),
        ({"grip": "none"}, "must be a number"),
        ({"grip": np.inf}, "must be finite"),
        ({"grip": [1.0, 2.0]}, "must have a number, but has shape"),
        ({"grip": 1.0, "keep": "energy"}, 'must be "velocity" or "momentum"'),
        ({}, "Give at least one parameter"),
    ]
    for given, sentence in wrong:
        with pytest.raises(ArgumentError, match=sentence):
            ready.change(**given)
    with pytest.raises(ArgumentError, match="There is no parameter `gripp`"):
        co.Stepper(wheel, wheel.state(xi=[1.0]), dt=0.1, inputs=inputs, changing="gripp")


def test_a_mass_matrix_that_is_no_longer_positive_is_refused_and_nothing_changes(under_way):
    state, mass = under_way.state, under_way.parameters.mass
    for wrong in ({"mass": -1.0}, {"inertia": np.diag([-0.2, 3.4, 3.4])}):
        with pytest.raises(ArgumentError, match="another sign than before"):
            under_way.change(**wrong)
    assert np.array_equal(under_way.state.pi, state.pi) and under_way.parameters.mass == mass
    under_way.step(n=2)
    assert np.all(np.isfinite(under_way.state.pi))


def test_a_state_off_a_constraint_is_refused_wherever_a_stepper_gets_it():
    system = pinned()
    stepper = co.Stepper(system, start_pinned(system), dt=0.01)
    before = stepper.state
    for move in (
        lambda: stepper.change(pin=PIN + 0.1),
        lambda: stepper.restore(system.state(q=[1, 1, 1], a0=[0, 0, 1])),
        lambda: stepper.reset({"n": -PIN + 0.1}),
        lambda: stepper.reset({"mu": [5.0, 0.0, 0.0]}),
    ):
        with pytest.raises(co.errors.ArgumentError, match=r"must satisfy the constraint `pin`, but \|φ"):
            move()
    stepper.restore(before)
    stepper.change(mass=3.0)
    stepper.step(n=3)
    np.testing.assert_allclose(stepper.state.n, -PIN, atol=1e-14)


def test_velocities_alone_do_not_reset_a_stepper():
    system = pinned()
    stepper = co.Stepper(system, start_pinned(system), dt=0.01)
    with pytest.raises(co.errors.ArgumentError, match="follow from its momenta: give `mu` and `pi`"):
        stepper.reset({"xi": [5.0, 0.0, 0.0]})
