"""The mechanics of the table of theorems written anew with matrices: nothing here calls what the rows measure.

Of the library this uses the matrices of a group's elements and of its basis alone. A random system is that of
`systems`; L is its Lagrangian before reduction, on curves and on pairs of configurations.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

import coadjoint as co
from coadjoint.kernels.trace.evaluate import evaluate
from discrete import velocity
from systems import GROUPS, HALF_PLANE, element, generator, system_on

H = 0.1

SPACES: dict[str, tuple[Any, Any]] = {
    "SO3": (co.Defining(), co.Defining()),
    "SE2": (co.spaces.Points(), co.spaces.Adjoint()),
    "SE3": (co.spaces.Points(), co.spaces.Dual()),
    "SL2": (co.spaces.Dual(), co.Defining()),
    "SL2 on the half plane": (HALF_PLANE, HALF_PLANE),
    "Heisenberg": (co.Coadjoint(), co.spaces.Adjoint()),
    "SO3xSE2": (co.Defining(), co.Coadjoint()),
    "SO4": (co.Trivial(2), co.Defining()),
    "SO3 with shapes": (co.Trivial(2), co.Defining()),
    "SE2 with shapes": (co.Trivial(2), co.Defining()),
}
"""Q and V* of the random systems, by a name that begins with their group's."""


@lru_cache(maxsize=64)
def random_system(name: str, parts: str = "na") -> tuple[co.System, co.State]:
    """The random system of a group with additional dynamics (n), advected parameters (a), both or none."""
    Q, V = SPACES[name]
    spaces = Q if "n" in parts else None, V if "a" in parts else None
    return system_on(GROUPS[name.split()[0]], *spaces, False, f"theorems {name} {parts}")


@lru_cache(maxsize=64)
def group_system(name: str, parts: str = "na") -> co.System:
    """Λ(F, n, s, a; h) = h ℓ((F − F⁻¹)ᵛ/2h, n, (s − n)/h, a) of a random ℓ."""
    system, _ = random_system(name, parts)
    return in_group_form(system)


def in_group_form(system: co.System) -> co.System:
    """The same of any ℓ."""
    group, Q, V = system.places

    def group_lagrangian(F, *rest):
        n, s = rest[:2] if Q.ambient(group) else (jnp.zeros(0), jnp.zeros(0))
        a = rest[-3] if V.ambient(group) else jnp.zeros(0)
        h = rest[-1]
        return h * lagrangian(system, velocity(group, F, h), n, (s - n) / h, a)

    spaces = {"additional": Q if Q.ambient(group) else None, "advected": V if V.ambient(group) else None}
    return co.System(group, group_lagrangian=group_lagrangian, parameters=system.parameters, **spaces)


def lagrangian(system: co.System, xi, n, nu, a):
    """The ℓ of `systems`: ½ zᵀMz + (r·z)⁴/20 + Σ c_i sin(w_i·(z, y)) + |z|² cos(u·y)/10 of z = (ξ, ν), y = (n, a)."""
    p: Any = system.parameters
    z, y = jnp.concatenate([xi, nu]), jnp.concatenate([n, a])
    coupled = p.c @ jnp.sin(p.w @ jnp.concatenate([z, y])) + 0.1 * (z @ z) * jnp.cos(p.u @ y)
    return 0.5 * z @ p.M @ z + 0.05 * (p.r @ z) ** 4 + coupled


def hat(group, xi):
    """ξ̂ = Σ ξ_k e_k."""
    return jnp.tensordot(xi, group.basis, axes=1)


def vee(group, X):
    """The coordinates of a matrix in the basis, by least squares."""
    return np.linalg.pinv(group.basis.reshape(group.dim, -1).T) @ jnp.ravel(X)


def inverse(G):
    return jnp.linalg.inv(G)


def Ad(group, G, xi):
    """(G ξ̂ G⁻¹)ᵛ."""
    return vee(group, G @ hat(group, xi) @ inverse(G))


