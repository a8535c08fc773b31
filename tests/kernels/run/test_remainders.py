"""Remainders and quotients of forces, as of angles within a turn, in machine code."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co

FUNCTIONS = {
    "mod": lambda t: jnp.mod(t, 0.3),
    "of an angle": lambda t: jnp.mod(t + jnp.pi, 2 * jnp.pi) - jnp.pi,
    "fmod": lambda t: jnp.fmod(t, -0.3),
    "quotient": lambda t: t // 0.3,
    "whole": lambda t: jnp.mod(jnp.floor(10 * t).astype(int), 3) * 1.0,
}


@pytest.mark.cases(2)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_force_with_a_remainder_has_its_impulse_in_machine_code(name: str) -> None:
    def push(motion):
        return co.Force(jnp.stack([FUNCTIONS[name](motion.t), 0.0, 0.0]), jnp.zeros(0))

    body = co.System(co.Translation(3), lambda xi: 0.5 * xi @ xi, forces=push)
    run = co.simulate(
        body, body.state(xi=[0, 0, 1]), dt=0.07, steps=20, backend="native", accuracy=False, monitors=False
    )
    with co.float64():
        expected = sum(float(FUNCTIONS[name](0.07 * (k + 0.5))) for k in range(20))
    np.testing.assert_allclose(run.final.mu[0], 0.07 * expected, rtol=1e-12)
