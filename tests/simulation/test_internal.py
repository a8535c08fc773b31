"""Internal states: actuators, filters and digital controllers, taken over a step by a rule of their own."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.mechanics.members import Each

LAG = 0.3
H = 0.02


def _lag(motion, h, p):
    """τ ẋ = u − x over a step with u held: the exact solution."""
    return {"rudder": _lagging(motion.internal.rudder, p.command, h, p.lag)}


def _lagging(x, u, h, lag):
    kept = jnp.exp(-h / lag)
    return co.mechanics.Course(u + (x - u) * kept, u + (x - u) * (1 - kept) * lag / h)


def _torque(motion, p):
    return co.Force(torque=motion.internal.rudder * jnp.ones(1))


def body(rule=_lag, **parameters):
    p = {"lag": LAG, "command": 1.0, "inertia": 2.0, **parameters}
    return co.System(
        co.SO2(), lambda xi, p: 0.5 * p.inertia * xi @ xi, parameters=co.Parameters(**p), forces=_torque, internal=rule
    )


def test_an_actuator_with_a_lag_follows_its_closed_form_and_pushes_the_body():
    system = body()
    run = co.simulate(system, system.state(internal={"rudder": 0.0}), dt=H, steps=200)
    t = run.dataset.time.values
    rudder = 1 - np.exp(-t / LAG)
    np.testing.assert_allclose(run.dataset.internal_rudder, rudder, atol=1e-13)
    # Forces have the mean over the step: the momentum is the integral of the rudder.
    np.testing.assert_allclose(run.dataset.mu[:, 0], t - LAG * rudder, atol=1e-13)
    assert float(run.dataset.work_forces[-1]) == pytest.approx(float(run.dataset.energy[-1]), rel=(H / LAG) ** 2)


@pytest.mark.cases(1)
@pytest.mark.parametrize("backend", ["native", pytest.param("xla", marks=pytest.mark.long)])
def test_the_rule_is_applied_once_a_step_whatever_the_stages_and_the_backend(backend):
    system = body(lambda motion, h, p: {"rudder": motion.internal.rudder + h})
    start = system.state(internal={"rudder": 0.0})
    for method in (co.methods.LeftRight(co.Cayley()), co.Suzuki4(co.Midpoint(), negative_substeps="allow")):
        run = co.simulate(system, start, dt=0.125, steps=8, method=method, backend=backend, monitors=False)
        np.testing.assert_array_equal(run.dataset.internal_rudder, run.dataset.time)


# A digital PID on the angle of a body with a motor that lags: the angle is measured by a vector of the space frame.
def _controller(motion, h, p):
    held = motion.internal.controller
    error = jnp.arctan2(motion.a[1], motion.a[0]) + p.target  # a = R⁻¹e₁ = (cos θ, −sin θ)

    def update(last):
        integral = jnp.clip(last.integral + p.period * error, -0.5, 0.5)
        slope = (error - last.error) / p.period
        return {"torque": jnp.clip(4 * error + integral + 3 * slope, -2, 2), "integral": integral, "error": error}

    controller = co.mechanics.sampled(motion, h, held, update, period=p.period, delay=p.delay)
    return {
        "controller": controller,
        "rudder": _lagging(motion.internal.rudder, controller["value"].torque, h, p.lag),
    }


def turntable(**changes):
    p = co.Parameters(**{"lag": 0.05, "period": 0.1, "delay": 0.04, "target": 1.0, "inertia": 1.0, **changes})
    return co.System(
        co.SO2(),
        lambda xi, a, p: 0.5 * p.inertia * xi @ xi,
        advected=co.Defining(),
        parameters=p,
        forces=_torque,
        internal=_controller,
    )


def begin(system):
    controller = co.mechanics.sampling({"torque": 0.0, "integral": 0.0, "error": 1.0})
    return system.state(a0=[1.0, 0.0], internal={"rudder": 0.0, "controller": controller})


def same(one, other):
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_sampled_pid_turns_a_body_to_its_target_and_holds_its_torque_between_samples():
    system = turntable()
    run = co.simulate(system, begin(system), dt=H, duration=20, monitors=False)
    assert run.dataset.a[-1, 0] == pytest.approx(np.cos(1.0), abs=2e-3)
    torque = run.dataset.internal_controller_value_torque.values
    changes = np.flatnonzero(np.diff(torque[: int(2 / H)])) + 1
    # Samples at multiples of 0.1 s, in force 0.04 s later: nodes 2, 7, 12, …
    assert set(changes % 5) == {2}
    assert np.max(np.abs(torque)) == 2.0


@pytest.mark.long
def test_a_sampled_pid_is_the_same_to_the_bit_under_any_save_every_after_resume_and_from_a_record(tmp_path):
    system = turntable()
    start = begin(system)
    whole = co.simulate(system, start, dt=H, steps=200)
    for every in (7, 50, 200):
        same(co.simulate(system, start, dt=H, steps=200, save_every=every).final, whole.final)
    path = co.trajectory(system, start, dt=H, steps=200)
    np.testing.assert_array_equal(path.final.mu, whole.final.mu)
    middle = jax.tree.map(lambda leaf: leaf[90], whole.records)
    same(co.simulate(system, middle, dt=H, steps=110).final.internal, whole.final.internal)
    same(whole.at([90 * H + 1e-12]).internal, jax.tree.map(lambda leaf: leaf[90:91], whole.records).internal)
    for part in (0.25, 3.25):  # Between nodes the internal state goes straight along its course.
        record = jax.tree.map(lambda leaf, k=90 + int(part): leaf[k : k + 1], whole.records)
        found = whole.at([(90 + part) * H])
        same(found.internal.controller, record.internal.controller)
        expected = 0.75 * record.internal.rudder + 0.25 * record.internal_end.rudder
        np.testing.assert_allclose(found.internal.rudder, expected, rtol=1e-14)
    stored = co.simulate(system, start, dt=H, steps=200, store=tmp_path / "run", save_every=10)
    same(co.resume(tmp_path / "run", system).final, stored.final)
    same(stored.final.internal, whole.final.internal)
    with pytest.raises(co.errors.ArgumentError, match="holds another run"):
        co.resume(tmp_path / "run", system.replace(period=0.2))


def test_an_event_ends_a_run_in_the_middle_of_a_step_of_a_sampled_controller():
    system = turntable()
    run = co.simulate(system, begin(system), dt=H, duration=20, until=lambda s: s.a[0] - jnp.cos(0.5), monitors=False)
    assert run.event is not None and run.final.a[0] == pytest.approx(np.cos(0.5), abs=1e-12)


def test_every_member_has_an_internal_state_of_its_own():
    system = body().replace(lag=co.each([0.1, 0.3, 0.9]))
    run = co.simulate(system, system.state(internal={"rudder": 0.0}), dt=H, steps=50, monitors=False)
    expected = 1 - np.exp(-run.dataset.time.values / np.array([[0.1], [0.3], [0.9]]))
    np.testing.assert_allclose(run.dataset.internal_rudder, expected, atol=1e-13)


@pytest.mark.parametrize("lag", [0.3, co.each([0.1, 0.3, 0.9])], ids=["one lag", "lags of their own"])
def test_every_member_may_start_from_an_internal_state_of_its_own(lag):
    system = body().replace(lag=lag)
    first = np.array([[0.0], [0.5], [2.0]])
    run = co.simulate(system, system.state(internal={"rudder": co.each(first[:, 0])}), dt=H, steps=50, monitors=False)
    lags = np.reshape(lag.values if isinstance(lag, Each) else lag, (-1, 1))
    expected = 1 + (first - 1) * np.exp(-run.dataset.time.values / lags)
    np.testing.assert_allclose(run.dataset.internal_rudder, expected, atol=1e-13)


@pytest.mark.long
@pytest.mark.parametrize("backend", ["native", "xla"])
def test_gradients_go_through_the_internal_state(backend):
    system = body()
    start = system.state(internal={"rudder": 0.0})

    def momentum(lag):
        path = co.trajectory(system.replace(lag=lag), start, dt=H, steps=50, backend=backend)
        return path.final.mu[0]

    with co.float64():
        slope = jax.grad(momentum)(LAG)
    t = H * 50
    assert slope == pytest.approx(-(1 - np.exp(-t / LAG)) + t / LAG * np.exp(-t / LAG), rel=1e-12)


def test_the_rule_enters_the_version_of_a_program():
    """A rule that reads a global number is another rule when that number has changed."""
    step = 1.0
    system = body(lambda motion, h, p: {"rudder": motion.internal.rudder + step})
    start = system.state(internal={"rudder": 0.0})
    assert co.simulate(system, start, dt=H, steps=3).final.internal.rudder == 3.0
    step = 2.0
    assert co.simulate(system, start, dt=H, steps=3).final.internal.rudder == 6.0


def _run(rule, internal):
    system = body(rule)
    co.simulate(system, system.state(internal=internal), dt=H, steps=3)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: _run(_lag, None), "give its start"),
        (lambda: _run(_lag, 3.0), "must be a dictionary"),
        (lambda: _run(_lag, {}), "must be a dictionary"),
        (lambda: _run(_lag, {"rudder": np.nan}), "`internal.rudder` must be finite"),
        (lambda: _run(_lag, {"rudder": np.float32(1)}), "must be float64"),
        (
            lambda: body().replace(lag=co.each([1.0, 2.0, 3.0])).state(internal={"rudder": co.each([1.0, 2.0])}),
            "[2, 3]",
        ),
        (lambda: _run(_lag, {"other": 1.0}), "no `rudder`"),
        (lambda: _run(lambda motion, h: {}, {"rudder": 0.0}), "must take (motion, h, p)"),
        (
            lambda: _run(lambda motion, h, p: {"fin": h}, {"rudder": 0.0}),
            "must return the state that it advances, `rudder` a num",
        ),
        (lambda: _run(lambda motion, h, p: {"rudder": h * np.ones(2)}, {"rudder": 0.0}), "of shape (2,)"),
        (lambda: _run(lambda motion, h, p: h, {"rudder": 0.0}), "must return the state that it advances"),
        (lambda: _run(lambda motion, h, p: {"rudder": motion.t / motion.t}, {"rudder": 0.0}), "not finite after"),
        (lambda: _run(lambda motion, h, p: {"rudder": jnp.float32(0.1) * h}, {"rudder": 0.0}), "holds float32"),
        (lambda: _run(lambda motion, h, p: {"rudder": "port"}, {"rudder": 0.0}), "could not convert"),
        (lambda: co.simulate(turntable(delay=0.2), begin(turntable(delay=0.2)), dt=H, steps=2), "0 ≤ delay ≤ period"),
    ],
)
def test_what_cannot_be_an_internal_state_is_refused_in_one_sentence(make, words):
    with pytest.raises(co.errors.CoadjointError) as caught:
        make()
    assert words in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.cases(1)
@pytest.mark.parametrize("backend", ["native", pytest.param("xla", marks=pytest.mark.long)])
def test_a_rule_is_applied_once_a_step_and_not_again_where_a_run_goes_on_from_a_record(backend):
    system = body(lambda motion, h, p: {"rudder": co.mechanics.jumped(motion.internal.rudder + 1)})
    given = {"dt": 0.1, "progress": False, "backend": backend}
    run = co.simulate(system, system.state(internal={"rudder": 0.0}), steps=6, **given, monitors=False)
    np.testing.assert_array_equal(run.records.internal.rudder, np.arange(1.0, 8.0))
    record = jax.tree.map(lambda leaf: leaf[4], run.records)
    again = co.simulate(system, record, steps=2, **given, monitors=False)
    np.testing.assert_array_equal(again.records.internal.rudder, [5.0, 6.0, 7.0])


def test_a_rule_that_becomes_infinite_ends_the_run_at_the_last_good_node():
    system = body(lambda motion, h, p: {"rudder": motion.internal.rudder / (0.5 - motion.t)})
    with pytest.raises(co.errors.StepError, match="not finite") as caught:
        co.simulate(system, system.state(internal={"rudder": 1.0}), dt=0.125, steps=20)
    run = caught.value.run
    assert run is not None and np.all(np.isfinite(run.records.internal.rudder))
