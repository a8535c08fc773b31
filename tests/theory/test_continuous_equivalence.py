"""Theorems 1 and 2 of P and (P20): on any family of curves, the variation of ℓ is the equations paired with it.

For g(t, ε), q(t, ε) with ξ = g⁻¹∂_tg, η = g⁻¹∂_εg, w = g⁻¹∂_εq, whether or not the curve moves as mechanics says,

    ∂_εℓ = ∂_t(⟨μ, η⟩ + ⟨π, w⟩) − ⟨μ̇ − ad*_ξμ − ∂_aℓ⋄a − ∂_nℓ⋄n − π⋄ν, η⟩ − ⟨π̇ − ∂_nℓ − L*_ξπ, w⟩.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from coadjoint.kernels.trace.evaluate import evaluate
from systems import generator, random_system

ROUND_OFF = 1e-12
"""Of the sum of the absolute terms."""


def family(system, start, shapes, t, e):
    """(g, q) at time t of the member ε: curves bent at will."""
    group = system.group
    A, B, c, d, q = shapes
    g = group.compose(start.g, group.compose(group.exp(t * A + 0.3 * jnp.sin(2 * t) * B), group.exp(e * (c + t * d))))
    return g, q[0] + jnp.sin(t) * q[1] + e * (q[2] + t * q[3])


@pytest.mark.cases(1)
@pytest.mark.parametrize("world", ["SO3", "SE2", "SL2", "SO4"])
def test_the_variation_of_the_action_is_the_euler_poincare_equations(world):
    system, start = random_system(world)
    group, Q, V = system.places
    random = generator("family", world)
    shapes = (*0.5 * random.normal(size=(4, group.dim)), random.normal(size=(4, Q.ambient(group))))
    a0 = evaluate(lambda s: V.act(group, s.g, s.a), start)

    def element(t, e):
        return family(system, start, shapes, t, e)

    def body(t, e, along):
        """(g⁻¹δg, g⁻¹δq) for δ = ∂_t or ∂_ε."""
        one = jnp.ones(()), jnp.zeros(())
        (g, q), (dg, dq) = jax.jvp(element, (t, e), one if along == "t" else one[::-1])
        back = group.inverse(g)
        matrix = jax.jvp(group.matrix, (g,), (dg,))[1]
        return group.vee(jnp.linalg.solve(group.matrix(g), matrix)), Q.push(group, back, q, dq)

    def place(t, e):
        g, q = element(t, e)
        back = group.inverse(g)
        xi, nu = body(t, e, "t")
        return xi, Q.act(group, back, q), nu, V.act(group, back, a0)

    def value(t, e):
        return system.reduced_lagrangian(*place(t, e))

    def momenta(t, e):
        return jax.grad(system.reduced_lagrangian, argnums=(0, 2))(*place(t, e))

    def sides(t, e):
        xi, n, nu, a = place(t, e)
        along_n, along_a = jax.grad(system.reduced_lagrangian, argnums=(1, 3))(xi, n, nu, a)
        (mu, pi), (mu_dot, pi_dot) = jax.jvp(lambda t: momenta(t, e), (t,), (jnp.ones(()),))
        eta, w = body(t, e, "e")

        def boundary(t):
            mu, pi = momenta(t, e)
            eta, w = body(t, e, "e")
            return mu @ eta + pi @ w

        torque = V.diamond(group, along_a, a) + Q.diamond(group, along_n, n) + Q.lifted_diamond(group, pi, n, nu)
        on_group = mu_dot - group.ad_dual(xi, mu) - torque
        lifted = jax.vjp(lambda v: Q.lifted(group, xi, n, v), jnp.zeros_like(nu))[1](pi)[0]
        on_space = pi_dot - along_n - lifted
        terms = jnp.stack([jax.grad(boundary)(t), -on_group @ eta, -on_space @ w])
        return jax.grad(value, argnums=1)(t, e), jnp.sum(terms), jnp.sum(jnp.abs(terms))

    found, expected, size = evaluate(sides, np.float64(0.4), np.float64(0.0))
    assert abs(found) > 1e-3 * size
    assert abs(found - expected) <= ROUND_OFF * size
