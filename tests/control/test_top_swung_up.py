"""Kovalevskaya's top swung up with the least effort, against Pontryagin's equations by a solver of boundary values."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_bvp

import coadjoint as co
from coadjoint.models import integrable_tops

T, SPIN, J, MGL = 1.2, 4.0, np.array([0.08, 0.08, 0.04]), 9.81 * 0.2
MODEL = integrable_tops.kovalevskaya(mass=1.0, lever=0.2, axial=0.04)
TOP = co.System(
    co.SO3(),
    MODEL.lagrangian,
    advected=co.Defining(),
    parameters=MODEL.parameters.asdict(),
    forces=lambda motion, p: co.Force(torque=jnp.cross(motion.a, motion.inputs.u)),
)
HANGING = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
START = integrable_tops.start(TOP, rotation=HANGING, angular_velocity=(SPIN, 0.0, 0.0))


def swung(steps, guess=None):
    """The optimum, from a guess or from the motion under springs and a damper."""
    guess = guess or co.simulate(
        TOP, START, dt=T / steps / 10, steps=10 * steps, save_every=10, monitors=False, accuracy=False,
        inputs={"u": lambda motion: jnp.array([-2.5, 0.15, 0.3]) + 0.15 * jnp.cross(motion.a, motion.xi)},
    )  # fmt: skip
    return co.control.Problem(
        TOP, START, dt=T / steps, steps=steps, inputs={"u": co.control.Input((3,))},
        cost=lambda motion, p: 0.5 * motion.inputs.u @ motion.inputs.u,
        end=lambda motion, p: jnp.concatenate([motion.a[1:] / (1 + motion.a[0]), motion.xi[1:]]),
    ).solve(guess=guess)  # fmt: skip


def slopes(_, y):
    """Of (μ, a, λ, ν), (12, n): H = λ·(μ × ω + mgl a × e₁ + a × u) + ν·(a × ω) − ½|u|², which u = λ × a makes largest.

    λ' = −(ω × λ + J⁻¹(λ × μ + ν × a)),  ν' = −(mgl e₁ × λ + u × λ + ω × ν).
    """
    mu, a, lam, nu = (part.T for part in np.split(y, 4))
    omega, u, weight = mu / J, np.cross(lam, a), np.array([MGL, 0.0, 0.0])
    rates = (
        np.cross(mu, omega) + np.cross(a, weight) + np.cross(a, u),
        np.cross(a, omega),
        -np.cross(omega, lam) - (np.cross(lam, mu) + np.cross(nu, a)) / J,
        -np.cross(weight + u, lam) - np.cross(omega, nu),
    )
    return np.concatenate([rate.T for rate in rates])


def least_effort(run, u):
    """½∫|u|², and the course of (μ, a, λ, ν), from an optimum as the first guess.

    |a|² and μ·a stay by themselves, so that two conditions at the end are the same as others: instead λ and ν, of which
    (a, μ) and (0, a) can be added, begin across a.
    """
    t, mu, a = np.asarray(run.t), np.asarray(run.mu), np.asarray(run.a)
    u = np.stack([np.interp(t, 0.5 * (t[1:] + t[:-1]), column) for column in u.T], axis=1)
    lam, omega = np.cross(a, u), mu / J
    nu = np.cross(a, -J * (np.gradient(lam, t, axis=0) + np.cross(omega, lam)) - np.cross(lam, mu))

    def ends(first, last):
        across = first[6:9] @ first[3:6], first[9:12] @ first[3:6]
        return np.array([*(first[:3] - START.mu), *(first[3:6] - START.a), *across, *last[1:3], *last[4:6]])

    found = solve_bvp(slopes, ends, t, np.concatenate([mu.T, a.T, lam.T, nu.T]), tol=1e-5, max_nodes=5000)
    assert found.success, found.message
    fine = np.linspace(0.0, T, 4001)
    y = found.sol(fine)
    best = np.cross(y[6:9].T, y[3:6].T)
    return np.trapezoid(0.5 * np.sum(best**2, axis=1), fine), found.sol


@pytest.mark.long
def test_a_top_swings_up_with_the_least_effort_of_a_boundary_value_solver_to_second_order():
    optima = [swung(steps) for steps in (40, 80)]
    least, course = least_effort(optima[-1].run.records, optima[-1].inputs["u"])
    efforts, ways = [], []
    for optimum in optima:
        run = optimum.run.records
        assert np.asarray(run.a[-1]) == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
        assert np.sum(run.mu * run.a, axis=1) == pytest.approx(-J[0] * SPIN, abs=1e-12)  # about the vertical
        efforts.append(optimum.cost - least)
        ways.append(np.max(np.abs(run.a.T - course(np.asarray(run.t))[3:6])))
    for errors in (efforts, ways):
        assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)
    assert 0 < efforts[-1] < 0.005 * least and ways[-1] < 0.005
