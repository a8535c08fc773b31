"""Theorems 3.1 and 4.1 of B and Theorem 6 of P on random systems: the four statements are one covector.

At any sequence, solution or not, the action's derivative along a variation of the inner nodes equals the discrete
Euler–Lagrange covectors, the derivative of the reduced action along the induced variation, and minus the reduced
covectors. Where one vanishes for all variations, all do.
"""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coadjoint import theory
from coadjoint.kernels.trace.evaluate import evaluate
from discrete import at, named_point, random_group_system, random_path

H = 0.2
ROUND_OFF = 1e-13
"""Of the sum of the absolute pairings."""

WORLDS = ["SO3", "SE3", "SE2", "SL2", "SO3xSE2", "SO3 on a sphere", "SO4"]


def statements(system, L, path, a0, eta, w):
    """The four statements along η, w at the inner nodes, in body variables; and their size."""
    group, Q, _ = system.places
    nodes = path.q.shape[0]
    inner = np.zeros((nodes, 1))
    inner[1:-1] = 1.0
    n = jax.vmap(lambda g, q: Q.act(group, group.inverse(g), q))(path.g, path.q)
    w = inner * jax.vmap(partial(Q.project, group))(n, w)
    eta = inner * eta

    def moved(g, eta):
        return jax.jvp(lambda e: group.compose(g, e), (group.identity(),), (group.tangent(eta),))[1]

    def turned(g, n, w):
        return Q.push(group, g, n, w)

    dg, dq = jax.vmap(moved)(path.g, eta), jax.vmap(turned)(path.g, n, w)
    first = jax.jvp(lambda p: theory.action(L, p, a0, H), (path,), (theory.Configuration(dg, dq),))[1]

    links = jax.vmap(lambda x, y: theory.link_of(system.places, x, y, a0))(
        at(path, slice(None, -1)), at(path, slice(1, None))
    )
    change = jax.vmap(
        lambda *parts: theory.induced_variation(system, theory.Link(*parts[:4]), theory.Variation(*parts[4:]))
    )(*links[:4], eta[:-1], w[:-1], eta[1:], w[1:])
    third = jax.jvp(lambda p: theory.reduced_action(system, p, H), (links,), (change,))[1]

    second, fourth, size = 0.0, 0.0, 0.0
    for k in range(1, nodes - 1):
        on_group, on_space = theory.discrete_euler_lagrange(L, at(path, k - 1), at(path, k), at(path, k + 1), a0, H)
        mu, pi = theory.discrete_euler_poincare(system, at(links, k - 1), at(links, k), H)
        second += on_group @ eta[k] + on_space @ dq[k]
        fourth -= mu @ eta[k] + pi @ w[k]
        size += jnp.sum(jnp.abs(on_group * eta[k])) + jnp.sum(jnp.abs(on_space * dq[k])) + jnp.abs(mu @ eta[k])
    return jnp.stack([first, second, third, fourth]), size


@pytest.mark.cases(1)
@pytest.mark.parametrize("world", WORLDS)
def test_the_four_statements_are_one_covector(world):
    system, _ = random_group_system(world)
    L = theory.unreduce(system)
    four, size = evaluate(partial(statements, system, L), *random_path(system, world))
    assert abs(four[0]) > 1e-3 * size, "a covector of nothing proves nothing"
    np.testing.assert_allclose(four, four[0], rtol=0, atol=ROUND_OFF * size * system.group.dim)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("world", ["SO3", "SE2"])
def test_on_a_solution_all_four_vanish(world):
    system, start = random_group_system(world)
    L = theory.unreduce(system)
    _, a0, eta, w = random_path(system, world, nodes=6)
    g = start.g
    first = theory.Configuration(g, evaluate(lambda s: s.q, start))
    F = evaluate(lambda xi: system.group.exp(0.5 * H * xi), start.xi)
    second = theory.Configuration(evaluate(system.group.compose, g, F), first.q + 0.1)
    path = theory.discrete_euler_lagrange_algorithm(L, first, second, named_point(system, a0), H, 5)
    four, _ = evaluate(partial(statements, system, L), path, a0, eta, w)
    moved = theory.Configuration(path.g, path.q + 1e-3 * np.random.default_rng(1).normal(size=path.q.shape))
    off, _ = evaluate(partial(statements, system, L), moved, a0, eta, w)
    assert np.max(np.abs(four)) < 1e-11
    assert np.min(np.abs(off)) > 1e-6
