"""Functions that differ in a parameter of one primitive alone have other digests, and are other runs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.kernels.trace.digest import digest

A, B = np.arange(1.0, 10.0).reshape(3, 3), np.array([0.3, -0.4, 0.5])

PAIRS = {
    "power": (lambda a, b: b**3, lambda a, b: b**5),
    "axes of a transposition": (
        lambda a, b: jnp.transpose(jnp.stack([a, a, a]), (0, 2, 1)),
        lambda a, b: jnp.transpose(jnp.stack([a, a, a]), (2, 1, 0)),
    ),
    "axis of a sum": (lambda a, b: a.sum(0), lambda a, b: a.sum(1)),
    "axis of a cumulative sum": (lambda a, b: jnp.cumsum(a, 0), lambda a, b: jnp.cumsum(a, 1)),
    "way of a cumulative sum": (lambda a, b: jax.lax.cumsum(b), lambda a, b: jax.lax.cumsum(b, reverse=True)),
    "start of a slice": (lambda a, b: b[:2], lambda a, b: b[1:]),
    "contraction of a product": (lambda a, b: jnp.einsum("ij,j", a, b), lambda a, b: jnp.einsum("ji,j", a, b)),
    "axes of a reversal": (lambda a, b: jnp.flip(a, 0), lambda a, b: jnp.flip(a, 1)),
    "axis of a joint": (
        lambda a, b: jnp.concatenate([a, a], 0).sum(),
        lambda a, b: jnp.concatenate([a, a], 1).sum(),
    ),
    "number of turns of a loop": (
        lambda a, b: jax.lax.fori_loop(0, 3, lambda i, x: x * b, b),
        lambda a, b: jax.lax.fori_loop(0, 4, lambda i, x: x * b, b),
    ),
    "what a loop does": (
        lambda a, b: jax.lax.scan(lambda c, x: (c + x**3, c), 0.0, b)[0],
        lambda a, b: jax.lax.scan(lambda c, x: (c + x**5, c), 0.0, b)[0],
    ),
    "places of padding": (lambda a, b: jnp.pad(b, (1, 2)), lambda a, b: jnp.pad(b, (2, 1))),
}


def of(function):
    with jax.enable_x64(True):
        return digest(jax.make_jaxpr(function)(A, B))


@pytest.mark.parametrize("name", PAIRS)
def test_a_parameter_of_a_primitive_belongs_to_the_digest(name):
    one, other = PAIRS[name]
    assert of(one) != of(other)
    assert of(one) == of(lambda a, b: one(a, b)), "the same function under another name"


@pytest.mark.long
def test_a_run_does_not_go_on_with_a_system_that_differs_in_a_power(tmp_path):
    def body(power):
        return co.System(
            co.SO3(),
            lambda xi, p: 0.5 * xi @ p.inertia @ xi,
            parameters={"inertia": np.diag([1.0, 2.0, 3.0])},
            forces=lambda motion, p: co.Force(torque=-0.1 * motion.xi**power),
        )

    system = body(3)
    co.simulate(system, system.state(xi=[0.1, 0.2, 0.3]), dt=0.01, steps=3, store=tmp_path / "run", progress=False)
    assert co.resume(tmp_path / "run", system).good_steps == 3
    with pytest.raises(co.errors.ArgumentError, match="equations"):
        co.resume(tmp_path / "run", body(5))
