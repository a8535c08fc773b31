"""A step of the energy–momentum method on a curved Q: its state at the end, and its equations."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, Scalar
from coadjoint.difference_maps import DifferenceMap
from coadjoint.difference_maps.secant import secant, secant_dual
from coadjoint.groups.group import Element
from coadjoint.mechanics.discrete import Point
from coadjoint.mechanics.reduced_functions import added
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System

ENDS = np.array([0.0, 1.0]), np.array([0.5, 0.5])
"""The points of the mean gradient and their weights: both ends, as a chord between them leaves Q."""

STILL = 1e-18
"""|Δx|⁴ under which the correction fades: the mean lacks |Δx|³, which then is below round-off, and 0/0 is avoided."""


class _Unknowns(NamedTuple):
    """ξ_i (points, dim G) and y_i (points, dim Q) at the points; α and β, (ambient,): tangential and normal parts.

    On T_nQ α is the chord's velocity w with n₁ = ρ(n, hw), on the normals u; β is q with π₁ = P₁q, and l. turn: ξ of
    the step, (dim G,). lack: what the mean of the gradients at the points lacks of ℋ₁ − ℋ₀.
    """

    xi: Array
    y: Array
    alpha: Array
    beta: Array
    turn: Array
    lack: Array


class _Slopes(NamedTuple):
    """The value of ℓ(ξ, n, P_nν, a) − ⟨π, P_nν⟩ at a point, which is ⟨μ, ξ⟩ − ℋ, and its gradients."""

    value: Array
    mu: Array
    along_n: Array
    pi: Array
    along_a: Array
    along_t: Array


class CurvedLeap(NamedTuple):
    """A step: H, its middle, hΔ there (dim G,), the gradients at the points, its end, and the rows (m,) that vanish.

    n, pi: (ambient,). a: (dim V*,). mu: (dim G,).
    """

    half: object
    middle: Point
    source: Array
    slopes: list[_Slopes]
    n: Array
    a: Array
    mu: Array
    pi: Array
    rows: Array


class _Moved(NamedTuple):
    """H and H⁻¹; n₁, π₁ and a₁; H⁻¹n₀, H*π₀ and ā with ν and κ; v and b, which hold the end on T*Q."""

    half: Element
    back: Element
    n: Array
    pi: Array
    a: Array
    start: Array
    momentum: Array
    advected: Array
    nu: Array
    kappa: Array
    v: Array
    b: Array


class _Gradient(NamedTuple):
    """(ξ, ρ + v, −φ − b, −β), a gradient of ℋ by (μ, π, n, a), or as long a chord (Δμ, Δπ, Δn, Δa)."""

    mu: Array
    pi: Array
    n: Array
    a: Array

    def at(self, other: _Gradient) -> Array:
        """⟨self, other⟩, one number."""
        return jnp.asarray(sum(x @ y for x, y in zip(self, other, strict=True)))


def split(system: System, z: Array, points: int) -> _Unknowns:
    """The parts of z, (unknowns,)."""
    group, Q, _ = system.places
    sizes = points * group.dim, points * Q.dim(group), Q.ambient(group), Q.ambient(group), group.dim
    ends = [int(end) for end in np.cumsum(sizes)]
    xi, y, alpha, beta, turn, lack = jnp.split(z, ends)
    return _Unknowns(xi.reshape(points, group.dim), y.reshape(points, Q.dim(group)), alpha, beta, turn, lack[0])


def mean_velocity(system: System, state: State, z: _Unknowns, weights: np.ndarray) -> Array:
    """Σ w_i E₀y_i, (ambient,), the tangential part of ρ at the start of the step, for records."""
    group, Q, _ = system.places
    y = weights @ z.y
    return Q.tangent(group, state.n, y)


def first_guess(system: System, state: State, h: Scalar, points: int) -> Array:
    """The unknowns (m,) of an explicit step: a chord Δx of zero length would give the correction no direction."""
    group, Q, _ = system.places
    y = Q.coordinates(group, state.n, state.nu)
    nu = Q.tangent(group, state.n, y)

    def along_n(n: Array):
        near = state.mu, state.pi
        at = state.xi, n, Q.project(group, n, nu), state.a, state.t, state.inputs, state.over_step
        return system.reduced_lagrangian(*at, near=near)

    chord = nu - Q.infinitesimal(group, state.xi, state.n)
    back = group.exp(-h * state.xi)
    pi = Q.pull(group, group.inverse(back), Q.act(group, back, state.n), state.pi) + h * jax.grad(along_n)(state.n)
    w, q = (Q.tangent(group, state.n, Q.coordinates(group, state.n, x)) for x in (chord, pi))
    return jnp.concatenate([*[state.xi] * points, *[y] * points, w, q, state.xi, jnp.zeros(1)])


def curved_leap(
    tau: DifferenceMap, system: System, record: State, h: Scalar, z: _Unknowns, rule: tuple[np.ndarray, np.ndarray]
) -> CurvedLeap:
    """The step of the unknowns z from a record, by a rule of places and weights, (k,) each.

    With ν = A(ρ + v), κ = A*(φ + b) + f and D as on a flat Q the energy changes by its gradient along the chord,
    ⟨(ξ, ρ + v, −φ − b, −β), Δx⟩, x = (μ, π, n, a). The mean over both ends lacks some of ℋ₁ − ℋ₀, and Δx·lack/|Δx|²
    makes up for it (Gonzalez 1996): a correction along all of x vanishes with Δx, one along Δn alone grows where q
    rests in the body. Momenta are kept whatever ξ, ρ, φ and β are.
    """
    group, Q, _ = system.places
    places, weights = rule
    moved = _moved(tau, system, record, h, z)
    after = moved.n, moved.pi, moved.a
    rho = [_tangential(system, record.n, c, moved.n, y) for c, y in zip(places, z.y, strict=True)]
    slopes = [_slopes(system, record, h, float(c), after, *at) for c, *at in zip(places, z.xi, rho, strict=True)]
    phi, beta, along_t = (
        _mean(weights, [getattr(at, name) for at in slopes]) for name in ("along_n", "along_a", "along_t")
    )
    plain = _Gradient(weights @ z.xi, _mean(weights, rho) + moved.v, -phi - moved.b, -beta)
    # On the solution the first part is μ₁ − μ₀; μ₁ itself is known only from the gradient.
    chord = _Gradient(slopes[-1].mu - slopes[0].mu, moved.pi - record.pi, moved.n - record.n, moved.a - record.a)
    square = chord.at(chord)
    share = z.lack * square / (square * square + STILL)
    mean = _Gradient(*(x + share * dx for x, dx in zip(plain, chord, strict=True)))
    middle, source, force, mu = _turned(tau, system, record, h, z, moved, mean)

    rows = [at.mu - record.mu - c * (mu - record.mu) for c, at in zip(places, slopes, strict=True)]
    rows += [Q.coordinates(group, record.n, at.pi) for at in slopes]
    rows.append(moved.nu - secant(tau, group, Q, h * z.turn, middle.n, mean.pi))
    rows.append(h * (moved.kappa - force + secant_dual(tau, group, Q, h * z.turn, middle.n, mean.n)))
    change = plain.at(chord._replace(mu=mu - record.mu)) - h * along_t
    gain = mu @ z.xi[-1] - slopes[-1].value - record.mu @ z.xi[0] + slopes[0].value
    rows += [z.turn - mean.mu, jnp.reshape(z.lack + change - gain, 1)]
    return CurvedLeap(moved.half, middle, source, slopes, moved.n, moved.a, mu, moved.pi, jnp.concatenate(rows))


def _moved(tau: DifferenceMap, system: System, record: State, h: Scalar, z: _Unknowns) -> _Moved:
    group, Q, V = system.places
    half = tau.tau(group, 0.5 * h * z.turn)
    back = group.inverse(half)
    (w, u), (q, l) = _parts(system, record.n, z.alpha), _parts(system, record.n, z.beta)
    n = record.n + Q.difference(group, record.n, h * Q.tangent(group, record.n, w))
    pi = Q.project(group, n, Q.tangent(group, record.n, q))
    start, advected = Q.act(group, back, record.n), V.act(group, back, record.a)
    end = Q.act(group, half, n)
    momentum = Q.pull(group, half, start, record.pi)
    kappa = (Q.pull(group, back, end, pi) - momentum) / h
    v, b = _held(system, record, (n, pi), u, l / h)
    a = V.act(group, back, advected)
    return _Moved(half, back, n, pi, a, start, momentum, advected, (end - start) / h, kappa, v, b)


def _tangential(system: System, n: Array, c: float, n_next: Array, y: Array) -> Array:
    """The velocity of y at n projected onto the tangent space at the part c of the way to n_next."""
    group, Q, _ = system.places
    return Q.project(group, n + c * (n_next - n), Q.tangent(group, n, y))


def _parts(system: System, n: Array, x: Array) -> tuple[Array, Array]:
    """The coordinates of x's tangential part at n, and its normal part."""
    group, Q, _ = system.places
    inside = Q.coordinates(group, n, x)
    return inside, x - Q.tangent(group, n, inside)


