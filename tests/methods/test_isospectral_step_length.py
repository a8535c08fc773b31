"""Isospectral steps have derivatives by their length."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co


@pytest.mark.long
def test_reverse_mode_by_the_step_length_is_that_of_differences():
    def energy(mu, p):
        return 0.5 * jnp.sum(p.rates * mu**2)

    system = co.System(co.SO3(), hamiltonian=energy, parameters={"rates": np.array([1.0, 1.5, 2.0])})
    start = system.state(xi=[0.3, 0.75, 0.4])

    def end(h):
        path = co.trajectory(system, start, dt=h, steps=3, method=co.IsospectralMidpoint(), backend="xla")
        return path.final.mu[0]

    with co.float64():
        found = float(jax.grad(end)(0.05))
        by_differences = float(end(0.05 + 1e-4) - end(0.05 - 1e-4)) / 2e-4
    assert found == pytest.approx(by_differences, rel=1e-7)
