"""One discrete Lagrangian in four settings gives one motion; each setting's own rule from ℓ approaches it at its order.

A heavy body in a fluid: SO(3) with additional dynamics in ℝ³; SE(3); SO(3) Ⓢ ℝ³; discrete Euler–Lagrange equations in
the space frame, and the reduced algorithm with reconstruction.
"""

from __future__ import annotations

from functools import lru_cache

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint import theory
from coadjoint.kernels.trace.evaluate import evaluate
from discrete import at

H, STEPS = 0.1, 200
ROUND_OFF = 2e-12
"""Of 1 + the largest entry after 200 steps; measured 1e-13."""

J = np.diag([1.0, 1.7, 2.3])
D = 0.5 * np.trace(J) * np.eye(3) - J
M = np.diag([1.5, 1.8, 2.2])
C = np.array([[0.0, 0.2, 0.1], [-0.1, 0.0, 0.15], [0.05, 0.1, 0.0]])
WEIGHT, ARM = 0.3, np.array([0.1, 0.05, 0.4])
DOWN = np.array([0.0, 0.0, 1.0])


def core(F, d, a, depth, h):
    """Λ of the rotation F, the displacement d = s − n seen from the body, a = R⁻¹e_z and the depth n·a."""
    turn = co.SO3().vee(F - F.T) / 2
    kinetic = jnp.trace((jnp.eye(3) - F) @ D) + 0.5 * d @ M @ d + d @ C @ turn
    return kinetic / h + h * (WEIGHT * (depth + 0.5 * a @ d) - a @ ARM)


def lagrangian(omega, v, a, depth):
    """ℓ of the same body."""
    return 0.5 * omega @ J @ omega + 0.5 * v @ M @ v + v @ C @ omega + WEIGHT * depth - a @ ARM


def on_rotations(**form):
    return co.System(co.SO3(), additional=co.Defining(), advected=co.Defining(), **form)


def on_motions(group, **form):
    return co.System(group, advected=co.spaces.Dual(), **form)


PRODUCT = co.SemidirectProduct(co.SO3(), co.Defining())
G0 = evaluate(co.SO3().exp, np.array([0.3, -0.2, 0.4]))
Q0 = np.array([0.5, -0.2, 0.8])
F0 = evaluate(co.SO3().exp, H * np.array([0.9, 0.4, 1.5]))
D0 = H * np.array([0.4, -0.3, 0.6])


def unreduced(g, q, g_next, q_next, a0, h):
    return core(g.T @ g_next, g.T @ (q_next - q), g.T @ a0, q @ a0, h)


@lru_cache
def settings():
    """(R, q) of 201 nodes in every setting."""
    n = G0.T @ Q0
    first = theory.Link(F0, n, n + D0, G0.T @ DOWN)
    start, then = theory.Configuration(G0, Q0), theory.Configuration(G0 @ F0, Q0 + G0 @ D0)
    method = co.methods.GroupVariational(co.Exponential())

    def begun(system, link, **place):
        left = evaluate(lambda link: theory.left_momenta(system, link, H), link)
        state = system.state(**place)
        return state.replace(mu=left.mu, pi=left.pi, from_velocities=False)

    found = {}
    system = on_rotations(group_lagrangian=lambda F, n, s, a, h: core(F, s - n, a, n @ a, h))
    state = begun(system, first, g=G0, q=Q0, xi=[0.9, 0.4, 1.5], qdot=G0 @ D0 / H, a0=DOWN)
    run = co.simulate(system, state, dt=H, steps=STEPS, method=method)
    found["SO(3) with ℝ³"] = run.records.g, run.records.q
    for name, group in (("SE(3)", co.SE3()), ("SO(3) Ⓢ ℝ³", PRODUCT)):
        system = on_motions(group, group_lagrangian=lambda F, a, h: core(F[0], F[1], a[:3], a[3], h))
        link = theory.Link((F0, D0), np.zeros(0), np.zeros(0), np.append(G0.T @ DOWN, Q0 @ DOWN))
        state = begun(system, link, g=(G0, Q0), xi=[0.9, 0.4, 1.5, *(D0 / H)], a0=np.append(DOWN, 0.0))
        run = co.simulate(system, state, dt=H, steps=STEPS, method=method)
        found[name] = run.records.g
    L = theory.UnreducedLagrangian(co.SO3(), unreduced, additional=co.Defining(), advected=co.Defining())
    found["unreduced"] = tuple(theory.discrete_euler_lagrange_algorithm(L, start, then, DOWN, H, STEPS))
    system = theory.reduce(L)
    links = theory.discrete_euler_poincare_algorithm(system, first, H, STEPS)
    found["reconstructed"] = tuple(theory.reconstruct(system.places, G0, links))
    return found


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["SE(3)", "SO(3) Ⓢ ℝ³", "unreduced", "reconstructed"])
def test_one_discrete_lagrangian_gives_one_motion_in_every_setting(name):
    R, q = settings()["SO(3) with ℝ³"]
    assert np.max(np.abs(at(q, -1) - Q0)) > 2, "the body must go somewhere"
    for found, expected in zip(settings()[name], (R, q), strict=True):
        np.testing.assert_allclose(found, expected, rtol=0, atol=ROUND_OFF * (1 + np.max(np.abs(expected))))


def ends(rule, h):
    """(R, q) at t = 2 by a rule from ℓ in three settings."""
    omega, v = np.array([0.9, 0.4, 1.5]), D0 / H
    found = []
    system = on_rotations(lagrangian=lambda xi, n, nu, a: lagrangian(xi, nu, a, n @ a))
    state = system.state(g=G0, q=Q0, xi=omega, qdot=G0 @ v, a0=DOWN)
    run = co.simulate(system, state, dt=h, duration=2, method=rule, monitors=False)
    found.append(np.concatenate([np.ravel(run.final.g), run.final.q]))
    for group in (co.SE3(), PRODUCT):
        system = on_motions(group, lagrangian=lambda xi, a: lagrangian(xi[:3], xi[3:], a[:3], a[3]))
        state = system.state(g=(G0, Q0), xi=np.append(omega, v), a0=np.append(DOWN, 0.0))
        run = co.simulate(system, state, dt=h, duration=2, method=rule, monitors=False)
        found.append(np.concatenate([np.ravel(leaf) for leaf in run.final.g]))
    return np.array(found)


@pytest.mark.long
@pytest.mark.parametrize(("rule", "order"), [(co.LeftRectangle(), 1), (co.Midpoint(), 2), (co.Trapezoidal(), 2)])
def test_the_rules_of_the_settings_agree_to_their_order(rule, order):
    """Both products are one group; SO(3) with ℝ³ and SE(3) have other difference maps, so other steps."""
    coarse, fine = (ends(rule, h) for h in (0.02, 0.01))
    for values in (coarse, fine):
        np.testing.assert_allclose(values[2], values[1], rtol=0, atol=1e-12)
    gaps = [np.max(np.abs(values[1] - values[0])) for values in (coarse, fine)]
    assert gaps[1] > 1e-9
    assert abs(np.log2(gaps[0] / gaps[1]) - order) < 0.15
