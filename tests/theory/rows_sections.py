"""A row on bundles without a global section: Hopf's fibration, and SO(3) × ℝ² by two sections that do not commute."""

from __future__ import annotations

from functools import cache, partial

import explicit
import jax
import jax.numpy as jnp
import numpy as np
from theorem_row import Rows, off

import coadjoint as co
from bundles import SKEW, generator, monopole, skew_bundle, skew_connection, skew_lagrangian
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.models import hopf
from coadjoint.theory.bundle_motions import bundle_motion

ROWS = Rows("P → M by local sections")
BUNDLE = "mechanics.principal_bundle.PrincipalBundle."
MOTIONS = "theory/test_bundle_motions.py::"
H = 0.05


@cache
def hopf_run():
    p = np.array([np.cos(0.5), 0.0, np.sin(0.5), 0.0])
    velocity = np.array([0.0, 1.1, 0.3, 0.8])
    velocity -= p * (p @ velocity)
    return p, velocity


def spinors(p):
    """p (…, 4) as pairs of complex numbers."""
    return p[..., ::2] + 1j * p[..., 1::2]


def shapes(count: int) -> np.ndarray:
    """Random directions away from both poles, (count, 3)."""
    x = generator("directions").normal(size=(count, 3)) * [1.0, 1.0, 0.4]
    return x / np.linalg.norm(x, axis=1, keepdims=True)


def places(name: str):
    """A bundle, and two shapes that both sections hold."""
    return (
        (hopf.fibration(), shapes(2))
        if name == "hopf"
        else (skew_bundle(), 0.4 * generator("skew").normal(size=(2, 2)))
    )


def chi_of(name: str, x):
    """χ(x) as a matrix: the azimuth of x backwards, or exp(Cx)."""
    if name == "hopf":
        c, s = x[0] / jnp.hypot(x[0], x[1]), x[1] / jnp.hypot(x[0], x[1])
        return jnp.stack([jnp.stack([c, s]), jnp.stack([-s, c])])
    return jax.scipy.linalg.expm(explicit.hat(co.SO3(), jnp.asarray(SKEW) @ x))


@ROWS.add(
    "after (B37), local sections",
    "changes of section of elements, momenta, connections and lifts; motions that pass from one section to another",
    (
        BUNDLE + "transition",
        BUNDLE + "carried",
        BUNDLE + "connection",
        BUNDLE + "discrete_connection",
        BUNDLE + "horizontal_lift",
        "theory.bundle_motions.bundle_motion",
    ),
    (
        MOTIONS + "test_the_motion_upstairs_is_stationary_and_does_not_know_where_sections_change",
        MOTIONS + "test_the_lift_of_a_loop_through_both_poles_turns_by_half_its_solid_angle",
    ),
    bound=1e-11,
)
def local_sections():
    for name in ("hopf", "skew"):
        bundle, x = places(name)
        yield from changes(name, bundle, x[0])
        yield from connections(name, bundle, x)
    t = np.linspace(0, 2 * np.pi, 25)
    path = np.stack([np.sin(t) * np.cos(0.3 * np.sin(t)), np.sin(t) * np.sin(0.3 * np.sin(t)), np.cos(t)], axis=1)
    lifted = spinors(hopf.fibration().horizontal_lift(hopf.phase, path, [1.0, 0.0, 0.0, 0.0]))
    yield off(lifted[0], np.array([1.0, 0.0]))
    steps = np.sum(np.conj(lifted[:-1]) * lifted[1:], axis=1)
    yield off(steps, np.sqrt(0.5 * (1 + np.sum(path[:-1] * path[1:], axis=1))))
    a, b = lifted.T
    z = 2 * np.conj(a) * b
    yield off(np.stack([z.real, z.imag, abs(a) ** 2 - abs(b) ** 2], axis=1), path)
    yield from stationary(hopf.fibration(), monopole(1.3, 0.7), *hopf_run(), 120)
    R = np.linalg.qr(generator("attitude").normal(size=(3, 3)))[0]
    start = np.concatenate([np.ravel(R * np.linalg.det(R)), [-0.8, 0.1]])
    spin = np.ravel(np.cross(R.T * np.linalg.det(R), [0.4, -0.9, 0.6]).T)
    yield from stationary(skew_bundle(), skew_lagrangian, start, np.concatenate([spin, [0.9, 0.3]]), 40)


