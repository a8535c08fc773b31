"""Derivatives of trajectories are exact: forward, reverse, both backends and differences agree."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.mechanics.copies import replace_parameters
from paper_vehicle import start, system

VEHICLE = system()
DT, STEPS = 0.05, 40


def end(parameters, q0, xi0, backend="auto", save_every=1):
    """A number that depends on everything: a mean height and the last attitude."""
    vehicle = replace_parameters(VEHICLE, parameters)
    begun = start(vehicle, q=q0, xi=xi0)
    path = co.trajectory(vehicle, begun, dt=DT, steps=STEPS, backend=backend, save_every=save_every)
    return path.final.q[2] + path.records.n[:, 0].mean() + path.final.g[0, 1]


ARGUMENTS = (VEHICLE.parameters, np.array([0.0, 0.0, 1.0]), np.radians([10.0, 0.0, 20.0]))


@pytest.mark.long
def test_native_and_xla_gradients_in_all_parameters_and_the_start_agree_to_round_off():
    with co.float64():
        native = jax.grad(end, argnums=(0, 1, 2))(*ARGUMENTS, backend="native")
        xla = jax.grad(end, argnums=(0, 1, 2))(*ARGUMENTS, backend="xla")
    for one, other in zip(jax.tree.leaves(native), jax.tree.leaves(xla), strict=True):
        scale = max(1.0, float(np.max(np.abs(other))))
        assert np.max(np.abs(one - other)) < 1e-12 * scale


@pytest.mark.long
def test_forward_and_reverse_derivatives_agree_with_differences():
    def f(mass):
        return end(ARGUMENTS[0].replace(mass=mass), *ARGUMENTS[1:], save_every=10)

    with co.float64():
        backward = float(jax.grad(f)(123.8))
        forward = float(jax.jvp(f, (123.8,), (1.0,))[1])
        differences = float((f(123.8 + 1e-2) - f(123.8 - 1e-2)) / 2e-2)
    assert backward == pytest.approx(forward, rel=1e-11)
    assert backward == pytest.approx(differences, rel=1e-6)


@pytest.mark.long
def test_the_derivative_in_the_step_size_agrees_with_differences():
    def f(h):
        return co.trajectory(VEHICLE, start(VEHICLE), dt=h, steps=STEPS).final.q[2]

    with co.float64():
        assert float(jax.grad(f)(DT)) == pytest.approx(float((f(DT + 1e-5) - f(DT - 1e-5)) / 2e-5), rel=1e-7)


@pytest.mark.long
def test_the_derivative_in_the_step_size_of_a_start_by_velocities_agrees_with_differences():
    method = co.LeftRectangle(co.Cayley(), start="velocity")

    def f(h):
        return co.trajectory(VEHICLE, start(VEHICLE), dt=h, steps=STEPS, method=method).final.q[2]

    with co.float64():
        assert float(jax.grad(f)(DT)) == pytest.approx(float((f(DT + 1e-5) - f(DT - 1e-5)) / 2e-5), rel=1e-7)


@pytest.mark.long
def test_translation_symmetry_makes_the_sensitivity_to_the_start_the_identity():
    """The vehicle's motion does not depend on where it starts: ∂q_N/∂q₀ = I."""

    def last(q0):
        return co.trajectory(VEHICLE, start(VEHICLE, q=q0), dt=DT, steps=STEPS).final.q

    with co.float64():
        jacobian = jax.jacrev(last)(jnp.array([0.0, 0.0, 1.0]))
    assert np.max(np.abs(np.asarray(jacobian) - np.eye(3))) < 1e-13


@pytest.mark.long
def test_forward_derivatives_along_all_velocities_are_those_of_a_free_mass():
    """q_N = q₀ + N h v."""
    mass = co.System(co.Translation(2), lambda xi: 0.5 * xi @ xi)
    with co.float64():
        jacobian = jax.jacfwd(lambda v: co.trajectory(mass, mass.state(xi=v), dt=0.1, steps=10).final.g)(jnp.ones(2))
    np.testing.assert_allclose(jacobian, np.eye(2), atol=1e-14)


@pytest.mark.long
def test_vmap_over_parameters_equals_single_trajectories_in_value_and_gradient():
    masses = np.array([110.0, 123.8, 140.0])

    def f(mass):
        return end(ARGUMENTS[0].replace(mass=mass), *ARGUMENTS[1:])

    with co.float64():
        values, slopes = jax.jit(jax.vmap(jax.value_and_grad(f)))(masses)
        alone = [jax.value_and_grad(f)(mass) for mass in masses]
    np.testing.assert_allclose(values, [a[0] for a in alone], rtol=0, atol=1e-13)
    np.testing.assert_allclose(slopes, [a[1] for a in alone], rtol=1e-12)


@pytest.mark.long
def test_second_derivatives_of_native_runs_are_refused_in_one_sentence():
    def f(mass):
        return end(ARGUMENTS[0].replace(mass=mass), *ARGUMENTS[1:], backend="native")

    with co.float64(), pytest.raises(co.errors.ArgumentError, match='backend="xla"'):
        jax.grad(jax.grad(f))(123.8)


def test_a_trajectory_equals_the_run_of_the_driver():
    run = co.simulate(VEHICLE, start(VEHICLE), dt=DT, steps=STEPS, save_every=4, monitors=False)
    path = co.trajectory(VEHICLE, start(VEHICLE), dt=DT, steps=STEPS, save_every=4)
    assert isinstance(path.final.q, np.ndarray)
    assert np.max(np.abs(path.records.q - run.records.q)) < 1e-13
    assert np.max(np.abs(path.final.q - run.final.q)) < 1e-13
