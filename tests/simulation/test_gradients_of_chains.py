"""Derivatives of runs of chains, whose factors are carried over from step to step."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.simulation.trajectory import Trajectory, _with_last

LINKS = 31
"""More unknowns than native code takes."""
INERTIA = np.array([1.0, 2.0, 1.5])


def energies(xi, a, p):
    return 0.5 * jnp.sum(INERTIA * xi**2) + p.k * jnp.sum(jnp.trace(a, axis1=1, axis2=2))


@pytest.fixture(scope="module")
def chain() -> tuple[co.System, co.State]:
    options = {"advected": co.spaces.RelativePoses(), "parameters": {"k": 2.0}}
    system = co.System(co.Power(co.SO3(), LINKS), energies, **options)
    return system, system.state(xi=0.5 * np.sin(np.arange(3.0 * LINKS)).reshape(LINKS, 3))


def end(chain, k, save_every=1):
    system, start = chain
    return co.trajectory(system.replace(k=k), start, dt=0.05, steps=20, save_every=save_every).final.mu[4]


@pytest.fixture(scope="module")
def slope(chain) -> float:
    """By differences."""
    with co.float64():
        return float(end(chain, 2.0 + 1e-4) - end(chain, 2.0 - 1e-4)) / 2e-4


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize(("derivative", "save_every"), [(jax.grad, 1), (jax.grad, 5), (jax.jacfwd, 1)])
def test_the_derivative_of_where_a_chain_is_by_its_springs_is_that_of_differences(chain, slope, derivative, save_every):
    assert not co.Midpoint().structure(chain[0]).native
    with co.float64():
        found = float(derivative(lambda k: end(chain, k, save_every))(2.0))
    print(f"{found} by {derivative.__name__}, {slope} by differences")
    assert found == pytest.approx(slope, rel=1e-7)


def test_a_start_of_a_chain_without_poses_given_is_made_inside_jit(chain):
    system, start = chain
    with co.float64():
        made = jax.jit(lambda xi: system.state(xi=xi))(start.xi.reshape(LINKS, 3))
    np.testing.assert_array_equal(made.a, start.a)
    np.testing.assert_array_equal(made.xi, start.xi)


def test_the_last_node_gets_a_record_although_records_hold_no_factors():
    """The final state carries the factors of a step of a chain for the next step; records leave them out."""
    system = co.System(co.SO3(), lambda xi: 0.5 * xi @ xi)
    whole = co.trajectory(system, system.state(xi=[1.0, 2.0, 3.0]), dt=0.1, steps=2, accuracy=False)
    first, last = (jax.tree.map(lambda rows, cut=cut: rows[cut], whole.records) for cut in (slice(2), slice(2, 3)))
    carried = whole.final.replace(memory=np.ones(2))
    one = Trajectory(last, carried, whole.code, whole.iterations)
    found = _with_last(Trajectory(first, carried, whole.code, whole.iterations), one)
    np.testing.assert_array_equal(found.records.mu, whole.records.mu)
