"""The discrete Lagrange–Poincaré equations (B35–B36): discrete mechanics on M × G seen through a connection.

Where G acts on a part q of the shapes, x = g⁻¹q, and the equations are those of the bundle G × Q → Q; ∂_a l⋄a stands
with the momentum where there are advected parameters a_{k+1} = F_k⁻¹a_k.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError, StepError
from coadjoint.groups.derivative import right_derivative
from coadjoint.groups.group import Element
from coadjoint.kernels.newton import solver
from coadjoint.kernels.program import Code
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.bundle import reconstructed, reduced, shapes_of
from coadjoint.mechanics.connection import finite
from coadjoint.mechanics.discrete_connection import DiscreteConnection
from coadjoint.mechanics.internal_state import stepped
from coadjoint.mechanics.locked_inertia import shape_size
from coadjoint.mechanics.noether import total_momentum
from coadjoint.mechanics.start import with_own_momenta
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods import Method
from coadjoint.methods.renewal import held
from coadjoint.methods.step import Step
from coadjoint.theory.discrete_connections import link, one_stage, positive_step
from coadjoint.theory.slopes import impulse_of


class BundleMotion(NamedTuple):
    """A motion on M × G in reduced variables: times (N+1,), shapes x (N+1, m), σ (N), and g (N+1) rebuilt from them."""

    time: Array
    x: np.ndarray
    sigma: Element
    g: Element


class Contribution(NamedTuple):
    """What one step contributes to (B35–B36).

    group = D^R_σ l − T⁺ + φ⁺⋄x⁺ ∈ 𝔤*, carried = Ad*_{F⁻¹} D^R_σ l + ∂_a l⋄a + T⁻ − φ⁻⋄x, first = D₁l +
    (Ad_{F⁻¹}B₁)* D^R_σ l + φ⁻, last = D₃l + (Ad_{F⁻¹}B₂)* D^R_σ l + φ⁺, with F = Ωσ⁻¹, ⟨B₁, δx⟩ = (∂_xΩ·δx)Ω⁻¹ and B₂
    likewise; (T⁻, φ⁻), (T⁺, φ⁺) are what forces give at the two ends of the step.

    group, carried: (dim G,). first, last: (size,), covectors at x and at x⁺.
    """

    group: Array
    carried: Array
    first: Array
    last: Array


@dataclass(frozen=True)
class ReducedLagrangian:
    """l(x, σ, x⁺) = Λ(Ω(x, x⁺)σ⁻¹, x, x⁺; h) of a rule on M × G (B33–B34), with its slopes.

    h: one number, s.
    """

    system: System
    step: Step
    connection: DiscreteConnection
    h: Array

    def increment(self, x: Array, sigma: Element, x_next: Array) -> Element:
        """F = Ω(x, x⁺) σ⁻¹ of shapes x and x⁺ (m,)."""
        group = self.system.group
        return group.compose(self.connection.increment(x, x_next), group.inverse(sigma))

    def velocity(self, state: State, x: Array, sigma: Element, x_next: Array) -> Array:
        """ξ, (dim G,), with F(hξ) = Ω(x, x⁺)σ⁻¹ for shapes x and x⁺ (m,); NaN where there is none.

        The chart of the rule is inverted by Newton's method.
        """
        group, F = self.system.group, self.increment(x, sigma, x_next)
        root = solver.solve(lambda xi: self._apart(state, xi, F), state.xi, self.h, (group.dim,))
        away = group.matrix(self._turn(state, root.unknowns)) - group.matrix(F)
        found = (root.code == Code.CONVERGED) & (jnp.max(jnp.abs(away)) < 1e-9 * jnp.max(jnp.abs(group.matrix(F))))
        return jnp.where(found, root.unknowns, jnp.nan)

    def value(self, state: State, xi: Array, x: Array, sigma: Element, x_next: Array) -> Scalar:
        """l(x, σ, x⁺), one number, about the ξ (dim G,) of this step: right in the value and its first derivatives.

        state: one with a. x, x_next: (m,). One step of Newton's method takes ξ along with x, σ and x⁺, exact to
        first order.
        """
        F = self.increment(x, sigma, x_next)
        slope = jax.jacfwd(lambda xi: self._apart(state, xi, F))(xi)
        xi = xi - jnp.linalg.solve(slope, self._apart(state, xi, F))
        return self.step.discrete_lagrangian(self.system, self._record(state, xi, x, x_next), self.h)

    def _turn(self, state: State, xi: Array) -> Element:
        """F(hξ)."""
        still = jnp.zeros(self.system.additional.dim(self.system.group))
        record = self.step.record(self.system, state, self.h, jnp.concatenate([xi, still]))
        return self.step.relative(self.system, record, self.h)

    def _apart(self, state: State, xi: Array, F: Element) -> Array:
        """How far F(hξ) is from F, in coordinates of 𝔤."""
        group = self.system.group
        relative = group.compose(self._turn(state, xi), group.inverse(F))
        return group.vee(group.matrix(relative) - jnp.eye(group.matrix_size))

    def slopes(self, state: State, xi: Array, x: Array, sigma: Element, x_next: Array) -> Contribution:
        """D^R_σ l, and what stands with it in the equation of the shapes, about the ξ of this step."""
        (group, M, V), omega = self.system.places, self.connection.increment

        def value(x: Array, sigma: Element, x_next: Array, a: Array) -> Scalar:
            return self.value(state.replace(a=a), xi, x, sigma, x_next)

        D1, D3, along_a = jax.grad(value, argnums=(0, 2, 3))(x, sigma, x_next, state.a)
        along_sigma = right_derivative(group, lambda sigma: value(x, sigma, x_next, state.a), sigma)
        carried = group.Ad_dual(group.inverse(self.increment(x, sigma, x_next)), along_sigma)
        back = group.inverse(omega(x, x_next))

        def turned(x: Array, x_next):
            return group.vee(group.matrix(group.compose(omega(x, x_next), back)))

        B1, B2 = jax.vjp(turned, x, x_next)[1](carried)
        work = impulse_of(self.system, self.step, self.h, self._record(state, xi, x, x_next))
        group_part = along_sigma - work.torque_next + M.diamond(group, work.force_next, x_next)
        carried = carried + V.diamond(group, along_a, state.a) + work.torque - M.diamond(group, work.force, x)
        first = M.project(group, x, D1 + B1 + work.force)
        return Contribution(group_part, carried, first, M.project(group, x_next, D3 + B2 + work.force_next))

    def _record(self, state: State, xi: Array, x: Array, x_next: Array) -> State:
        return link(self.system, self.step, self.h, state, xi, x, x_next)


class _Node(NamedTuple):
    """A node of the reduced algorithm: the contribution of step k−1; t, x_k, held quantities and guesses in a state."""

    before: Array
    last: Array
    state: State


def lagrange_poincare(
    system: System, start: State, *, dt: float, steps: int, method: Method, connection: DiscreteConnection
) -> BundleMotion:
    """Solve the discrete Lagrange–Poincaré equations for (σ_k, x_{k+1}) and rebuild g_{k+1} = g_k Ω σ_k⁻¹.

        Ad*_{F_k⁻¹} D^R_σ l_k + ∂_a l_k⋄a_k = D^R_σ l_{k−1}
        D₁l_k + (Ad_{F_k⁻¹}B₁)* D^R_σ l_k + D₃l_{k−1} + (Ad_{F_{k−1}⁻¹}B₂)* D^R_σ l_{k−1} = 0          (B35–B36)

    system: one with shapes, which are all of its `additional`, flat or curved; where G acts on q, x = g⁻¹q. start: its
    state. dt: h, s. steps: N, from 1 on. method: a rule of one stage. connection: a co.mechanics.DiscreteConnection;
    the motion does not depend on it, and is that of co.simulate with the same method. Forces add T⁻_k − φ⁻_k⋄x_k to the
    left and −T⁺_{k−1} + φ⁺_{k−1}⋄x_k to the right of the first equation, φ⁻_k + φ⁺_{k−1} to the second; inputs are
    those of `system.driven(inputs)`. Written to be read and compared with, not for speed. Returns times (N+1,), shapes
    (N+1, m), σ with N and g with N+1 rows. Raises ArgumentError for systems without shapes, and StepError where Newton
    fails.
    """
    l = _reduced_lagrangian(system, method, connection, dt)
    steps = checks.whole(steps, "steps")
    state = _begun(system, start, method, dt)
    at = _Node(evaluate(lambda state: -total_momentum(system, state), state), state.pi, state)
    advance = tabulate(partial(_advance, l), at)
    shapes, sigmas = [state.n], []
    for k in range(steps):
        sigma, at, code = advance(at)
        if code != Code.CONVERGED or not np.all(np.isfinite(at.last)):
            raise StepError(
                f"The Lagrange–Poincaré equations have no solution at step {k}, t = {k * dt:g} s, that Newton's method "
                "finds: take a smaller dt."
            )
        shapes.append(at.state.n)
        sigmas.append(sigma)
    x, sigma = np.stack(shapes), jax.tree.map(lambda *rows: np.stack(rows), *sigmas)
    return BundleMotion(start.t + dt * np.arange(len(x)), x, sigma, reconstructed(connection, start.g, x, sigma))


def _advance(l: ReducedLagrangian, at: _Node) -> tuple[Element, _Node, Array]:
    """σ_k = F(hξ)⁻¹Ω, the next node at x_{k+1} = F⁻¹s, and Newton's code: the unknowns (ξ, y) are those of the step."""
    system, step, h, state = l.system, l.step, l.h, at.state
    (group, M, V), dim, x = system.places, system.group.dim, at.state.n

    def slopes(z):
        record, turn = step.record(system, state, h, z), step.turn(system, h, z[:dim])
        back = group.inverse(step.relative(system, record, h))
        if turn is None:
            s = x + h * record.nu
        else:
            s = M.act(group, turn, M.act(group, group.inverse(turn), x) + h * record.nu)
        x_next = M.act(group, back, s)
        sigma = group.compose(back, l.connection.increment(x, x_next))
        after = record.later(h, n=x_next, a=V.act(group, back, state.a))
        return l.slopes(state, z[:dim], x, sigma, x_next), sigma, after

    def residual(z):
        now, _, _ = slopes(z)
        return jnp.concatenate([now.carried - at.before, M.coordinates(group, x, now.first + at.last)])

    root = solver.solve(residual, step.guess(system, state, h), h, step.blocks(system))
    now, sigma, after = slopes(root.unknowns)
    return sigma, _Node(now.group, now.last, _next(system, after, now, h)), root.code


