"""What a copy of a stepper is, and what of a clone is taken over: all that its future depends on."""

from __future__ import annotations

import copy

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from driven_body import BODY, OBSERVE, REST, START, H, commands, same, stepper


@pytest.fixture(scope="module")
def body() -> co.Stepper:
    return stepper(changing="inertia")


def go_on(*bodies: co.Stepper) -> None:
    for command in commands(20):
        for one in bodies:
            one.step(command)


@pytest.mark.long
def test_a_deep_copy_is_a_stepper_of_its_own(body):
    body.reset()
    body.step({"spin": 0.3})
    other = copy.deepcopy(body)
    assert type(other) is co.Stepper
    go_on(body)
    assert other.steps == 1
    go_on(other)
    assert same(other.state, body.state)
    other.change(lag=0.1)
    assert body.parameters.lag == 0.3


@pytest.mark.long
def test_a_restored_stepper_goes_on_to_the_bit_with_the_parameters_and_the_start_of_the_clone(body):
    body.reset()
    other = body.clone()
    other.change(lag=0.1, inertia=[1.1, 1.6, 2.0])
    other.step({"spin": 0.3}, 3)
    body.restore(other)
    assert body.parameters.lag == 0.1
    assert body.steps == 3
    go_on(body, other)
    assert same(body.state, other.state)
    assert body.observation["energy"] == other.observation["energy"]
    for one in (body, other):
        one.reset()
    assert same(body.state, other.state)
    fresh = stepper(members=1)
    body.restore(START)  # a state has no parameters
    assert body.parameters.lag == 0.1
    with pytest.raises(ArgumentError, match="but this is another one"):
        body.restore(fresh)


@pytest.mark.long
def test_members_are_restored_with_their_parameters():
    many = co.Stepper(BODY, START, dt=H, inputs=REST, observe=OBSERVE, members=11)
    other, mask = many.clone(), np.arange(11) % 3 == 0
    other.change(lag=np.linspace(0.1, 0.4, 11))
    other.step({"spin": 0.3}, 3)
    many.restore(other, mask=mask)
    np.testing.assert_array_equal(many.parameters.lag, np.where(mask, np.linspace(0.1, 0.4, 11), 0.3))
    go_on(many, other)
    assert np.array_equal(many.observation["xi"][mask], other.observation["xi"][mask])
    assert np.array_equal(many.steps, np.where(mask, 23, 20))


@pytest.mark.long
def test_a_clone_that_was_compiled_anew_lends_its_machine_code():
    wheel = co.System(
        co.SO2(),
        lambda xi, p: 0.5 * p.inertia * xi[0] ** 2,
        parameters=co.Parameters(inertia=2.0, grip=1.0),
        forces=lambda motion, p: co.Force(torque=p.grip * motion.inputs.torque),
    )
    inputs = {"torque": np.zeros(1)}
    for many in (None, 3):
        body = co.Stepper(wheel, wheel.state(xi=[1.0]), dt=0.1, inputs=inputs, members=many)
        other = body.clone()
        with pytest.warns(UserWarning, match="compiled anew"):
            other.change(grip=0.5)
        body.restore(other)
        for one in (body, other):
            one.step([2.0])
        assert np.array_equal(body.state.mu, other.state.mu)
        np.testing.assert_allclose(np.ravel(body.state.mu), 2.1, rtol=1e-15)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("backend", ["native", "xla"])
def test_what_is_observed_after_a_change_is_of_the_new_parameters(backend):
    energy = {"energy": lambda s, p: p.power * s.mu[0], "mu": lambda s: s.mu}
    body = co.Stepper(BODY, START, dt=H, inputs=REST, observe=energy, backend=backend, changing="inertia")
    body.step({"spin": 0.3})
    body.change(power=2.6, inertia=[1.1, 1.6, 2.0])
    state = body.state
    assert body.observation["energy"] == pytest.approx(2.6 * state.mu[0], rel=1e-15)
    assert np.array_equal(body.observation["mu"], state.mu)
    assert body.t == H


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("number", [0, 1, 0.0, 1.0, np.int64(1)])
def test_by_xla_parameters_change_to_whole_numbers_too(number):
    wheel = co.System(
        co.SO2(),
        lambda xi, p: 0.5 * p.inertia * xi[0] ** 2,
        parameters=co.Parameters(inertia=2.0, grip=1.0, brake=0.0),
        forces=lambda motion, p: co.Force(torque=p.grip * motion.inputs.torque - p.brake * motion.xi),
    )
    start = wheel.state(xi=[1.0])
    body = co.Stepper(wheel, start, dt=0.1, inputs={"torque": np.ones(1)}, backend="xla")
    body.change(grip=number)
    body.change(brake=1 - number)
    body.step()
    other = co.Stepper(
        wheel.replace(grip=float(number), brake=float(1 - number)), start, dt=0.1, inputs={"torque": np.ones(1)}
    )
    other.step()
    np.testing.assert_allclose(body.state.mu, other.state.mu, rtol=1e-14)
    with pytest.raises(ArgumentError, match="must be a number or an array of numbers, but is True"):
        body.change(grip=True)