def _turned(
    tau: DifferenceMap, system: System, record: State, h: Scalar, z: _Unknowns, moved: _Moved, mean: _Gradient
) -> tuple[Point, Array, Array, Array]:
    """The middle of the step, hΔ and the force there, and μ₁."""
    group, Q, V = system.places
    half, n = moved.half, moved.start + 0.5 * h * moved.nu
    nu = 0.5 * (Q.push(group, half, n, mean.pi) + Q.push(group, moved.back, n, mean.pi))
    middle = Point(z.turn, n, nu, moved.advected, record.t + 0.5 * h)
    torque, force = added(system, system.body_forces(system.motion(*middle, record.inputs, record.over_step)))
    from_advected = V.diamond(group, secant_dual(tau, group, V, h * z.turn, moved.advected, -mean.a), moved.advected)
    turning = Q.diamond(group, moved.kappa - force, n)
    turning = turning + Q.lifted_diamond(group, moved.momentum + 0.5 * h * moved.kappa, n, moved.nu)
    mu = group.Ad_dual(half, group.Ad_dual(half, record.mu) + h * (from_advected + turning + torque))
    return middle, h * (from_advected + torque - Q.diamond(group, force, n)), force, mu


def _mean(weights: np.ndarray, values: list[Array]) -> Array:
    return jnp.asarray(weights) @ jnp.stack(values)


