"""Additional dynamics on a group itself: a rigid body inside a carrier, by multiplication and by conjugation."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from stepping import Stepper
from systems import generator

J_CARRIER, J_BODY = np.diag([2.0, 1.5, 1.2]), np.array([0.9, 0.6, 0.4])


def _body_velocity(n, nu):
    """Ω with ν = nΩ^×: the body velocity of the inner body, whatever the carrier does."""
    return co.SO3().vee(n.T @ nu)


def free(xi, n, nu):
    return 0.5 * xi @ J_CARRIER @ xi + 0.5 * _body_velocity(n, nu) @ (J_BODY * _body_velocity(n, nu))


def sprung(xi, n, nu):
    """A torsion spring holds the inner body to the carrier: n is its attitude seen from there."""
    return free(xi, n, nu) + 0.8 * (n[0, 0] + n[1, 1] + n[2, 2])


@lru_cache
def system_on(lagrangian) -> tuple[co.System, co.State]:
    system = co.System(co.SO3(), lagrangian, additional=co.spaces.GroupItself(), name="body in a carrier")
    Q0, omega = co.attitude.zyx(0.5, -0.3, 0.2), np.array([0.4, 1.1, -0.7])
    start = system.state(
        g=co.attitude.zyx(-0.3, 0.2, 0.5), q=Q0, qdot=Q0 @ evaluate(co.SO3().hat, omega), xi=[0.5, -0.2, 0.9]
    )
    return system, start


def end_of(lagrangian, method, steps, duration=0.5):
    system, start = system_on(lagrangian)
    return Stepper(system, method, compiled=True).final(start, duration / steps, steps)


@pytest.mark.long
def test_a_body_in_a_carrier_that_it_does_not_feel_moves_as_a_free_body():
    """q = gn follows Euler's equations of its own: the reference is a free body alone, by the exponential, order 4."""
    alone = co.System(co.SO3(), lambda xi: 0.5 * xi @ (J_BODY * xi), name="alone")
    _, start = system_on(free)
    method = co.Suzuki4(co.Midpoint(co.Exponential()))
    lone = alone.state(g=start.q.reshape(3, 3), xi=[0.4, 1.1, -0.7])
    expected = Stepper(alone, method, compiled=True).final(lone, 0.5 / 200, 200)
    found = end_of(free, co.Suzuki4(co.Midpoint()), 100)
    np.testing.assert_allclose(found.q.reshape(3, 3), expected.g, rtol=0, atol=1e-9)


@pytest.mark.long
def test_the_rule_has_its_order_on_a_group_as_a_space():
    exact = end_of(sprung, co.Suzuki4(co.Midpoint()), 160)

    def error(steps):
        end = end_of(sprung, co.Midpoint(), steps)
        return max(np.max(np.abs(getattr(end, k) - getattr(exact, k))) for k in ("g", "n", "mu", "pi"))

    assert np.log2(error(20) / error(40)) == pytest.approx(2, abs=0.1)


@pytest.mark.long
def test_momentum_and_the_group_are_kept_over_a_thousand_steps():
    """All three spatial momenta, relative to |μ| + |π|, and RᵀR = 1 of the inner body seen from the carrier."""
    system, start = system_on(sprung)
    run = co.simulate(system, start, dt=0.02, steps=1000, save_every=50)
    assert run.relative_change("kelvin_noether") < 1e-13
    inner = run.records.n.reshape(-1, 3, 3)
    assert np.max(np.abs(np.swapaxes(inner, 1, 2) @ inner - np.eye(3))) < 1e-12
    energy = run.dataset.energy.values
    first, last = (np.max(np.abs(half / energy[0] - 1)) for half in np.array_split(energy, 2))
    assert last < 1.2 * first < 1e-2


def test_conjugation_moves_a_rotation_with_its_axis():
    """g·x = gxg⁻¹ turns the axis of x by g and keeps its angle; ξ·x = ξ̂x − xξ̂."""
    group, space = co.SO3(), co.spaces.GroupItself("conjugation")
    axis, xi = generator("axis").normal(size=(2, 3))
    g = co.attitude.zyx(0.4, 0.3, -0.8)

    def both(g, axis, xi):
        x = group.exp(axis)
        moved = space.view(group, space.act(group, g, x.reshape(-1)))
        along = space.view(group, space.infinitesimal(group, xi, x.reshape(-1)))
        return (moved, group.exp(g @ axis)), (along, group.hat(xi) @ x - x @ group.hat(xi))

    for found, expected in evaluate(both, g, axis, xi):
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)
