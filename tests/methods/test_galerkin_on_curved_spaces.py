"""Galerkin's methods on spheres and on a group as a space: orders, closed forms, momenta, the two-form, friction."""

from __future__ import annotations

from functools import lru_cache

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_curved import OtherChart

import coadjoint as co
from coadjoint.audit.one_step import irreversibility, symplectic_defect
from coadjoint.audit.stepper import AuditStepper
from coadjoint.audit.systems import PROBLEMS
from coadjoint.methods.quadrature import gauss, lobatto
from coadjoint.theory.equations import printed_equations

BODY = PROBLEMS["pendulum on body"]
DOWN = np.array([0.0, 0.0, 1.0])
PENDULUM = co.System(
    co.Translation(0),
    lambda xi, n, nu: 0.5 * nu @ nu + n @ DOWN,
    additional=co.Sphere(co.Trivial(3)),
    name="spherical pendulum",
)
START = PENDULUM.state(q=[0.6, 0.0, 0.8], qdot=[0.4, 0.9, -0.3])


@lru_cache
def pendulum_at(time: float) -> np.ndarray:
    """q of q̈ = e_z − (e_z·q + |q̇|²)q, by DOP853."""

    def rate(t, y):
        q, v = y[:3], y[3:]
        return np.concatenate([v, DOWN - (DOWN @ q + v @ v) * q])

    y0 = np.concatenate([START.q, START.qdot])
    return solve_ivp(rate, (0, time), y0, method="DOP853", rtol=1e-13, atol=1e-14).y[:3, -1]


def error(degree: int, steps: int) -> float:
    method = co.Galerkin(degree=degree)
    end = co.trajectory(PENDULUM, START, dt=2.0 / steps, steps=steps, method=method).final
    assert abs(end.n @ end.n - 1) < 1e-14
    return float(np.max(np.abs(end.n - pendulum_at(2.0))))


def test_polynomials_through_the_points_have_their_values_and_slopes():
    """For t³ with degree 3: Σ p_j³ M_j = t³, and the velocities 3c_i² lead to p_j³."""
    through, c = lobatto(3), gauss(3).c
    points = np.array([0.0, 0.5 - np.sqrt(0.05), 0.5 + np.sqrt(0.05), 1.0])
    np.testing.assert_allclose(through.value @ points**3, c**3, atol=1e-15)
    np.testing.assert_allclose(through.slope @ points**3, 3 * c**2, atol=1e-14)
    np.testing.assert_allclose(through.reach @ (3 * c**2), points[1:] ** 3, atol=1e-15)


CASES = [(2, 10, 4), *(pytest.param(*case, marks=pytest.mark.long) for case in [(1, 40, 2), (3, 8, 6), (4, 6, 8)])]


@pytest.mark.parametrize(("degree", "steps", "order"), CASES)
def test_the_order_is_twice_the_degree_on_a_spherical_pendulum(degree, steps, order):
    assert np.log2(error(degree, steps) / error(degree, 2 * steps)) == pytest.approx(order, abs=0.3)


@pytest.mark.long
def test_a_free_point_moves_along_a_great_circle():
    free = co.System(
        co.Translation(0), lambda xi, n, nu: 0.5 * nu @ nu, additional=co.Sphere(co.Trivial(3)), name="free point"
    )
    q, v = np.array([0.6, 0.0, 0.8]), np.array([0.4, 0.9, -0.3])
    run = co.simulate(free, free.state(q=q, qdot=v), dt=0.04, steps=100, method=co.Galerkin(degree=3))
    angle = np.linalg.norm(v) * run.records.t[:, None]
    expected = q * np.cos(angle) + v / np.linalg.norm(v) * np.sin(angle)
    np.testing.assert_allclose(run.records.n, expected, rtol=0, atol=1e-12)


