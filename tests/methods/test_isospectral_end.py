"""The end of isospectral steps: the correction of a momentum that is off, in double and in single precision."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.methods.isospectral_end import ROUND_OFF, correction, valued
from coadjoint.methods.isospectral_fields import brackets, moved
from systems import generator


@pytest.mark.cases(1)
@pytest.mark.parametrize("group", [co.Un(6), co.SOn(12)], ids=repr)
@pytest.mark.parametrize("size", [1e-12, 1e-200])
def test_a_correction_in_single_precision_is_exact_to_round_off(group, size):
    """With δ = −(1 − L)⁻¹r, L = ε[P, ·] + ε² P·P as a matrix, of any unit of the momentum."""
    system = co.System(group, hamiltonian=lambda mu: 0.5 * mu @ mu)
    xi, z, r = generator("correction", repr(group)).normal(size=(3, group.dim))
    xi *= 2.0 / np.linalg.norm(evaluate(group.hat, xi), 2)
    epsilon, none = 0.1, np.zeros(0)
    r, z = size * r, size * 1e12 * z

    def of(precision):
        end = lambda xi, r, z: correction(system, (xi, jnp.zeros(0)), r, z, jnp.asarray(epsilon), precision)  # noqa: E731
        return evaluate(end, xi, r, z)

    L = np.stack([evaluate(lambda e: moved(system, xi, none, e, epsilon), e) for e in np.eye(group.dim)], axis=1)
    delta = -np.linalg.solve(np.eye(group.dim) - L, r)
    expected = np.stack([L @ delta, evaluate(lambda d: brackets(system, xi, none, d, epsilon), delta)])
    scale = size * 1e12
    assert np.min(np.max(np.abs(expected), axis=1)) > 1e-13 * scale
    np.testing.assert_allclose(of(jnp.float64), expected, rtol=0, atol=ROUND_OFF * scale)
    np.testing.assert_allclose(of(jnp.float32), expected, rtol=0, atol=ROUND_OFF * scale)


def test_a_correction_that_diverges_is_no_number():
    group = co.Un(3)
    system = co.System(group, hamiltonian=lambda mu: 0.5 * mu @ mu)
    xi, z, r = generator("diverges").normal(size=(3, group.dim))
    end = lambda r: correction(system, (9.0 * xi, jnp.zeros(0)), r, z, jnp.asarray(1.0), jnp.float64)  # noqa: E731
    assert np.isnan(evaluate(end, 1e-9 * r)).all() and not np.any(evaluate(end, 0.0 * r))


def test_a_value_with_the_derivatives_of_another_has_all_of_them():
    def sixth(x):
        return valued(jax.lax.stop_gradient(x**3), x**3) ** 2

    second, third = jax.grad(jax.grad(sixth)), jax.jacfwd(jax.grad(jax.grad(sixth)))
    found = [evaluate(function, np.float64(2.0)) for function in (sixth, jax.grad(sixth), second, third)]
    np.testing.assert_allclose(found, [64.0, 192.0, 480.0, 960.0], rtol=1e-15)


@pytest.mark.long
def test_second_derivatives_of_a_path_equal_differences_of_first():
    system = co.System(co.Un(3), hamiltonian=lambda mu: 0.5 * mu @ (np.arange(1.0, 10.0) * mu))
    start = system.state(mu=0.3 * generator("second").normal(size=9))

    def value(factor):
        given = {"dt": 0.1, "steps": 4, "method": co.IsospectralMidpoint()}
        return jnp.sum(jnp.asarray(co.trajectory(system, start.replace(mu=factor * start.mu), **given).final.mu) ** 3)

    with co.float64():
        slope = jax.jit(jax.grad(value))
        found = jax.jvp(slope, (1.0,), (1.0,))[1]
        difference = (slope(1 + 1e-4) - slope(1 - 1e-4)) / 2e-4
    np.testing.assert_allclose(found, difference, rtol=1e-6)