def changes(name: str, bundle, x):
    """χ in closed form; ⟨μ, ξ⟩ + ⟨π, v⟩ = ⟨μ̃, ξ̃⟩ + ⟨π̃, v⟩ with ξ = Ad_{χ⁻¹}(ξ̃ + (Dχ·v)χ⁻¹); g̃ = gχ⁻¹."""
    group, M, random = bundle.group, bundle.shapes, generator("covectors", name)
    chi = evaluate(partial(chi_of, name), x)
    yield off(evaluate(lambda x: group.matrix(bundle.transition(0, 1, x)), x), chi)
    system = co.System(group, lambda xi, x, v: xi @ xi + v @ v, additional=M)
    g = evaluate(group.exp, random.normal(size=group.dim))
    pi = evaluate(lambda b: M.project(group, x, b), random.normal(size=len(x)))
    state = system.state(g=g, q=x).replace(mu=random.normal(size=group.dim), pi=pi, from_velocities=False)
    moved = evaluate(partial(bundle.carried, 0, 1), state)
    yield off(evaluate(group.matrix, moved.g), evaluate(group.matrix, g) @ np.linalg.inv(chi))
    xi = random.normal(size=(4, group.dim))
    v = evaluate(jax.vmap(lambda v: M.project(group, x, v)), random.normal(size=(4, len(x))))

    def before(xi, v):
        _, along = jax.jvp(partial(chi_of, name), (x,), (v,))
        return explicit.vee(group, jnp.linalg.inv(chi) @ (explicit.hat(group, xi) @ chi + along))

    found = xi @ moved.mu + v @ moved.pi
    yield off(found, evaluate(jax.vmap(before), xi, v) @ state.mu + v @ state.pi)


def connections(name: str, bundle, x):
    """Ã = Ad_χA + (Dχ)χ⁻¹ and Ω̃ = χΩχ⁺⁻¹; A and Ω through s₀ in closed form."""
    group, M = bundle.group, bundle.shapes
    smooth, discrete = (hopf.connection_form, hopf.phase) if name == "hopf" else skew_connection()
    v = evaluate(lambda v: M.project(group, x[0], v), generator("along", name).normal(size=len(x[0])))
    A, A_other = (bundle.connection(smooth, i)(x[0]) @ v for i in (0, 1))
    chi = [evaluate(partial(chi_of, name), y) for y in x]
    along = evaluate(lambda x, v: jax.jvp(partial(chi_of, name), (x,), (v,))[1], x[0], v)
    turned = evaluate(lambda A: explicit.Ad(group, chi[0], A) + explicit.vee(group, along @ jnp.linalg.inv(chi[0])), A)
    yield off(A_other, turned)
    omega, other = (evaluate(group.matrix, bundle.discrete_connection(discrete, i)(*x)) for i in (0, 1))
    if name == "hopf":
        yield off(A, [0.5 * (x[0, 0] * v[1] - x[0, 1] * v[0]) / (1 + x[0, 2])])
        s = [np.array([1 + y[2], y[0] + 1j * y[1]]) for y in x]
        inner = np.conj(s[1]) @ s[0]
        yield off(omega[:, 0], np.array([inner.real, inner.imag]) / abs(inner))
    else:
        yield off(A, np.array([0.3 * x[0, 1] * v[0], 0.2 * v[1], np.sin(x[0, 0]) * v[1]]))
        turn = 0.3 * (x[1, 0] - x[0, 0]) * np.append(x[0], 0.5)
        yield off(omega, evaluate(lambda xi: jax.scipy.linalg.expm(explicit.hat(group, xi)), turn))
    yield off(other, chi[0] @ omega @ np.linalg.inv(chi[1]))


def stationary(bundle, lagrangian, p, velocity, steps: int):
    """D₂L(p, p⁺) + D₁L(p⁺, p⁺⁺) = 0 on T*P along a motion that changes its section, with the momenta of its start."""
    group, P = bundle.group, bundle.total
    found = bundle_motion(bundle, lagrangian, p, velocity, dt=H, steps=steps)
    assert len(set(found.section)) == 2, "a motion through one section shows no change"

    def L(p, q):
        return H * lagrangian(0.5 * (p + q), (q - p) / H)

    def left(before, here, after):
        return P.project(group, here, jax.grad(L, 1)(before, here) + jax.grad(L)(here, after))

    residual = evaluate(jax.vmap(left), found.p[:-2], found.p[1:-1], found.p[2:])
    first = evaluate(lambda p, q: P.project(group, p, -jax.grad(L)(p, q)), *found.p[:2])
    expected = evaluate(lambda p, v: P.project(group, p, jax.grad(lagrangian, 1)(p, v)), p, velocity)
    yield off(residual, np.zeros_like(residual), expected)
    yield off(first, expected)
    yield off((found.time, found.p[0]), (H * np.arange(steps + 1), p))
    fibre = evaluate(jax.vmap(lambda e: P.infinitesimal(group, e, p)), np.eye(group.dim))
    yield off(found.momentum, np.broadcast_to(fibre @ expected, found.momentum.shape))
    yield off(found.x, evaluate(jax.vmap(bundle.project), found.p))