@pytest.mark.long
def test_a_body_on_the_group_as_a_space_follows_eulers_equations():
    """q = gn turns as a free body, Q̇ = QΩ̂, whatever its carrier does: DOP853, over time 2."""
    J = np.array([0.9, 0.6, 0.4])

    def lagrangian(xi, n, nu):
        omega = co.SO3().vee(n.T @ nu)
        return 0.5 * xi @ (jnp.array([2.0, 1.5, 1.2]) * xi) + 0.5 * omega @ (J * omega)

    carrier = co.System(co.SO3(), lagrangian, additional=co.spaces.GroupItself(), name="body in a carrier")
    omega, hat = np.array([0.4, 1.1, -0.7]), lambda w: np.cross(w, np.eye(3)).T
    start = carrier.state(q=np.eye(3), qdot=hat(omega), xi=[0.5, -0.2, 0.9])

    def rate(t, y):
        Q, w = y[:9].reshape(3, 3), y[9:]
        return np.concatenate([(Q @ hat(w)).ravel(), np.cross(J * w, w) / J])

    y0 = np.concatenate([np.eye(3).ravel(), omega])
    exact = solve_ivp(rate, (0, 2), y0, method="DOP853", rtol=1e-13, atol=1e-14).y[:9, -1]
    ends = [
        co.trajectory(carrier, start, dt=2.0 / steps, steps=steps, method=co.Galerkin(degree=2)).final
        for steps in (10, 20)
    ]
    coarse, fine = (np.max(np.abs((end.g @ end.n.reshape(3, 3)).ravel() - exact)) for end in ends)
    assert np.log2(coarse / fine) == pytest.approx(4, abs=0.2)
    inner = ends[0].n.reshape(3, 3)
    np.testing.assert_allclose(inner.T @ inner, np.eye(3), atol=1e-14)


@pytest.mark.long
def test_degree_one_is_the_midpoint_rule():
    one, other = (
        co.trajectory(BODY.system, BODY.start, dt=0.1, steps=20, method=method).final
        for method in (co.Galerkin(degree=1), co.Midpoint())
    )
    for name in ("g", "n", "mu", "pi"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=0, atol=1e-14)


@pytest.mark.long
@pytest.mark.parametrize("tau", [co.Cayley(), co.Exponential()])
def test_steps_on_a_body_with_a_pendulum_are_symplectic_and_reversible_and_keep_momenta(tau):
    method = co.Galerkin(tau, degree=2)
    stepper = AuditStepper(method, BODY.system, BODY.start)
    stepper.begin(0.1)
    assert symplectic_defect(stepper, 0.1) < 1e-11
    assert irreversibility(stepper, 0.1) < 1e-13
    run = co.simulate(BODY.system, BODY.start, dt=0.1, steps=2000, method=method)
    assert run.relative_change("kelvin_noether") < 1e-12
    energy = run.dataset.energy.values
    first, last = (np.max(np.abs(half - energy[0])) for half in np.array_split(energy, 2))
    assert last < 1.2 * first < 1e-5


@pytest.mark.long
def test_every_printed_equation_holds_and_the_frame_and_the_retraction_do_not_matter():
    rub = {"rub": lambda motion, p: co.Force(torque=-0.1 * motion.xi, force=-0.2 * motion.nu)}
    pushed = BODY.system.with_forces(rub)
    run = co.simulate(pushed, BODY.start, dt=0.1, steps=3, method=co.Galerkin(degree=2))
    assert printed_equations(run).worst.largest < 1e-13
    other = co.System(
        co.SO3(), BODY.system.lagrangian, additional=OtherChart(), advected=co.Defining(),
        parameters=BODY.system.parameters, forces=rub,
    )  # fmt: skip
    begun = BODY.start
    begun = other.state(g=begun.g, q=begun.q, qdot=begun.qdot, xi=begun.xi, a0=[0, 0, 1])
    again = co.simulate(other, begun, dt=0.1, steps=3, method=co.Galerkin(degree=2))
    np.testing.assert_allclose(again.final.n, run.final.n, rtol=0, atol=1e-13)
    exact = co.trajectory(pushed, BODY.start, dt=0.02, steps=15, method=co.Galerkin(degree=2)).final
    finer = co.trajectory(pushed, BODY.start, dt=0.01, steps=30, method=co.Galerkin(degree=2)).final
    errors = [np.max(np.abs(run.final.mu - exact.mu)), np.max(np.abs(exact.mu - finer.mu))]
    assert errors[0] < 1e-6 and errors[0] / errors[1] > 4.0**4
