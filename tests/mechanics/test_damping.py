"""Damping: what it takes is what its dissipation function says, and at rest it is smooth."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.state import Motion
from systems import flat, random_system


def moving(world: str) -> tuple[co.System, Motion]:
    system, start = random_system(world)
    return system, system.motion(start.xi, start.n, start.nu, start.a, start.t)


@pytest.mark.parametrize("world", ["SO3", "SE3", "SO3 alone"])
@pytest.mark.parametrize("degree", [2, 3, 4])
def test_a_dissipation_function_of_degree_d_takes_d_times_itself(world, degree):
    """⟨T, ξ⟩ + ⟨f, ν⟩ = −d·R by Euler's theorem, also on several spaces with names."""
    _, motion = moving(world)

    def R(motion, p):
        v = jnp.concatenate([motion.xi, flat(motion.nu)])
        return p * jnp.sum(jnp.abs(v) ** degree)

    def power_and_loss(motion):
        force = co.mechanics.rayleigh(R)(motion, 0.7)
        return force.torque @ motion.xi + flat(force.force) @ flat(motion.nu), R(motion, 0.7)

    power, loss = evaluate(power_and_loss, motion)
    assert power == pytest.approx(-degree * loss, rel=1e-13)


@pytest.mark.long
def test_a_quadratic_dissipation_function_is_linear_drag_in_a_run():
    p = co.Parameters(D=[[2.0, 0.5, 0.0], [0.5, 1.0, 0.2], [0.0, 0.2, 3.0]])
    by_hand = {"drag": lambda motion, p: co.Force(torque=-p.D @ motion.xi)}
    derived = {"drag": co.mechanics.rayleigh(lambda motion, p: 0.5 * motion.xi @ p.D @ motion.xi)}
    ends = []
    for forces in (by_hand, derived):
        body = co.System(co.SO3(), lambda xi, p: 0.5 * xi @ (jnp.array([3, 2, 1]) * xi), parameters=p, forces=forces)
        ends.append(co.simulate(body, body.state(xi=[0.3, 0.2, 0.1]), dt=0.01, steps=100).final.mu)
    np.testing.assert_allclose(*ends, rtol=1e-13)


@pytest.mark.parametrize("C", [2.0, [1.0, 2.0, 3.0], [[2.0, 0.5, 0.0], [0.5, 1.0, 0.2], [0.0, 0.2, 3.0]]])
def test_quadratic_drag_is_minus_the_gradient_of_a_third_of_the_cube_of_speed(C):
    v = np.array([0.3, -0.4, 1.2])
    C = np.asarray(C)
    matrix = C if C.ndim == 2 else C * np.eye(3)
    np.testing.assert_allclose(evaluate(lambda v: co.mechanics.quadratic_drag(C, v), v), -1.3 * matrix @ v, rtol=1e-14)
    if C.ndim == 0:
        slope = evaluate(jax.grad(lambda v: C / 3 * (v @ v) ** 1.5), v)
        np.testing.assert_allclose(evaluate(lambda v: co.mechanics.quadratic_drag(C, v), v), -slope, rtol=1e-14)


def test_quadratic_drag_is_smooth_at_rest():
    """Its derivative at v = 0 is 0, forward and reverse, and its second derivative is finite."""
    for derivative in (jax.jacfwd, jax.jacrev):
        slope = derivative(lambda v: co.mechanics.quadratic_drag(np.array([1.0, 2.0, 3.0]), v))
        np.testing.assert_array_equal(evaluate(slope, np.zeros(3)), np.zeros((3, 3)))
        assert np.all(np.isfinite(evaluate(jax.jacfwd(slope), np.zeros(3))))
        near = evaluate(slope, np.array([1e-200, 0.0, 0.0]))
        assert np.all(np.isfinite(near)) and np.max(np.abs(near)) < 1e-150


@pytest.mark.long
def test_a_body_with_quadratic_drag_is_integrated_and_differentiated_from_rest():
    def forces(motion, p):
        push = jnp.where(motion.t > 0.25, p.push, 0.0) * jnp.array([1.0, 0.0, 0.0])
        return co.Force(force=co.mechanics.quadratic_drag(p.drag, motion.nu) + push)

    p = co.Parameters(drag=2.0, push=1.0)
    body = co.System(
        co.SO3(), lambda xi, n, nu, p: 0.5 * xi @ xi + 0.5 * nu @ nu, additional=co.Defining(), parameters=p,
        forces=forces,
    )  # fmt: skip
    start = body.state(q=[0, 0, 0])
    run = co.simulate(body, start, dt=0.1, steps=20)
    assert run.final.q[0] > 0.1
    with co.float64():
        slope = jax.grad(lambda drag: co.trajectory(body.replace(drag=drag), start, dt=0.1, steps=20).final.q[0])(2.0)
    assert np.isfinite(slope) and float(slope) < 0


def test_what_is_no_drag_is_refused_in_one_sentence():
    with pytest.raises(co.errors.ArgumentError, match=r"coefficients of shape \(\), \(k,\) or \(k, k\)"):
        co.mechanics.quadratic_drag(np.zeros(2), np.zeros(3))
    with pytest.raises(co.errors.ArgumentError, match="must be a function R"):
        co.mechanics.rayleigh(3.0)
    body = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi, forces=co.mechanics.rayleigh(lambda motion: motion.xi))
    with pytest.raises(co.errors.LagrangianError, match="must return one number"):
        co.simulate(body, body.state(), dt=0.1, steps=1)
