"""A stepper computes what a run computes, to the bit, in memory of its own that it never grows."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import StepError
from driven_body import BODY, OBSERVE, REST, SEED, START, STEPS, H, commands, same, stepper, tables


@pytest.fixture(scope="module")
def single() -> co.Stepper:
    return stepper()


@pytest.fixture(scope="module")
def many() -> co.Stepper:
    spins = np.random.default_rng(SEED).normal(size=(11, 3))
    start = BODY.state(xi=co.each(spins), inputs=REST, internal={"brake": 0.1})
    return co.Stepper(BODY, start, dt=H, inputs=REST, observe=OBSERVE)


@pytest.mark.long
@pytest.mark.cases(4)
@pytest.mark.parametrize(
    "method",
    [
        co.Midpoint(),
        co.LeftRectangle(co.Exponential()),
        co.Galerkin(),
        co.EnergyMomentum(),
        co.Suzuki4(co.Midpoint(), negative_substeps="allow"),
    ],
    ids=lambda method: method.title,
)
def test_steps_are_to_the_bit_those_of_a_run_with_held_tables(method):
    given = commands()
    # The momenta of the start belong to the first command.
    body = stepper(method=method, inputs=given[0])
    for command in given:
        body.step(command)
    run = co.trajectory(BODY, START, dt=H, steps=STEPS, method=method, inputs=tables(given))
    assert same(body.state, run.final)


@pytest.mark.long
@pytest.mark.parametrize("method", [co.Trapezoidal(), co.RightRectangle(), co.Simpson()], ids=lambda m: m.title)
def test_a_command_is_held_also_at_the_end_of_its_step(method):
    given, table = commands(), tables(commands())
    start = BODY.state(xi=[0.3, -0.4, 1.0], inputs=given[0], internal={"brake": 0.1})
    body = co.Stepper(BODY, start, dt=H, inputs=given[0], method=method)
    for command in given:
        body.step(command)
    held = {name: lambda motion, signal=signal: signal(motion.t) for name, signal in table.items()}
    run = co.trajectory(BODY, start, dt=H, steps=STEPS, method=method, inputs=held)
    assert same(body.state, run.final)


def test_a_free_body_comes_to_the_same_bits_by_a_stepper_and_by_a_run():
    body = co.System(
        co.SO3(),
        lambda xi: 0.5 * xi @ (jnp.array([1.0, 2.0, 3.0]) * xi),
        forces=lambda motion: co.Force(torque=motion.inputs.torque),
    )
    torques = np.random.default_rng(SEED).normal(size=(8, 3))
    start = body.state(xi=[0.3, -0.2, 0.5])
    one = co.Stepper(body, start, dt=H, inputs={"torque": torques[0]}, accuracy=False)
    for torque in torques:
        one.step({"torque": torque})
    held = {"torque": co.Held(H * np.arange(8), torques)}
    run = co.simulate(body, start, dt=H, steps=8, inputs=held, monitors=False, accuracy=False)
    assert np.array_equal(run.final.mu, one.state.mu) and np.array_equal(run.final.g, one.state.g)


@pytest.mark.long
def test_a_run_without_monitors_comes_to_the_same_bits():
    given = commands()
    body = stepper(inputs=given[0])
    for command in given:
        body.step(command)
    run = co.simulate(BODY, START, dt=H, steps=STEPS, inputs=tables(given), monitors=False, accuracy=False)
    assert np.array_equal(run.final.mu, body.state.mu)
    assert np.array_equal(run.final.g, body.state.g)
    assert list(body.observation) == list(OBSERVE)


@pytest.mark.long
def test_signals_and_functions_of_the_motion_stay_what_they_are():
    given = [command["torque"] for command in commands()]
    spin = co.Linear([0.0, 1.0], [0.1, 0.5])
    body = stepper(inputs={"spin": spin, "torque": given[0]})
    for torque in given:
        body.step({"torque": torque})
    table = co.Held(H * np.arange(STEPS), given)
    run = co.trajectory(BODY, START, dt=H, steps=STEPS, inputs={"spin": spin, "torque": table})
    assert same(body.state, run.final)
    steered = stepper(inputs={"spin": given[0][0], "torque": lambda motion: -0.5 * motion.xi})
    for torque in given:
        steered.step({"spin": torque[0]})
    table = co.Held(H * np.arange(STEPS), np.array(given)[:, 0])
    inputs = {"spin": table, "torque": lambda motion: -0.5 * motion.xi}
    assert same(steered.state, co.trajectory(BODY, START, dt=H, steps=STEPS, inputs=inputs).final)


@pytest.mark.long
def test_a_function_of_the_motion_may_enter_the_lagrangian_beside_commands():
    given = [command["torque"] for command in commands()]
    spin = lambda motion: REST["spin"] + 0.2 * motion.t  # noqa: E731
    body = stepper(inputs={"spin": spin, "torque": given[0]})
    for torque in given:
        body.step({"torque": torque})
    inputs = {"spin": spin, "torque": co.Held(H * np.arange(STEPS), given)}
    assert same(body.state, co.trajectory(BODY, START, dt=H, steps=STEPS, inputs=inputs).final)


def test_many_steps_at_once_are_as_many_steps(single):
    given = commands(5)
    single.reset()
    for command in given:
        for _ in range(4):
            single.step(command)
    one_by_one = single.state
    single.reset()
    for command in given:
        single.step(command, 4)
    assert same(single.state, one_by_one)
    assert single.observation["t"] == one_by_one.t


def test_observations_are_functions_of_the_state(single):
    single.reset()
    seen = single.step({"spin": 0.4})
    state, xi, inertia = single.state, seen["xi"], np.array([1.0, 1.5, 2.0])
    momentum = inertia * xi + 0.4 * np.array([0.2 * xi[0], 0.0, 0.3])
    np.testing.assert_allclose(momentum, state.mu, rtol=1e-14)  # ξ is that of the node
    assert seen["energy"] == pytest.approx(0.5 * inertia @ xi**2, rel=1e-15)


def test_a_lagrangian_that_is_not_quadratic_has_the_velocities_of_the_node():
    wheel = co.System(co.SO2(), lambda xi: 0.5 * xi @ xi + 0.1 * jnp.cos(xi[0]))
    body = co.Stepper(wheel, wheel.state(xi=[1.2]), dt=H, observe={"xi": lambda s: s.xi}, accuracy=False)
    xi = body.step()["xi"]
    np.testing.assert_allclose(xi - 0.1 * np.sin(xi), body.state.mu, rtol=1e-14)


def test_observations_are_views_unless_copies_are_asked_for(single):
    single.reset()
    views, copies = single.step(), single.step(copy=True)
    single.step()
    assert views["t"] == pytest.approx(3 * H)
    assert copies["t"] == pytest.approx(2 * H)
    with pytest.raises(ValueError, match="read-only"):
        views["xi"][0] = 1.0


def test_commands_may_be_written_into_their_memory(single):
    single.reset()
    single.step({"spin": 0.4, "torque": [1.0, 2.0, 3.0]})
    first = single.state
    single.reset()
    single.command["spin"][...] = 0.4
    single.command["torque"][:] = [1.0, 2.0, 3.0]
    single.step()
    assert same(single.state, first)
    single.reset()
    single.step([0.4, 1.0, 2.0, 3.0])
    assert same(single.state, first)


def test_commands_stay_and_reset_takes_them_back(single):
    single.reset()
    single.step({"spin": 0.7})
    single.step()
    assert single.state.inputs.spin == 0.7
    single.reset()
    assert single.state.inputs.spin == single.command["spin"] == REST["spin"]


def test_restore_goes_on_to_the_bit_from_a_state_and_from_a_clone(single):
    given = commands()
    single.reset()
    for command in given[:10]:
        single.step(command)
    kept, clone = single.state, single.clone()
    for command in given[10:]:
        single.step(command)
    end = single.state
    single.restore(kept)
    for command in given[10:]:
        single.step(command)
    assert same(single.state, end)
    for command in given[10:]:
        clone.step(command)
    assert same(clone.state, end)
    clone.reset()
    assert not same(clone.state, single.state)


@pytest.mark.long
def test_a_reset_to_another_start_begins_as_a_run_does():
    body, other = stepper(), BODY.state(xi=[-0.1, 0.2, 0.5], inputs=REST, internal={"brake": 0.3})
    body.reset(other)
    table = {name: co.Held([0.0], [value]) for name, value in REST.items()}
    for _ in range(10):
        body.step()
    run = co.trajectory(BODY, other, dt=H, steps=10, inputs=table)
    for name in ("g", "mu"):
        np.testing.assert_allclose(getattr(body.state, name), getattr(run.final, name), rtol=1e-13)


# Many members.


def test_members_agree_with_single_ones_to_round_off(single, many):
    random, count = np.random.default_rng(SEED), many.face.count
    given = [{"spin": random.normal(size=count), "torque": random.normal(size=(count, 3))} for _ in range(STEPS)]
    many.reset()
    starts = many.state
    for command in given:
        many.step(command)
    for member in range(count):
        single.restore(jax.tree.map(lambda leaf, member=member: leaf[member], starts))
        for command in given:
            single.step({name: value[member] for name, value in command.items()})
        np.testing.assert_allclose(many.observation["xi"][member], single.observation["xi"], rtol=1e-12, atol=1e-13)


def test_a_failed_member_stays_is_told_and_is_not_started_again_unasked(many):
    many, count = many.clone(), many.face.count
    many.reset()
    torque = np.zeros((count, 3))
    torque[4] = 1e9
    many.step({"torque": torque})
    frozen = many.state
    assert "Step 0 of member 4 (t = 0 s) left the chart" in many.failures[4]
    many.change(power=0.0)  # what would let the step converge
    many.step({"spin": 0.3, "torque": 0.0 * torque}, n=3)
    assert list(np.flatnonzero(many.failed)) == [4]
    assert many.t[4] == 0.0 < many.t[5]
    for ours, theirs in zip(jax.tree.leaves(many.state), jax.tree.leaves(frozen), strict=True):
        assert np.array_equal(ours[4], theirs[4])
    many.reset(mask=many.failed)
    many.step()
    assert not many.failed.any()
    assert many.t[4] == H
    spin = np.full(count, 0.1)
    spin[7] = np.nan
    many.step({"spin": spin})
    assert "the command `spin` is not finite" in many.failures[7]


@pytest.mark.long
def test_members_have_parameters_of_their_own():
    heavy = BODY.replace(lag=co.each([0.1, 0.2, 0.4]))
    body = co.Stepper(heavy, START, dt=H, inputs=REST, observe=OBSERVE)
    for command in commands(20):
        body.step(command)
    for member, lag in enumerate([0.1, 0.2, 0.4]):
        alone = co.Stepper(BODY.replace(lag=lag), START, dt=H, inputs=REST, observe=OBSERVE)
        for command in commands(20):
            alone.step(command)
        np.testing.assert_allclose(body.observation["xi"][member], alone.observation["xi"], rtol=1e-12)


def test_arrays_go_out_by_dlpack(many):
    many.reset()
    seen = many.step(copy=True)
    np.testing.assert_array_equal(np.from_dlpack(seen["xi"]), seen["xi"])
    with co.float64():
        assert jnp.asarray(seen["xi"]).dtype == np.float64


# XLA, events, failures.


@pytest.mark.long
def test_xla_steps_what_native_code_cannot_with_the_same_face():
    wheel = co.System(
        co.SO2(),
        lambda xi, p: 0.5 * p.inertia * xi[0] ** 2,
        parameters=co.Parameters(inertia=2.0, grip=1.0),
        forces=lambda motion, p: co.Force(torque=p.grip * motion.inputs.torque - 0.1 * motion.xi),
    )
    start = wheel.state(xi=co.each([[0.1], [0.2], [0.3]]))
    options = {"dt": 0.1, "inputs": {"torque": [0.0]}, "observe": {"xi": lambda s: s.xi, "t": lambda s: s.t}}
    native, by_xla = (co.Stepper(wheel, start, **options, backend=backend) for backend in ("native", "xla"))
    for torque in np.random.default_rng(SEED).normal(size=(10, 3, 1)):
        native.step({"torque": torque}, 2)
        by_xla.step({"torque": torque}, 2)
    for name, ours in native.observation.items():
        np.testing.assert_allclose(by_xla.observation[name], ours, rtol=1e-13)
    by_xla.change(grip=0.5)  # nothing is compiled in
    with pytest.warns(UserWarning, match="compiled anew"):
        native.change(grip=0.5)
    for body in (by_xla, native):
        body.step({"torque": 1.0 * np.ones((3, 1))}, 2)
    np.testing.assert_allclose(by_xla.observation["xi"], native.observation["xi"], rtol=1e-13)
    by_xla.step({"torque": [[0.0], [np.nan], [0.0]]})
    assert list(by_xla.failed) == [False, True, False]
    by_xla.reset()
    assert np.array_equal(by_xla.state.xi, start.xi)


@pytest.mark.long
def test_an_event_ends_a_stepper_where_it_ends_a_run():
    until = lambda state: state.mu[2] - 1.8  # noqa: E731
    body = stepper(until=until)
    held = {name: lambda motion, value=value: value for name, value in REST.items()}
    run = co.simulate(BODY, START, dt=H, steps=400, inputs=held, monitors=False, until=until)
    assert run.event is not None
    for _ in range(400):
        body.step()
        if body.ended:
            break
    assert body.event == pytest.approx(run.event, rel=1e-12)
    assert body.observation["t"] == body.event
    with pytest.raises(StepError, match="came at t ="):
        body.step()
    body.reset()
    assert body.event is None


def test_a_failed_step_raises_a_sentence_until_a_reset(single):
    single.reset()
    single.step()
    with pytest.raises(StepError):
        single.step({"spin": 1e200})
    with pytest.raises(StepError):
        single.step({"spin": 0.1})
    assert single.failure is not None
    assert single.steps == 1
    single.reset()
    assert single.failure is None
    single.step()


def test_an_observation_that_is_not_finite_raises():
    body = stepper(observe={"odd": lambda s: 1.0 / (s.t - 2 * H)}, inputs=REST)
    body.step()
    with pytest.raises(StepError, match=r"Observation `odd` is not finite at t = 0\.04 s"):
        body.step()