def Ad_dual(group, G, mu):
    """The transpose of Ad_G, by its matrix."""
    return jax.vmap(lambda e: Ad(group, G, e))(jnp.eye(group.dim)) @ mu


def bracket(group, xi, eta):
    """[ξ̂, η̂]ᵛ."""
    X, Y = hat(group, xi), hat(group, eta)
    return vee(group, X @ Y - Y @ X)


def ad_dual(group, xi, mu):
    """The transpose of ad_ξ, by its matrix."""
    return jax.vmap(lambda e: bracket(group, xi, e))(jnp.eye(group.dim)) @ mu


def move(space, group, G, x, velocity: bool = False):
    """Gx for a point, or for a velocity where the action is affine, of each kind of space."""
    if isinstance(space, co.Trivial):
        return x
    if space is HALF_PLANE:
        z, one = jnp.array([[x[0], -x[1]], [x[1], x[0]]]), jnp.eye(2)  # x + iy, as a matrix
        return ((G[0, 0] * z + G[0, 1] * one) @ inverse(G[1, 0] * z + G[1, 1] * one))[:, 0]
    if isinstance(space, co.spaces.Points):
        return (G @ jnp.append(x, 0.0 if velocity else 1.0))[:-1]
    if isinstance(space, co.Defining):
        return G @ x
    if isinstance(space, co.spaces.Dual):
        return inverse(G).T @ x
    if isinstance(space, co.spaces.Adjoint):
        return Ad(group, G, x)
    assert isinstance(space, co.Coadjoint), f"{space!r} has no formula here"
    return Ad_dual(group, inverse(G), x)


def turn(space, group, xi, x, velocity: bool = False):
    """ξ·x, or L_ξv: the derivative of (1 + εξ̂)x."""
    one = jnp.eye(group.matrix_size)
    return jax.jvp(lambda G: move(space, group, G, x, velocity), (one,), (hat(group, xi),))[1]


def carry(space, group, G, x, v):
    """Gv at Gx, of a velocity v at x."""
    return jax.jvp(lambda x: move(space, group, G, x), (x,), (v,))[1]


def lift(space, group, xi, x, v):
    """L_ξv at x: the derivative of ξ·x along v."""
    return jax.jvp(lambda x: turn(space, group, xi, x), (x,), (v,))[1]


def continuous(system: co.System):
    """L(G, Ġ, q, q̇, a₀) = ℓ((G⁻¹Ġ)ᵛ, G⁻¹q, G⁻¹q̇, G⁻¹a₀) (P17) of matrices G, Ġ."""
    group, Q, V = system.places

    def L(G, G_dot, q, q_dot, a0):
        back = inverse(G)
        n, nu = move(Q, group, back, q), carry(Q, group, back, q, q_dot)
        return lagrangian(system, vee(group, back @ G_dot), n, nu, move(V, group, back, a0))

    return L


def euler_lagrange(system: co.System, G, xi, xi_dot, q, q_dot, q_ddot, a0):
    """d/dt ∂L/∂ċ − ∂L/∂c along (Gê_i, 0) and (0, e_j) on a curve of given accelerations, and its largest term.

    The curve is G(1 + tX + ½t²(X² + Ẋ)), whose body velocity is ξ + tξ̇, and q + tq̇ + ½t²q̈.
    """
    group, L = system.group, continuous(system)
    X, X_dot = hat(group, xi), hat(group, xi_dot)

    def at(t):
        g = G @ (jnp.eye(group.matrix_size) + t * X + 0.5 * t**2 * (X @ X + X_dot))
        g_dot = G @ (X + t * (X @ X + X_dot))
        return g, g_dot, q + t * q_dot + 0.5 * t**2 * q_ddot, q_dot + t * q_ddot, a0

    def along(eta, w):
        def momentum(t):
            g, g_dot, x, v, a0 = at(t)
            return jax.jvp(lambda d, v: L(g, d, x, v, a0), (g_dot, v), (g @ hat(group, eta), w))[1]

        g, g_dot, x, v, _ = at(0.0)
        Y = hat(group, eta)
        force = jax.jvp(lambda *c: L(*c, v, a0), (g, g_dot, x), (g @ Y, g_dot @ Y, w))[1]
        return jax.jvp(momentum, (0.0,), (1.0,))[1], force

    count = group.dim + len(q)
    ways = jnp.eye(count)
    return jax.vmap(along)(ways[:, : group.dim], ways[:, group.dim :])


