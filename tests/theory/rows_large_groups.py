"""Rows on U(n), SU(n) and SO(n) without bases: Lie–Poisson equations and isospectral steps, against their matrices."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from explicit import Ad_dual, hat, inverse, vee
from theorem_row import Rows, off, off_each

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import noether, poisson
from systems import element, generator

ROWS = Rows("U(n), SU(n), SO(n)")
row = ROWS.add

H = 0.2
GROUPS: dict[str, tuple[Any, Any]] = {
    "Un": (co.Un(8), co.Un(8)),
    "SUn": (co.SUn(9), co.Un(9)),
    "SOn": (co.SOn(12), co.SOn(12)),
}
"""Groups of more than 60 dimensions, and those whose matrices the unknowns of their steps are."""
MIDPOINT = "methods/test_isospectral_midpoint.py::"
FIELDS = "methods/test_isospectral_fields.py::"
BLOCKS = FIELDS + "test_a_step_is_that_of_block_matrices"
COORDINATES = "groups/test_matrix_elements.py::test_without_a_basis_the_axioms_hold"
STEP = co.IsospectralMidpoint(carry_g=False)


@lru_cache(maxsize=8)
def world(name: str) -> tuple[co.System, co.State, np.ndarray]:
    """A random ℋ(μ, a), not quadratic, with any state, and unknowns of a step that solve nothing.

    They are as small as a step asks for, ε‖P̃‖ < 0.4: where it ends is found by iteration with P̃.
    """
    group, hull = GROUPS[name]
    random = generator("large groups", name)
    w = random.uniform(0.5, 1.5, size=(2, group.dim))
    u = random.normal(size=(2, group.dim)) / np.sqrt(group.dim)

    def hamiltonian(mu, a):
        coupled = jnp.sin(u[0] @ mu + u[1] @ a) + 0.3 * (u[0] @ a) * (u[1] @ mu)
        return 0.5 * mu @ (w[0] * mu) + 0.5 * a @ (w[1] * a) + coupled

    system = co.System(group, hamiltonian=hamiltonian, advected=co.Coadjoint())
    mu, a = random.normal(size=(2, group.dim))
    state = system.state(g=element(group, random, 0.2), mu=mu, a0=np.zeros(group.dim)).replace(a=a)
    return system, state, 0.3 * random.normal(size=2 * hull.dim)


def slopes(system, mu, a):
    """∂ℋ/∂μ and ∂ℋ/∂a."""
    return jax.grad(lambda mu, a: system.reduced_hamiltonian(mu, mu[:0], mu[:0], a, 0.0), argnums=(0, 1))(mu, a)


def commutator(X, Y):
    return X @ Y - Y @ X


@row(
    "(P6)–(P9), [Theorem 1](theorems/euler-poincare.md) on 𝔤 ⋉ 𝔤\\*",
    "Lie–Poisson equations Ẇ = [P, W] + [B, Θ], Θ̇ = [P, Θ] by coordinates",
    ("mechanics.poisson.vector_field", "groups.Un.ad_dual", "groups.SUn.ad_dual", "groups.SOn.ad_dual"),
    (COORDINATES, BLOCKS),
)
def lie_poisson():
    for name, (group, _) in GROUPS.items():
        system, state, _ = world(name)

        def sides(s, system=system, group=group):
            field = poisson.vector_field(lambda s: system.reduced_hamiltonian(s.mu, s.n, s.pi, s.a, 0.0), s)
            xi, along = slopes(system, s.mu, s.a)
            P, B, W, Theta = (hat(group, x) for x in (-xi, -along, s.mu, s.a))
            return (field.mu, field.a), (commutator(P, W) + commutator(B, Theta), commutator(P, Theta))

        found, matrices = evaluate(sides, state)
        yield off_each(found, [evaluate(lambda X, group=group: vee(group, X), X) for X in matrices])
        mu, xi = generator("ad of large groups", name).normal(size=(2, group.dim))
        bracket = evaluate(lambda mu, xi, group=group: commutator(hat(group, mu), hat(group, xi)), mu, xi)
        expected = evaluate(lambda X, group=group: vee(group, X), bracket)
        yield off(evaluate(lambda xi, mu, group=group: group.ad_dual(xi, mu), xi, mu), expected)


def taken(system, state, z, step=STEP):
    """The record of a step with these unknowns, whatever they solve."""
    begun = step.remember(system, state)
    return evaluate(lambda s, z: step.record(system, s, H, z), begun, z)


def matrices(name: str, system, state, z):
    """P, B, W̃, Θ̃ at the unknowns and W, Θ, all by the bases, with 1 ∓ εP."""
    group, hull = GROUPS[name]

    def made(s, z):
        tilde = [hat(hull, part) for part in jnp.split(z, 2)]
        xi, along = slopes(system, *(vee(group, X) for X in tilde))
        P, B = hat(group, -xi), hat(group, -along)
        one = jnp.eye(P.shape[0])
        return P, B, *tilde, hat(group, s.mu), hat(group, s.a), one - 0.5 * H * P, one + 0.5 * H * P

    return evaluate(made, state, z)


@row(
    "[Theorem 6](theorems/discrete-euler-poincare.md), (P79)–(P80) on large groups",
    "isospectral steps: μ_k and μ_{k+1} are (dCay⁻¹_{±hξ})\\* of one momentum, with Θ over dual numbers",
    ("methods.IsospectralMidpoint.equations", "methods.IsospectralMidpoint.advance"),
    (MIDPOINT + "test_a_step_is_that_of_the_published_equations", BLOCKS),
)
def isospectral_steps():
    """(1 − εP̃)X̃(1 + εP̃) − X and CXC† for X = Θ + dW, P + dB, d² = 0, ε = h/2, at unknowns that solve nothing."""
    epsilon = 0.5 * H
    for name, (group, hull) in GROUPS.items():
        system, state, z = world(name)
        _, B, W_, Theta_, W, Theta, minus, plus = matrices(name, system, state, z)
        record = taken(system, state, z)
        of_W = minus @ W_ @ plus + epsilon * (minus @ Theta_ @ B - B @ Theta_ @ plus)
        expected = [evaluate(lambda X, hull=hull: vee(hull, X), X)
                    for X in (of_W - W, minus @ Theta_ @ plus - Theta)]  # fmt: skip
        found = evaluate(lambda r, system=system: STEP.equations(system, r, H), record)
        yield off(found, np.concatenate(expected))
        C = np.linalg.solve(minus, plus)
        back = np.linalg.inv(C)
        moved = C @ Theta @ back
        K = 2 * epsilon * np.linalg.solve(minus, B) @ np.linalg.inv(plus)
        later = C @ W @ back + K @ moved - moved @ K
        after = evaluate(lambda r, system=system: STEP.advance(system, r, H), record)
        yield off_each((after.mu, after.a), [evaluate(lambda X, g=group: vee(g, X), X) for X in (later, moved)])


@lru_cache(maxsize=8)
def alone(name: str) -> co.System:
    """A random ℋ(μ), not quadratic."""
    group = GROUPS[name][0]
    random = generator("large groups without a", name)
    w, u = random.uniform(0.5, 1.5, size=group.dim), random.normal(size=group.dim) / np.sqrt(group.dim)
    return co.System(group, hamiltonian=lambda mu: 0.5 * mu @ (w * mu) + jnp.sin(u @ mu))


@row(
    "[Theorem 7](theorems/kelvin-noether.md) on large groups",
    "discrete Kelvin–Noether theorem of isospectral steps: g_{k+1} = g_kC†, and Ad\\*\\_{g⁻¹}μ without Θ",
    ("methods.IsospectralMidpoint.advance", "mechanics.noether.spatial_momentum"),
    (MIDPOINT + "test_carried_g_turns_the_momentum",),
)
def theorem_7():
    step = co.IsospectralMidpoint(carry_g=True)
    for name in ("Un", "SOn"):
        group, _ = GROUPS[name]
        _, state, z = world(name)
        system = alone(name)
        state, z = system.state(g=state.g, mu=state.mu), z[: group.dim]
        record = taken(system, state, z, step)
        after = evaluate(lambda r, y=system: step.advance(y, r, H), record)

        def sides(s, t, xi, y=system, group=group):
            G, X = group.matrix(s.g), 0.5 * H * hat(group, xi)
            one = jnp.eye(len(X))
            ahead = G @ jnp.linalg.solve(one - X, one + X)
            found = group.matrix(t.g), noether.spatial_momentum(y, s), noether.spatial_momentum(y, t)
            return found, (ahead, Ad_dual(group, inverse(G), s.mu), Ad_dual(group, inverse(G), s.mu))

        yield off_each(*evaluate(sides, state, after, record.xi))
