"""The energy–momentum method on spheres and on a group as a space: energy, momenta, order, reversal, friction."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from test_galerkin_on_curved_spaces import PENDULUM, START, pendulum_at
from test_group_itself import sprung, system_on

import coadjoint as co
from coadjoint.audit.one_step import irreversibility
from coadjoint.audit.stepper import AuditStepper
from coadjoint.audit.systems import PROBLEMS

BODY = PROBLEMS["pendulum on body"]
EXACT = co.EnergyMomentum()


def test_a_spherical_pendulum_keeps_its_energy_and_its_sphere():
    run = co.simulate(PENDULUM, START, dt=0.1, steps=10, method=EXACT)
    assert np.ptp(run.dataset.energy.values) < 5e-15
    assert abs(run.final.n @ run.final.n - 1) < 1e-14 and abs(run.final.n @ run.final.pi) < 1e-14


@pytest.mark.long
def test_a_spherical_pendulum_has_order_two():
    errors = []
    for steps in (20, 40):
        end = co.trajectory(PENDULUM, START, dt=2.0 / steps, steps=steps, method=EXACT).final
        errors.append(np.max(np.abs(end.n - pendulum_at(2.0))))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)


@pytest.mark.long
@pytest.mark.parametrize("tau", [co.Cayley(), co.Exponential()])
def test_a_body_with_a_pendulum_keeps_energy_and_momentum_and_its_steps_are_reversible(tau):
    method = co.EnergyMomentum(tau)
    run = co.simulate(BODY.system, BODY.start, dt=0.1, steps=2000, method=method)
    assert np.ptp(run.dataset.energy.values) < 2e-13
    assert run.relative_change("kelvin_noether") < 1e-13
    stepper = AuditStepper(method, BODY.system, BODY.start)
    stepper.begin(0.1)
    assert irreversibility(stepper, 0.1) < 1e-13
    ends = [co.trajectory(BODY.system, BODY.start, dt=2 / n, steps=n, method=method).final for n in (20, 40, 80)]
    coarse, fine = (np.linalg.norm(one.mu - other.mu) for one, other in pairwise(ends))
    assert np.log2(coarse / fine) == pytest.approx(2, abs=0.1)


@pytest.mark.long
def test_friction_takes_its_work_from_the_energy():
    rub = {"rub": lambda motion, p: co.Force(torque=-0.1 * motion.xi, force=-0.2 * motion.nu)}
    run = co.simulate(BODY.system.with_forces(rub), BODY.start, dt=0.1, steps=40, method=EXACT)
    assert run.summary()["energy_budget_error_max"] < 1e-12 and np.ptp(run.dataset.energy.values) > 0.05
    assert run.summary()["balance_max"] < 1e-14


@pytest.mark.long
def test_a_body_on_the_group_as_a_space_keeps_energy_and_momentum():
    system, start = system_on(sprung)
    run = co.simulate(system, start, dt=0.02, steps=50, method=EXACT)
    assert np.ptp(run.dataset.energy.values) < 5e-14 and run.relative_change("kelvin_noether") < 1e-13
    inner = run.final.n.reshape(3, 3)
    np.testing.assert_allclose(inner.T @ inner, np.eye(3), atol=1e-13)


def _on_a_body(lagrangian, **start):
    body = co.System(co.SO3(), lagrangian, additional=co.Sphere(), advected=co.Defining())
    return body, body.state(a0=[0, 0, 1], **start)


@pytest.mark.long
def test_a_swing_passes_its_turning_points_and_q_may_rest_in_space():
    inertia = np.array([2.0, 1.5, 1.2])
    swing = _on_a_body(lambda xi, n, nu, a: 0.5 * xi @ (inertia * xi) + 0.5 * nu @ nu - n @ a, q=[0.6, 0, -0.8])
    free = _on_a_body(
        lambda xi, n, nu, a: 0.5 * xi @ (inertia * xi) * (1 + 0.1 * xi @ xi) + 0.5 * nu @ nu,
        q=[0.6, 0, -0.8], xi=[0.4, -0.3, 0.7],
    )  # fmt: skip
    for system, start in (swing, free):
        run = co.simulate(system, start, dt=0.1, steps=5000, method=EXACT)
        assert np.ptp(run.dataset.energy.values) < 1e-13


@pytest.mark.long
def test_a_body_comes_to_rest_by_friction():
    rub = {"rub": lambda motion, p: co.Force(torque=-0.5 * motion.xi, force=-0.5 * motion.nu)}
    run = co.simulate(BODY.system.with_forces(rub), BODY.start, dt=0.1, steps=3000, method=EXACT)
    assert run.summary()["energy_budget_error_max"] < 1e-12
    assert np.max(np.abs(run.final.xi)) < 1e-12 and np.max(np.abs(run.final.pi)) < 1e-12
