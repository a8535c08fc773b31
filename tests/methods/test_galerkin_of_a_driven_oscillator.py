"""Galerkin's methods against a motion in closed form, with a force and a torque that depend on time."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

import coadjoint as co


def driven() -> tuple[co.System, co.State]:
    """A wheel and an oscillator: θ̈ = cos t, ẍ = −x + sin 2t, at rest at x = 1."""

    def lagrangian(xi, x, v):
        return 0.5 * (xi @ xi + v @ v - x @ x)

    def forces(motion):
        return co.Force(torque=jnp.cos(motion.t)[None], force=jnp.sin(2 * motion.t)[None])

    system = co.System(co.SO2(), lagrangian, additional=co.Trivial(1), forces=forces)
    return system, system.state(q=[1.0], xi=[0.0], qdot=[0.0])


def test_a_driven_oscillator_and_a_driven_wheel_move_as_their_closed_forms():
    """x = cos t + ⅔ sin t − ⅓ sin 2t, ẋ its derivative, θ = 1 − cos t."""
    error = 1e-7
    system, start = driven()
    run = co.trajectory(system, start, dt=0.2, steps=10, method=co.Galerkin(degree=3))
    t = 0.2 * np.arange(11)
    x, v = np.cos(t) + 2 / 3 * np.sin(t) - np.sin(2 * t) / 3, -np.sin(t) + 2 / 3 * (np.cos(t) - np.cos(2 * t))
    R, records = np.asarray(run.records.g), run.records
    assert np.allclose(records.t, t, rtol=0, atol=1e-14)
    assert np.max(np.abs(np.arctan2(R[:, 1, 0], R[:, 0, 0]) - (1 - np.cos(t)))) < error
    assert np.max(np.abs(records.n[:, 0] - x)) < error and np.max(np.abs(records.pi[:, 0] - v)) < error
    assert np.max(np.abs(records.mu[:, 0] - np.sin(t))) < error
    assert abs(run.final.n[0] - (np.cos(2.0) + 2 / 3 * np.sin(2.0) - np.sin(4.0) / 3)) < error