def of_pair(system: co.System, h: float = H):
    """L(G, q, G⁺, q⁺, a₀) = h ℓ((F − F⁻¹)ᵛ/2h, n, (s − n)/h, a), F = G⁻¹G⁺, n = G⁻¹q, s = G⁻¹q⁺, a = G⁻¹a₀ (P36)."""
    group, Q, V = system.places

    def L(G, q, G_next, q_next, a0):
        back = inverse(G)
        F, n, s = back @ G_next, move(Q, group, back, q), move(Q, group, back, q_next)
        return of_step(system, F, n, s, move(V, group, back, a0), h)

    return L


def of_step(system: co.System, F, n, s, a, h: float = H):
    """Λ(F, n, s, a; h) of a matrix F (P37)."""
    return h * lagrangian(system, vee(system.group, F - inverse(F)) / (2 * h), n, (s - n) / h, a)


def legendre(system: co.System, G, q, G_next, q_next, a0, h: float = H):
    """(μ_k, π_k, μ_{k+1}, π_{k+1}) of a step: the derivatives of L along g e^{εη̂} and g(g⁻¹q + εw) at its two ends."""
    group, Q, _ = system.places
    L, one = of_pair(system, h), jnp.eye(group.matrix_size)

    def shifted(G, q, w):
        return move(Q, group, G, move(Q, group, inverse(G), q) + w)

    def moved(eta, w, eta_next, w_next):
        first = G @ (one + hat(group, eta)), shifted(G, q, w)
        second = G_next @ (one + hat(group, eta_next)), shifted(G_next, q_next, w_next)
        return L(*first, *second, a0)

    still = jnp.zeros(group.dim), jnp.zeros(len(q))
    mu, pi, mu_next, pi_next = jax.grad(moved, argnums=(0, 1, 2, 3))(*still, *still)
    return -mu, -pi, mu_next, pi_next


def action(system: co.System, G, q, a0, h: float = H):
    """Σ L over a sequence of matrices and points (B7)."""
    return jnp.sum(jax.vmap(lambda *pair: of_pair(system, h)(*pair, a0))(G[:-1], q[:-1], G[1:], q[1:]))


def stationarity(system: co.System, G, q, a0, h: float = H):
    """The derivative of the action along δG_k = G_kη̂, δq_k at the inner nodes: (N−1, dim) and (N−1, m)."""
    return stationarity_of(system.group, lambda G, q: action(system, G, q, a0, h), G, q)


def stationarity_of(group, total, G, q):
    """The same of any action, a function of the matrices and points."""

    def varied(eta, w):
        pad = jnp.zeros((1, group.dim)), jnp.zeros((1, q.shape[1]))
        eta, w = (jnp.concatenate([p, x, p]) for p, x in zip(pad, (eta, w), strict=True))
        moved = jax.vmap(lambda g, e: g @ (jnp.eye(group.matrix_size) + hat(group, e)))(G, eta)
        return total(moved, q + w)

    inner = len(q) - 2
    return jax.grad(varied, argnums=(0, 1))(jnp.zeros((inner, group.dim)), jnp.zeros((inner, q.shape[1])))


def random_sequence(name: str, parts: str = "na", nodes: int = 4):
    """Any elements, their matrices, points of Q, and a₀: a sequence that no equation ties together."""
    system, _ = random_system(name, parts)
    group, Q, V = system.places
    random = generator("sequence", name, parts)
    elements = [element(group, random, 0.35) for _ in range(nodes)]
    g = jax.tree.map(lambda *leaves: np.stack(leaves), *elements)
    q = np.stack([Q.sample(group, random) for _ in range(nodes)])
    return g, evaluate(jax.vmap(lambda g: group.matrix(g)), g), q, V.sample(group, random)
