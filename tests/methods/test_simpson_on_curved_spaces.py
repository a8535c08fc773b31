"""Simpson's rule over parabolas on spheres, and variable steps over it: one-sided energy, orders, conservation."""

from __future__ import annotations

import numpy as np
import pytest
from test_galerkin_on_curved_spaces import PENDULUM, START, pendulum_at

import coadjoint as co
from coadjoint.audit.systems import PROBLEMS
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.methods.simpson import sagitta
from coadjoint.theory.equations import printed_equations

BODY = PROBLEMS["pendulum on body"]
VARIABLE = co.methods.VariableStep()


def test_the_middle_of_two_points_of_a_sphere_is_on_it_up_to_sixth_order():
    """Halfway along the great circle: |x̄| = 1 − O(h⁶), in the direction of x + y; on a flat space e = 0."""
    off = []
    for angle in (0.4, 0.2):
        x = np.array([0.6, 0.0, 0.8])
        y = np.cos(angle) * x + np.sin(angle) * np.array([0.0, 1.0, 0.0])
        middle = 0.5 * (x + y) + evaluate(lambda x, y: sagitta(PENDULUM, x, y), x, y)
        off.append(1 - np.linalg.norm(middle))
        np.testing.assert_allclose(np.cross(middle, x + y), 0, atol=1e-15)
    assert 0 < off[0] < 5e-5 and np.log2(off[0] / off[1]) == pytest.approx(6, abs=0.1)


@pytest.mark.long
def test_variable_steps_follow_the_spherical_pendulum_with_order_two():
    """Against DOP853 at the times where the steps lead, over the exponential, which a group without motion needs."""
    errors = []
    for steps in (40, 80):
        run = co.simulate(PENDULUM, START, dt=2.0 / steps, steps=steps, method=VARIABLE)
        t = float(run.records.t[-1])
        errors.append(np.max(np.abs(run.final.n - pendulum_at(t))))
        assert run.summary()["steps_fixed"] == 0
        energies = run.dataset.discrete_energy.values
        assert np.max(np.abs(energies - energies[0])) < 1e-14 * 10
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.3)


@pytest.mark.long
def test_variable_steps_keep_energy_and_momentum_of_a_body_with_a_pendulum():
    run = co.simulate(BODY.system, BODY.start, dt=0.05, steps=2000, method=VARIABLE)
    summary = run.summary()
    assert summary["steps_fixed"] == 0 and 0.5 < summary["step_size_min"] / 0.05 < summary["step_size_max"] / 0.05 < 2
    energies = run.dataset.discrete_energy.values
    assert np.ptp(energies) < 1e-14 and np.ptp(run.dataset.energy.values) > 1e-5
    assert run.relative_change("kelvin_noether") < 1e-13


@pytest.mark.long
def test_the_discrete_energy_of_simpson_stays_on_one_side_where_that_of_chords_crosses():
    """E of the rule less ℋ at the node where its step begins, along the pendulum alone."""
    signs = []
    for method in (co.Simpson(), co.Trapezoidal()):
        run = co.simulate(PENDULUM, START, dt=0.02, steps=400, method=method)
        gap = run.dataset.discrete_energy.values - run.dataset.energy.values
        signs.append((np.min(gap[1:-1]), np.max(gap[1:-1])))
    assert signs[0][1] < 0 and signs[1][0] < 0 < signs[1][1]


@pytest.mark.long
def test_the_printed_equations_hold_for_simpson_on_a_sphere_with_friction():
    rub = {"rub": lambda motion, p: co.Force(torque=-0.1 * motion.xi, force=-0.2 * motion.nu)}
    run = co.simulate(BODY.system.with_forces(rub), BODY.start, dt=0.1, steps=4, method=co.Simpson())
    assert printed_equations(run).worst.largest < 1e-13
