"""Sequences of configurations that solve nothing, with links and variations by matrices; what is left of solutions."""

from __future__ import annotations

from functools import partial

import explicit
import jax
import jax.numpy as jnp
import numpy as np
from explicit import H, carry, group_system, hat, inverse, move, random_sequence, random_system
from theorem_row import off

from coadjoint import theory
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.methods.group_variational import LastIncrement
from systems import generator

GROUPS = ("SO3", "SE2", "SL2", "SE3", "SL2 on the half plane")
SOLVED = 1e-11
"""Of the momenta: what Newton's iteration and the round-off of some steps leave."""


def at(tree, k):
    return jax.tree.map(lambda leaf: leaf[k], tree)


def links_by_matrices(system, G, q, a0):
    """F, n, s, a of a sequence, all by matrices."""
    group, Q, V = system.places
    back = jax.vmap(jnp.linalg.inv)(G[:-1])
    points = [jax.vmap(lambda B, x: move(Q, group, B, x))(back, x) for x in (q[:-1], q[1:])]
    return back @ G[1:], *points, jax.vmap(lambda B: move(V, group, B, a0))(back)


def sequences(parts: str = "na", names=GROUPS, nodes: int = 4):
    """Random systems in group form with a sequence that solves nothing, and its links by the library's elements."""
    for name in names:
        system = group_system(name, parts)
        g, G, q, a0 = random_sequence(name, parts, nodes)
        F, n, s, a = evaluate(partial(links_by_matrices, system), G, q, a0)
        yield system, g, G, q, a0, theory.Link(evaluate(jax.vmap(system.group.from_matrix), F), n, s, a)


def records_of(name: str, parts: str, links, g):
    """A record for every link, as a step in group form leaves it, with momenta that fit nothing."""
    _, start = random_system(name, parts)
    count = len(links.n)
    mu = generator("mu", name).normal(size=(count, len(start.mu)))
    pi = generator("pi", name).normal(size=links.n.shape)
    memory = LastIncrement(links.F, np.zeros((count, len(start.mu))), np.full(count, H))
    shared = {"t": H * np.arange(count), "xi": np.zeros_like(mu), "t_rest": np.zeros(count)}
    first = jax.tree.map(lambda leaf: leaf[:count], g)
    nu = (links.s - links.n) / H
    return start.replace(
        g=first, n=links.n, a=links.a, nu=nu, mu=mu, pi=pi, memory=memory, from_velocities=False, **shared
    )


def rebuilt(system, G0, links):
    """The matrices and points that links lead to from G₀."""
    group, Q, _ = system.places
    G = [G0]
    for F in evaluate(jax.vmap(group.matrix), links.F):
        G.append(G[-1] @ F)
    frames, ends = np.stack([*G[:-1], G[-2]]), np.concatenate([links.n, links.s[-1:]])
    return np.stack(G), evaluate(jax.vmap(lambda G, x: move(Q, group, G, x)), frames, ends)


def unsolved(system, G, q, a0):
    """What is left of the stationarity of the action, relative to the momenta."""
    left = evaluate(partial(explicit.stationarity, system), G, q, a0)
    return off(
        left, jax.tree.map(np.zeros_like, left), evaluate(partial(explicit.legendre, system), *pair(G, q, 0), a0)
    )


def pair(G, q, k):
    return G[k], q[k], G[k + 1], q[k + 1]


def gentle(system, links):
    """A link with F next to e and s next to n, so that a solution goes on from it."""
    first = at(links, 0)
    turned = generator("gentle", system.group).normal(scale=0.5 * H, size=system.group.dim)
    F = evaluate(lambda xi: system.group.exp(xi), turned)
    return first._replace(F=F, s=first.n + 0.1 * (first.s - first.n))


def varied(system, G, q, a0, eta, w):
    """δF, δn, δs, δa and δΣL of a sequence under δg = gη̂, g⁻¹δq = w, by differentiation of matrices."""
    group, Q, _ = system.places

    def moved(e):
        pushed = jax.vmap(lambda G, q, w: carry(Q, group, G, move(Q, group, inverse(G), q), w))(G, q, w)
        turned = jax.vmap(lambda G, eta: G @ (jnp.eye(group.matrix_size) + e * hat(group, eta)))(G, eta)
        path = turned, q + e * pushed
        return links_by_matrices(system, *path, a0), explicit.action(system, *path, a0)

    return jax.jvp(moved, (0.0,), (1.0,))[1]


def induced(system, links, eta, w):
    """The same by the library, the tangent of F as a matrix."""

    def change(*parts):
        made = theory.induced_variation(system, theory.Link(*parts[:4]), theory.Variation(*parts[4:]))
        return made, jax.jvp(system.group.matrix, (parts[0],), (made.F,))[1]

    return jax.vmap(change)(*links[:4], eta[:-1], w[:-1], eta[1:], w[1:])
