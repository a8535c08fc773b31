"""With a lagging actuator and a sampled controller every method is of order 2, unless it is of order 1 itself."""

from __future__ import annotations

from functools import lru_cache

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import coadjoint as co

LAG, PERIOD, INERTIA, DRAG, DURATION = 0.3, 0.1, 1.5, 0.4, 2.0
STEPS = (0.05, 0.025, 0.0125)
METHODS = {
    "midpoint": co.Midpoint(),
    "trapezoidal": co.Trapezoidal(),
    "Simpson": co.Simpson(),
    "left and right": co.methods.LeftRight(),
    "energy and momentum": co.EnergyMomentum(),
    "Suzuki": co.Suzuki4(co.Midpoint(), negative_substeps="allow"),
    "Galerkin": co.Galerkin(),
    "left": co.LeftRectangle(),
}


def _rule(motion, h):
    """A digital controller that brakes by the velocity it sees, and the actuator that follows it."""

    def update(last):
        return {"torque": jnp.sin(motion.t) - 2.0 * motion.xi[0]}

    controller = co.mechanics.sampled(motion, h, motion.internal.controller, update, period=PERIOD)
    u, x, kept = controller["value"].torque, motion.internal.motor, jnp.exp(-h / LAG)
    return {
        "controller": controller,
        "motor": co.mechanics.Course(u + (x - u) * kept, u + (x - u) * (1 - kept) * LAG / h),
    }


def _forces(motion):
    return co.Force(torque=jnp.stack([motion.internal.motor]) - DRAG * motion.xi * jnp.abs(motion.xi))


def body(rule=_rule):
    system = co.System(co.SO2(), lambda xi: 0.5 * INERTIA * xi @ xi, forces=_forces, internal=rule)
    return system, system.state(xi=[0.5], internal={"motor": 0.0, "controller": co.mechanics.sampling({"torque": 0.0})})


@lru_cache
def exact() -> np.ndarray:
    """(θ, ω) at the samples, by DOP853 that begins anew at each of them."""
    y, rows = np.array([0.0, 0.5, 0.0]), [np.array([0.0, 0.5])]
    for t in PERIOD * np.arange(round(DURATION / PERIOD)):
        u = np.sin(t) - 2.0 * y[1]

        def rate(t, y, u=u):
            return [y[1], (y[2] - DRAG * y[1] * abs(y[1])) / INERTIA, (u - y[2]) / LAG]

        y = solve_ivp(rate, (t, t + PERIOD), y, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
        rows.append(y[:2])
    return np.array(rows)


def error(method, dt, rule=_rule):
    """The largest error of θ and ω at the samples."""
    system, start = body(rule)
    run = co.simulate(system, start, dt=dt, duration=DURATION, method=method, monitors=False)
    every = round(PERIOD / dt)
    g, mu = run.records.g[::every], run.records.mu[::every, 0]
    found = np.stack([np.arctan2(g[:, 1, 0], g[:, 0, 0]), mu / INERTIA], axis=1)
    return float(np.max(np.abs(found - exact())))


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_the_order_with_an_actuator_and_a_sampled_controller(method):
    errors = [error(method, dt) for dt in STEPS]
    slopes = np.log2(np.divide(errors[:-1], errors[1:]))
    assert slopes == pytest.approx([min(method.order, 2)] * 2, abs=0.1)
    assert errors[0] < (2e-4 if method.order > 1 else 2e-2)


def _held(motion, h):
    """The mistake of an actuator that stays where it is at the node."""
    found = _rule(motion, h)
    return {**found, "motor": co.mechanics.Course(found["motor"].end, motion.internal.motor)}


def _late(motion, h):
    """The mistake of a command that acts a step late."""
    found, x, kept = _rule(motion, h), motion.internal.motor, jnp.exp(-h / LAG)
    u = motion.internal.controller.value.torque
    return {**found, "motor": co.mechanics.Course(u + (x - u) * kept, u + (x - u) * (1 - kept) * LAG / h)}


@pytest.mark.cases(1)
@pytest.mark.parametrize("rule", [_held, _late])
def test_each_mistake_alone_leaves_order_one(rule):
    coarse, fine = (error(co.Midpoint(), dt, rule) for dt in STEPS[1:])
    assert np.log2(coarse / fine) == pytest.approx(1.0, abs=0.15)


def test_a_rule_sees_the_velocity_of_the_momenta_at_its_node():
    def rule(motion, h):
        return {"motor": 0.0 * h, "seen": co.mechanics.jumped(motion.xi[0])}

    system = co.System(co.SO2(), lambda xi: 0.5 * INERTIA * xi @ xi, forces=_forces, internal=rule)
    start = system.state(xi=[0.5], internal={"motor": 0.0, "seen": 0.0})
    run = co.simulate(system, start, dt=0.1, steps=20, monitors=False)
    seen = run.dataset.internal_seen.values
    np.testing.assert_allclose(seen, run.dataset.mu[:, 0] / INERTIA, rtol=1e-13)
    assert np.max(np.abs(seen[1:] - run.dataset.xi.values[:-1, 0])) > 1e-3


def test_an_actuator_follows_a_signal_by_its_value_in_the_middle_of_the_step():
    def rule(motion, h):
        return {"motor": co.mechanics.jumped(motion.ahead)}

    system = co.System(co.SO2(), lambda xi: 0.5 * INERTIA * xi @ xi, forces=_forces, internal=rule)
    start = system.state(internal={"motor": 0.0})
    run = co.simulate(system, start, dt=0.1, steps=20, inputs=co.Linear([0.0, 9.0], [0.0, 9.0]), monitors=False)
    np.testing.assert_allclose(run.dataset.internal_motor, run.dataset.time + 0.05, rtol=1e-13)


def test_what_is_replaced_in_a_record_is_held_over_its_step_and_gone_on_from():
    system, start = body()
    record = co.simulate(system, start, dt=0.1, steps=5, monitors=False).final
    changed = record.replace(internal=record.internal.replace(motor=np.float64(3.0)))
    run = co.simulate(system, changed, dt=0.1, steps=2, monitors=False)
    torque = 3.0 - DRAG * run.records.xi[0, 0] * abs(run.records.xi[0, 0])
    assert run.dataset.mu[1, 0] - run.dataset.mu[0, 0] == pytest.approx(0.1 * torque, rel=1e-12)
    u = float(run.records.internal.controller.value.torque[1])
    kept = np.exp(-0.1 / LAG)
    assert float(run.records.internal_end.motor[1]) == pytest.approx(u + (3.0 - u) * kept, rel=1e-13)
