"""The discrete theory on systems of one or two freedoms, whose steps take no time to trace."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint import theory
from coadjoint.groups import attitude
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.theory import constraints, curves, principal_bundles
from coadjoint.theory.euler_poincare import DiscreteEulerPoincare
from coadjoint.theory.semidirect import SemidirectEulerPoincare
from coadjoint.theory.unreduced import DiscreteEulerLagrange

H = 0.1
QUIET: dict[str, Any] = {"monitors": False, "accuracy": False}


def cart(**more):
    """A wheel whose rate is coupled to a place, and that place in a field."""

    def lagrangian(xi, n, nu):
        return (1 + 0.3 * jnp.cos(n[0])) * xi @ xi + nu @ nu + xi[0] * nu[0] * jnp.sin(n[0]) - 0.5 * n @ n

    return co.System(co.SO2(), lagrangian, additional=co.Trivial(1), **more)


def begun(system):
    return system.state(xi=[0.7], q=[0.4], qdot=[-0.3])


def drag(motion):
    return co.Force(-0.3 * motion.xi, -0.2 * motion.nu)


def close(x, y, size=1.0, within=2e-13):
    for a, b in zip(jax.tree.leaves(x), jax.tree.leaves(y), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=within * size)


def test_the_unknowns_of_a_run_solve_lagrange_poincares_equations_and_give_its_motion(monkeypatch):
    """Under drag, through a connection that is not flat: Ω = exp((0.4 + 0.3 x x⁺)(x⁺ − x))."""

    def increment(x, x_next):
        return co.SO2().exp((0.4 + 0.3 * x * x_next) * (x_next - x))

    system = cart(forces=drag)
    start, method = begun(system), co.Midpoint()
    run = co.simulate(system, start, dt=H, steps=2, method=method, **QUIET).records
    first = np.concatenate([start.xi, start.nu])

    def known(residual, guess, h, blocks):
        """In the place of Newton's method: the unknowns of the run, of its first step or of the second."""
        is_first = jnp.max(jnp.abs(guess - first)) < 1e-12
        z = jnp.where(is_first, *(jnp.concatenate([run.xi[k], run.nu[k]]) for k in (0, 1)))
        return SimpleNamespace(unknowns=z, code=jnp.where(jnp.max(jnp.abs(residual(z))) < 1e-12, 0, 1))

    monkeypatch.setattr(principal_bundles, "solver", SimpleNamespace(solve=known))
    connection = co.mechanics.DiscreteConnection(co.SO2(), 1, increment)
    given = {"dt": H, "method": method, "connection": connection}
    found = theory.lagrange_poincare(system, start, steps=2, **given)
    close((found.g, found.x), (run.g, run.n))
    np.testing.assert_allclose(found.time, H * np.arange(3), atol=1e-15)
    turned = np.swapaxes(run.g[1:], 1, 2) @ run.g[:-1]
    close(found.sigma, turned @ evaluate(jax.vmap(increment), run.n[:-1], run.n[1:]))


def test_a_step_of_two_stages_has_the_left_transform_of_the_first_and_the_right_one_of_the_second():
    run = co.simulate(cart(), begun(cart()), dt=H, steps=2, method=co.methods.LeftRight(), **QUIET)
    found = theory.discrete_legendre(run.system, run.method, run.records, H)
    close((found.minus.mu, found.minus.pi), (run.records.mu, run.records.pi))
    close((found.plus.mu[:-1], found.plus.pi[:-1]), (run.records.mu[1:], run.records.pi[1:]))


def test_algorithms_continue_by_the_last_velocity_seen_from_the_last_node():
    """F_k = F_{k−1}, and (q_k − q_{k−1})/h from space or from node k, as the guesses of the next step."""
    system = co.System(
        co.SO3(), group_lagrangian=lambda F, n, s, h: 0.5 * (s - n) @ (s - n) / h + h * s[0], additional=co.Defining()
    )
    g, h = (attitude.zyx(0.3, -0.2, 0.5), attitude.zyx(0.7, 0.4, -0.1), attitude.zyx(-0.2, 0.9, 0.3)), 0.1
    q = np.array([[0.3, -0.2, 0.9], [0.5, 0.1, 0.7], [0.2, 0.2, 0.4]])
    F, velocity = g[0].T @ g[1], (q[1] - q[0]) / h
    pair = theory.Link(F, g[0].T @ q[0], g[0].T @ q[1], np.zeros(0))
    reduced = DiscreteEulerPoincare(system)
    close(evaluate(lambda pair: reduced.last(pair, h), pair), (F, g[1].T @ q[1], g[1].T @ velocity), 10)
    first, second = (theory.Configuration(*both) for both in zip(g[:2], q[:2], strict=True))
    unreduced = DiscreteEulerLagrange(theory.unreduce(system))
    path = (first, second, np.zeros(0), theory.Instant())
    close(evaluate(lambda *path: unreduced.last(path, h), *path), (F, q[1], velocity), 10)
    after = evaluate(lambda *path: unreduced.following(path, h, g[1].T @ g[2], q[2])[:2], *path)
    close(after, (second, theory.Configuration(g[2], q[2])))
    semidirect = SemidirectEulerPoincare(system.group, system.additional, theory.semidirect_lagrangian(system))
    found = semidirect.last(theory.SemidirectLink(F.T, q[0], q[1]), h)
    close(found, (F, q[1], velocity), 10)


@pytest.mark.parametrize("rule", curves.NODES)
def test_nodes_and_weights_of_rules_integrate_what_their_order_asks_for(rule):
    """Σ w = 1; Σ w c = ½ of symmetric rules; Σ w c² = ⅓ and Σ w c³ = ¼ of Simpson's; the ends of the one-sided ones."""
    places, weights = np.array(curves.NODES[rule]).T
    moments = [weights @ places**k for k in range(4)]
    exact = {"LeftRectangle": [1, 0, 0, 0], "RightRectangle": [1, 1, 1, 1], "Simpson": [1, 1 / 2, 1 / 3, 1 / 4]}
    expected = exact.get(rule.__name__, [1, 1 / 2])
    assert moments[: len(expected)] == pytest.approx(expected) and np.all(np.diff(places) > 0)


def test_variations_along_a_constraint_are_tangent_and_the_nearest():
    """Dφ·δ = n·w and Dφ̇·δ = π·w + n·δπ of φ = ½(|n|² − 1) for a point of mass 1."""
    system = co.System(
        co.Translation(0), lambda xi, n, nu: 0.5 * nu @ nu, additional=co.Trivial(2),
        constraints={"circle": co.Holonomic(lambda n: 0.5 * (n @ n - 1.0))},
    )  # fmt: skip
    n, pi = np.array([0.6, 0.8]), np.array([-1.6, 1.2])
    state, nothing = system.state(q=n, qdot=pi), np.zeros(0)
    d = constraints.PhaseVariation(nothing, np.array([0.3, -0.2]), nothing, np.array([0.5, 0.9]))
    parts = constraints.off_constraints, constraints.tangent_to_constraints
    off, near = evaluate(lambda s, d: [part(system, s, d) for part in parts], state, d)
    rows = np.array([[*n, 0.0, 0.0], [*pi, *n]])
    both = np.concatenate([d.w, d.pi])
    np.testing.assert_allclose(off, rows @ both, atol=1e-14)
    np.testing.assert_allclose(np.concatenate([near.w, near.pi]), both - np.linalg.pinv(rows) @ rows @ both, atol=1e-14)
