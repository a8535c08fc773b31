"""Derivatives of trajectories are exact: forward, reverse and differences agree."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from paper_vehicle import start, system

VEHICLE = system()


def height(mass, steps=40, save_every=1):
    return co.trajectory(
        VEHICLE.replace(mass=mass), start(VEHICLE), dt=0.05, steps=steps, save_every=save_every
    ).final.q[2]


@pytest.mark.parametrize("save_every", [1, 10])
def test_forward_and_reverse_derivatives_agree_with_differences(save_every):
    def f(mass):
        return height(mass, save_every=save_every)

    with co.float64():
        backward = float(jax.grad(f)(123.8))
        forward = float(jax.jvp(f, (123.8,), (1.0,))[1])
        differences = float((f(123.8 + 1e-3) - f(123.8 - 1e-3)) / 2e-3)
    assert backward == pytest.approx(forward, rel=1e-13)
    assert backward == pytest.approx(differences, rel=1e-7)


def test_translation_symmetry_makes_the_sensitivity_to_the_start_the_identity():
    """The vehicle's motion does not depend on where it starts: ∂q_N/∂q₀ = I."""

    def end(q0):
        return co.trajectory(VEHICLE, start(VEHICLE, q=q0), dt=0.05, steps=40).final.q

    with co.float64():
        jacobian = jax.jacrev(end)(jnp.array([0.0, 0.0, 1.0]))
    assert np.max(np.abs(np.asarray(jacobian) - np.eye(3))) < 1e-13


def test_vmap_over_parameters_equals_single_trajectories():
    masses = np.array([110.0, 123.8, 140.0])
    with co.float64():
        together = jax.vmap(height)(masses)
    alone = [height(mass) for mass in masses]
    assert np.max(np.abs(np.asarray(together) - np.array(alone))) < 1e-13


def test_a_trajectory_equals_the_run_of_the_driver():
    run = co.simulate(VEHICLE, start(VEHICLE), dt=0.05, steps=40, save_every=4)
    path = co.trajectory(VEHICLE, start(VEHICLE), dt=0.05, steps=40, save_every=4)
    assert isinstance(path.final.q, np.ndarray)
    assert np.max(np.abs(path.records.q - run.records.q[:-1])) < 1e-13
    assert np.max(np.abs(path.final.q - run.final.q)) < 1e-13