def _slopes(
    system: System, record: State, h: Scalar, c: float, after: tuple[Array, Array, Array], xi: Array, nu: Array
) -> _Slopes:
    """Those at the part c of the way to the end, whose n, π, a are `after`; ν (ambient,) is tangential there."""
    group, Q, _ = system.places
    n, pi, a = (start + c * (end - start) for start, end in zip((record.n, record.pi, record.a), after, strict=True))

    def value(xi: Array, n: Array, nu: Array, a: Array, t: Scalar):
        inside = Q.project(group, n, nu)
        at = xi, n, inside, a, t, record.inputs, record.over_step
        return system.reduced_lagrangian(*at, near=(record.mu, record.pi)) - pi @ inside

    along = jax.value_and_grad(value, argnums=(0, 1, 2, 3, 4))
    found, gradients = along(xi, n, nu, a, jnp.asarray(record.t + c * h))
    return _Slopes(found, *gradients)


def _held(system: System, record: State, after: tuple[Array, Array], u: Array, l: Array) -> tuple[Array, Array]:
    """v and b, (ambient,) each, which hold n₁ on Q and π₁ on T*Q, and do no work up to the third order.

    With P̄ = (P₀ + P₁)/2 v is (1 − P̄)u, so that ⟨Δπ, v⟩ = ⟨π̄, (P₁ − P₀)u⟩, as π₀, π₁ are tangential; b is the gradient
    of ⟨π̄, P_nu⟩ at n̄ plus (1 − P̄)l.
    """
    group, Q, _ = system.places
    n, pi = after
    middle, momentum = 0.5 * (record.n + n), 0.5 * (record.pi + pi)

    def mean(x: Array) -> Array:
        return 0.5 * (Q.project(group, record.n, x) + Q.project(group, n, x))

    u, l = (x - Q.project(group, middle, x) for x in (u, l))
    turned = jax.grad(lambda x: momentum @ Q.project(group, x, u))(middle)
    return u - mean(u), turned + l - mean(l)
