"""The native adjoint equals the derivative that JAX takes of plain Newton's steps, to round-off."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from vehicle import PAPER, LeftRectangle, VehicleProgram, start

from coadjoint.kernels import gradient, xla

H, RECORDS, EVERY = 0.01, 3, 5

PROGRAMS = {
    "one stage": VehicleProgram(),
    "three stages": VehicleProgram(tuple(LeftRectangle(fraction) for fraction in (0.4, 0.2, 0.4))),
}


def of_records(records):
    return 0.1 * jnp.sum(records.n**2) + jnp.sum(records.xi**3)


def of_final(final):
    return jnp.sum(final.n**2) + 3.0 * final.g[0, 1] + final.mu @ jnp.arange(3.0)


def through_xla(program):
    """The gradient by parameters, state and h of of_records + of_final."""

    def total(p, s, h):
        def step(state, _):
            result = xla.step(program, p, state, h, certify=False)
            return result.after, result.record

        final, records = jax.lax.scan(step, s, None, length=RECORDS * EVERY)
        return of_records(jax.tree.map(lambda x: x[::EVERY], records)) + of_final(final)

    return jax.jit(jax.grad(total, (0, 1, 2)))


@pytest.mark.parametrize("name", PROGRAMS)
def test_the_adjoint_equals_the_gradient_through_xla(name):
    program, s = PROGRAMS[name], start(H, [1.0, -2.0, 3.0])
    chunk, pull = gradient.vjp(program, PAPER, s, H, RECORDS, EVERY)
    with jax.enable_x64(True):
        records_bar, final_bar = jax.grad(of_records)(chunk.records), jax.grad(of_final)(chunk.final)
        theirs = jax.tree.map(np.asarray, through_xla(program)(PAPER, s, H))
    ours = pull(jax.tree.map(np.asarray, records_bar), jax.tree.map(np.asarray, final_bar))
    for x, y in zip(jax.tree.leaves(tuple(ours)), jax.tree.leaves(theirs), strict=True):
        assert x.shape == y.shape
        np.testing.assert_allclose(x, y, rtol=1e-12, atol=1e-13 * np.max(np.abs(y)))


def test_the_adjoint_of_a_long_run_equals_differences():
    s = start(H)
    steps, shift = 2000, 1e-4
    chunk, pull = gradient.vjp(VehicleProgram(), PAPER, s, H, 1, steps)
    final_bar = jax.tree.map(np.zeros_like, chunk.final)._replace(n=np.array([0.0, 0.0, 1.0]))
    along = np.array([1.0, 2.0, 3.0])
    ends = [
        gradient.native.run(VehicleProgram(), PAPER, s._replace(pi=s.pi + e * along), H, 1, steps).final.n[2]
        for e in (shift, -shift)
    ]
    assert pull(None, final_bar).state.pi @ along == pytest.approx((ends[0] - ends[1]) / (2 * shift), rel=1e-6)


def test_a_failed_run_has_no_derivative():
    chunk, pull = gradient.vjp(VehicleProgram(), PAPER, start(H, [1e3, 2e3, 3e3]), H, 1, 5)
    with pytest.raises(ValueError, match="failed at step 0"):
        pull(None, chunk.final)