def _next(system: System, after: State, slopes: PyTree, h: Scalar) -> State:
    """The state at the next node, with its momenta and the quantities held over the step from there: μ = m + π⋄x."""
    mu = -slopes.group + system.additional.diamond(system.group, slopes.last, after.n)
    return held(system, stepped(after.replace(mu=mu, pi=slopes.last)), h)


def lagrange_poincare_residual(
    system: System, start: State, *, dt: float, method: Method, connection: DiscreteConnection, g: Element, x: ArrayLike
) -> np.ndarray:
    """Left minus right side of (B35), (B36) at the inner nodes of any motion on M × G, shape (N−1, dim G + dim M).

    system, dt, method, connection: as in co.theory.lagrange_poincare. start: gives time and advected parameters of the
    first node, and guesses. g: elements with a leading axis (N+1), such as run.records.g. x: shapes (N+1, m), such as
    run.records.n. On a curved M, (B36) is given in the frame of M at x_k.
    The residual is zero for the motions of the method, whatever the connection.
    """
    l = _reduced_lagrangian(system, method, connection, dt)
    (group, M, V), x = system.places, shapes_of(connection, x)
    sigma = reduced(connection, g, x)
    state = _begun(system, start, method, dt)
    ends = x[:-1], sigma, x[1:]
    xi = evaluate(jax.vmap(partial(l.velocity, state)), *ends)

    def next_state(state, xi: Array, x: Array, sigma, x_next):
        back = group.inverse(l.increment(x, sigma, x_next))
        nu = link(system, l.step, l.h, state, xi, x, x_next).nu
        centre = (
            xi if state.memory is None else state.xi
        )  # a memory holds the F at this ξ, the centre of Newton's chart
        after = state.replace(xi=centre, nu=nu).later(l.h, n=x_next, a=V.act(group, back, state.a))
        return _next(system, after, l.slopes(state, xi, x, sigma, x_next), l.h)

    steps = [jax.tree.map(lambda leaf, k=k: leaf[k], (xi, *ends)) for k in range(len(x) - 2)]
    states = [state.replace(n=x[0])]
    if steps:
        advance = tabulate(next_state, state, *steps[0])
        for step in steps:
            states.append(advance(states[-1], *step))
    states = jax.tree.map(lambda *rows: np.stack(rows), *states)
    slopes = evaluate(jax.vmap(l.slopes), states, xi, *ends)
    turning, moving = slopes.carried[1:] - slopes.group[:-1], slopes.first[1:] + slopes.last[:-1]
    moving = evaluate(jax.vmap(partial(M.coordinates, group)), x[1:-1], moving)
    return finite(np.concatenate([turning, moving], axis=1), "The reduced Lagrangian")


def _begun(system: System, start: State, method: Method, h: Scalar) -> State:
    """What the method begins at the start, as in co.simulate: with the start's momenta under the first inputs."""
    if method.start != "velocity":
        start = with_own_momenta(system.driven(None), start)
    inputs = system.inputs
    if inputs is not None and inputs.holds:
        start = start.replace(inputs=evaluate(lambda s: inputs.held(system.motion_at(s), s.inputs), start))
    return evaluate(lambda state: held(system, state, h), method.begin(system, start, h))


def _reduced_lagrangian(system: System, method: Method, connection: object, dt: Scalar) -> ReducedLagrangian:
    """l of a rule through a connection; raises ArgumentError for what does not fit."""
    size = shape_size(system)
    connection = checks.instance(connection, "connection", DiscreteConnection, "a co.mechanics.DiscreteConnection")
    if (connection.group, connection.size) != (system.group, size):
        raise ArgumentError(
            f"The connection is on {connection.group!r} with {connection.size} shape coordinates, but the system on "
            f"{system.group!r} with {size}."
        )
    return ReducedLagrangian(system, one_stage(system, method), connection, positive_step(dt))
