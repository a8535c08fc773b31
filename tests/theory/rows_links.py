"""Rows on chains: the equations on co.Power(G, N) against those of the block matrices of G × … × G."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import Any

import explicit
import jax
import jax.numpy as jnp
import numpy as np
from explicit import H, hat, inverse
from motions import momenta, placed, rates
from rows_continuous import transposed
from rows_discrete import kelvin
from sequences import SOLVED, at, links_by_matrices, pair, rebuilt
from theorem_row import Rows, off, off_each

import coadjoint as co
from coadjoint import theory
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import continuous, noether
from coadjoint.theory import euler_poincare
from discrete import velocity
from systems import element, generator, system_on

ROWS = Rows("`Power`, flat or curved Q and V\\*")
row = ROWS.add

WORLDS: dict[str, tuple[co.groups.LieGroup, int, Any, Any]] = {
    "SO3": (co.SO3(), 2, co.Defining(), co.Coadjoint()),
    "SE2": (co.SE2(), 3, co.spaces.Adjoint(), co.spaces.Dual()),
}
CHAINS = "methods/test_chains.py::test_native_code_and_the_structure_of_the_coupling_find_the_same_motion"
POWER = "groups/test_power.py::test_a_power_is_the_product_of_its_links"
SPACES = tuple(f"spaces.links.Links.{name}" for name in ("diamond", "lifted_diamond", "infinitesimal", "lifted"))


def stacked(g: Any) -> Any:
    """An element of G × … × G as one of Gᴺ."""
    return jax.tree.map(lambda *leaves: jnp.stack(leaves), *g)


def apart(g: Any, count: int) -> Any:
    """The inverse of `stacked`."""
    return tuple(jax.tree.map(lambda leaf, k=k: leaf[k], g) for k in range(count))


@lru_cache(maxsize=8)
def both(name: str) -> tuple[co.System, co.State, co.System]:
    """A random system on G × … × G with a state, and the same on Gᴺ, whose functions see rows."""
    factor, count, Q, V = WORLDS[name]
    system, state = system_on(co.DirectProduct(*[factor] * count), Q, V, False, f"links {name}")

    def lagrangian(xi, n, nu, a):
        return explicit.lagrangian(system, *map(jnp.ravel, (xi, n, nu, a)))

    return system, state, co.System(co.Power(factor, count, "all"), lagrangian, additional=Q, advected=V)


@lru_cache(maxsize=8)
def in_group_form(name: str) -> co.System:
    """Λ(F, n, s, a; h) = h ℓ((F − F⁻¹)ᵛ/2h, n, (s − n)/h, a) on Gᴺ."""
    system, _, chain = both(name)
    factor, count, Q, V = WORLDS[name]

    def group_lagrangian(F, n, s, a, h):
        n, s, a = map(jnp.ravel, (n, s, a))
        return h * explicit.lagrangian(system, velocity(chain.group, F, h), n, (s - n) / h, a)

    return co.System(co.Power(factor, count, "all"), group_lagrangian=group_lagrangian, additional=Q, advected=V)


def sequence(name: str, nodes: int = 4, spread: float = 0.35) -> tuple[Any, ...]:
    """Block matrices, points of Q and a₀ that no equation ties together, with the links of their steps on Gᴺ."""
    system, _, _ = both(name)
    group, Q, V = system.places
    random = generator("sequence of links", name)
    elements = [element(group, random, spread) for _ in range(nodes)]
    g = jax.tree.map(lambda *leaves: np.stack(leaves), *elements)
    G = evaluate(jax.vmap(group.matrix), g)
    q, a0 = spread * random.normal(size=(nodes, Q.ambient(group))), random.normal(size=V.ambient(group))
    F, n, s, a = evaluate(partial(links_by_matrices, system), G, q, a0)
    F = evaluate(jax.vmap(lambda F: stacked(group.from_matrix(F))), F)
    return G, q, a0, theory.Link(F, n, s, a)


@row(
    "(P20)–(P24) on Gᴺ",
    "Euler–Poincaré equations of links with parameters and additional dynamics of each",
    ("mechanics.continuous.vector_field", "groups.Power.ad_dual", *SPACES),
    (POWER, CHAINS),
)
def euler_poincare_equations():
    for name in WORLDS:
        system, state, chain = both(name)
        count = WORLDS[name][1]

        def sides(state, system=system, chain=chain, count=count):
            slope = continuous.vector_field(chain, state.replace(g=stacked(state.g)))
            return rates(system, state, slope.replace(g=apart(slope.g, count)))

        found, expected, change, force = evaluate(sides, state)
        yield off(change, force)
        yield off_each(found, expected)


@row(
    "[Theorem 2](theorems/kelvin-noether.md) on Gᴺ",
    "Kelvin–Noether: 𝒦, the total momentum μ − π⋄n and its spatial form of all links",
    (
        "mechanics.noether.KelvinNoether.momentum_map",
        "mechanics.noether.total_momentum",
        "mechanics.noether.spatial_momentum",
        "groups.Power.Ad_dual",
    ),
    (POWER,),
)
def theorem_2():
    for name in WORLDS:
        system, state, chain = both(name)
        group, Q, _ = system.places
        c0 = generator("kelvin of links", name).normal(size=group.dim)

        def sides(state, system=system, chain=chain, group=group, Q=Q, c0=c0):
            mu, pi = momenta(system, state)
            G, _, _, _ = placed(system, state)
            total = mu - transposed(group, lambda xi: pi @ explicit.turn(Q, group, xi, state.n))
            state = state.replace(mu=mu, pi=pi, g=stacked(state.g))
            found = (
                noether.KelvinNoether(c0).momentum_map(chain, state),
                noether.total_momentum(chain, state),
                noether.spatial_momentum(chain, state),
            )
            back = inverse(G)
            return found, (explicit.Ad(group, back, c0), total, explicit.Ad_dual(group, back, total))

        yield off_each(*evaluate(sides, state))


@row(
    "[Theorem 6](theorems/discrete-euler-poincare.md) on Gᴺ",
    "discrete Euler–Poincaré equations of links",
    (
        "theory.euler_poincare.discrete_euler_poincare",
        "theory.euler_poincare.left_momenta",
        "theory.euler_poincare.right_momenta",
    ),
    (CHAINS,),
)
def theorem_6():
    for name in WORLDS:
        system, chain = both(name)[0], in_group_form(name)
        G, q, a0, links = sequence(name)
        before, here = (evaluate(partial(explicit.legendre, system), *pair(G, q, k), a0) for k in (0, 1))

        def library(first, second, chain=chain):
            ends = euler_poincare.left_momenta(chain, second, H), euler_poincare.right_momenta(chain, first, H)
            return *ends, theory.discrete_euler_poincare(chain, first, second, H)

        found = evaluate(library, at(links, 0), at(links, 1))
        yield off_each(tuple(tuple(pair) for pair in found),
                       (here[:2], before[2:], (here[0] - before[2], here[1] - before[3])))  # fmt: skip


@row(
    "[Theorem 7](theorems/kelvin-noether.md) on Gᴺ",
    "discrete Kelvin–Noether theorem along what the algorithm of Theorem 6 returns",
    ("theory.euler_poincare.discrete_euler_poincare_algorithm",),
    ("models/rods/test_motion.py::test_a_long_rod_keeps_its_momentum_and_a_run_in_two_pieces_is_the_same_to_the_bit",),
    bound=SOLVED,
)
def theorem_7():
    for name in WORLDS:
        system, chain = both(name)[0], in_group_form(name)
        count = WORLDS[name][1]
        _, _, _, links = sequence(name, spread=0.05)
        path = theory.discrete_euler_poincare_algorithm(chain, at(links, 0), H, 4)
        F = evaluate(jax.vmap(lambda F, count=count: apart(F, count)), path.F)
        G, q = rebuilt(system, np.eye(system.group.matrix_size), path._replace(F=F))
        c0 = np.cos(np.arange(float(system.group.dim)))
        _, values, sources = evaluate(jax.vmap(partial(kelvin, system, c0)), G[:-1], G[1:], q[1:], *path[1:4])
        yield off(np.diff(values), sources[1:], values)


@row(
    "[Theorem 1](theorems/euler-poincare.md) on relative poses",
    "g_i e g_j⁻¹, its infinitesimal action and its diamond",
    tuple(f"spaces.RelativePoses.{name}" for name in ("act", "infinitesimal", "diamond")),
    ("models/rods/test_motion.py::test_a_free_rod_that_spins_keeps_its_momentum",),
)
def relative_poses():
    for factor in (co.SO3(), co.SE2(), co.groups.SLn(2)):
        count, space = 3, co.spaces.RelativePoses([(0, 1), (2, 1), (-1, 0)])
        power, random = co.Power(factor, count), generator("poses", factor)
        g, e = ([element(factor, random, 0.5) for _ in range(3)] for _ in range(2))
        x = np.concatenate([np.ravel(leaf) for one in e for leaf in jax.tree.leaves(one)])
        b, xi = random.normal(size=x.shape), random.normal(size=power.dim)

        def moved(matrices, poses, space=space):
            ends = jnp.concatenate([matrices, jnp.eye(matrices.shape[1])[None]])
            return jnp.stack([ends[i] @ e @ inverse(ends[j]) for (i, j), e in zip(space.pairs, poses, strict=True)])

        def flat(matrices, factor=factor):
            leaves = jax.tree.leaves(jax.vmap(factor.from_matrix)(matrices))
            return jnp.concatenate([jnp.reshape(leaf, (len(matrices), -1)) for leaf in leaves], axis=1).ravel()

        def sides(g, e, x, b, xi, factor=factor, power=power, space=space, moved=moved, flat=flat):
            G, E = (jax.vmap(factor.matrix)(jax.tree.map(lambda *l: jnp.stack(l), *one)) for one in (g, e))

            def along(xi):
                turned = jnp.eye(G.shape[1]) + jax.vmap(partial(hat, factor))(jnp.reshape(xi, (3, -1)))
                return flat(moved(turned, E))

            turn = jax.jvp(along, (jnp.zeros_like(xi),), (xi,))[1]
            lifted = -jax.vjp(along, jnp.zeros_like(xi))[1](b)[0]
            found = space.act(power, stacked(g), x), space.infinitesimal(power, xi, x), space.diamond(power, b, x)
            return found, (flat(moved(G, E)), turn, lifted)

        yield off_each(*evaluate(sides, g, e, x, b, xi))
