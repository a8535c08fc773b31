"""The midpoint rule of a Lagrangian linear in the velocities, projected onto the momenta of the place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import evaluate, traced
from coadjoint.mechanics import phase_space
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.discrete import Node, Point
from coadjoint.mechanics.momentum_sizes import above, largest
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.increments import HalfStepSquared
from coadjoint.methods.method import Claims, Method
from coadjoint.methods.midpoint import Midpoint
from coadjoint.methods.step import Step
from coadjoint.spaces.space import require_flat


class Shift(NamedTuple):
    """The memory of the method: the velocity λ of the shift at both ends of the step.

    xi: (dim G,). nu: (ambient,).
    """

    xi: Array
    nu: Array


class Lift(NamedTuple):
    """ϑ at a place, and what ⟨ϑ, λ⟩ contributes to the equations there, as in `Node`.

    mu, turning, source: (dim G,). pi, force: (ambient,).
    """

    mu: Array
    pi: Array
    turning: Array
    force: Array
    source: Array


@dataclass(frozen=True)
class ProjectedMidpoint(Method, HalfStepSquared):
    """`Midpoint` Φ between two shifts, for ℓ = ⟨ϑ(n, a), (ξ, ν)⟩ − H(n, a), so that (μ, π) = ϑ(n, a) at every node.

    The shift K by λ = (λ_ξ, λ_ν) is the Hamiltonian motion of ⟨(μ, π) − ϑ, λ⟩ over h, by the left rectangle rule:

        K_λ: n ↦ F⁻¹(n + hλ_ν), a ↦ F⁻¹a, μ ↦ Ad*_F(μ + D), π ↦ F*(π + κ), F = τ(hλ_ξ),
        κ = h∂_n⟨ϑ, λ⟩, D = h(∂_a⟨ϑ, λ⟩⋄a + ∂_n⟨ϑ, λ⟩⋄n) + (π + κ)⋄hλ_ν.

    Solve K_λ(x_{k+1}, ϑ(x_{k+1})) = Φ(K_λ(x_k, ϑ(x_k))) for the ξ, ν of Φ and for λ, which is O(h²). Without shifts
    (μ, π) leaves ϑ by a mode of ratio −1, which grows. Order 2, symmetric; momenta are exact for every ϑ. Where half of
    the components of ϑ vanish, up to a total derivative of at most second degree, λ moves the other variables alone,
    the step is the midpoint rule in canonical variables, and dϑ is kept exactly. Elsewhere dϑ changes by O(h⁵) a step:
    energy has no trend if the motion is reversible, and otherwise one of O(h⁴).

    Raises ArgumentError unless ℓ is linear in the velocities, and on a curved space of additional dynamics.
    Source: Kraus, Projected variational integrators for degenerate Lagrangian systems, arXiv:1708.07356 (2017).
    """

    constrainable = False

    @property
    def order(self) -> int:
        return 2

    @property
    def symmetric(self) -> bool:
        return True

    @property
    def claims(self) -> Claims:
        return Claims(self.order, self.symmetric, symplectic=False)

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        return ((self, 1.0),)

    @property
    def regular(self) -> bool:
        return False

    @property
    def remedies(self) -> tuple[str, str]:
        unsolved, beyond = super().remedies
        return f"{unsolved}, or look for a place where ω = dϑ is singular", beyond

    @property
    def base(self) -> Midpoint:
        """Φ."""
        return Midpoint(self.difference_map)

    def blocks(self, system: System) -> tuple[int, ...]:
        return 2 * system.group.dim, 2 * system.additional.dim(system.group)

    def require_fit(self, system: System) -> None:
        super().require_fit(system)
        if system.lagrangian is None:
            raise ArgumentError(f"{type(self).__name__} needs a system with a `lagrangian`: use co.Midpoint().")
        require_flat(system.additional, type(self).__name__, "give Q by coordinates, as with co.Trivial(2)")
        self._start_from_momenta()

    def remember(self, system: System, state: State) -> State:
        if not phase_space.linear(system, state):
            system.check(state)  # that the mass matrix is regular, so that the remedy is one
            raise ArgumentError(
                f"{type(self).__name__} is for Lagrangians that are linear in the velocities: use co.Midpoint()."
            )

        def begun(state: State, parameters: PyTree) -> tuple[phase_space.FirstOrder, Shift]:
            found = phase_space.velocities(replace_parameters(system, parameters), state)
            return found, Shift(jnp.zeros_like(found.xi), jnp.zeros_like(found.nu))

        found, still = evaluate(begun, state.replace(memory=None), system.parameters)
        if not traced(found):
            phase_space.require_momenta(found)
        return state.replace(xi=found.xi, nu=found.nu, memory=still)

    def require_members(
        self, system: System, parameters: PyTree, axes: PyTree, states: State, starts: State
    ) -> State | None:
        phase_space.require_members(system, parameters, axes, starts)
        return None

    def guess(self, system: System, state: State, h: Scalar) -> Array:
        return jnp.concatenate([state.xi, state.memory.xi, state.nu, state.memory.nu])

    def record(self, system: System, state: State, h: Scalar, z: Array) -> State:
        dim = system.group.dim
        xi, shift_xi, nu, shift_nu = jnp.split(z, [dim, 2 * dim, 2 * dim + len(state.nu)])
        return state.replace(xi=xi, nu=nu, memory=Shift(shift_xi, shift_nu))

    @staticmethod
    def _lift(system: System, at: State, shift: Shift, h: Scalar, pi: Array | None = None) -> Lift:
        """pi: π + κ there, by default that of the state."""
        group, Q, V = system.places

        def paired(xi: Array, n: Array, nu: Array, a: Array):
            held = at.t, at.inputs, at.over_step
            rest = system.reduced_lagrangian(jnp.zeros_like(xi), n, jnp.zeros_like(nu), a, *held)
            return system.reduced_lagrangian(xi, n, nu, a, *held) - rest

        mu, along_n, theta, along_a = jax.grad(paired, argnums=(0, 1, 2, 3))(shift.xi, at.n, shift.nu, at.a)
        source = V.diamond(group, along_a, at.a)
        carried = at.pi + h * along_n if pi is None else pi
        turning = source + Q.diamond(group, along_n, at.n) + Q.lifted_diamond(group, carried, at.n, shift.nu)
        return Lift(mu, theta, turning, along_n, source)

    def _shifted(self, system: System, record: State, h: Scalar) -> State:
        """The record of the step Φ."""
        group, Q, V = system.places
        shift, F = record.memory, self._shift(system, record, h)
        at, back = self._lift(system, record, shift, h), group.inverse(F)
        n = Q.act(group, back, record.n + h * shift.nu)
        return record.replace(
            g=group.compose(record.g, F), n=n, a=V.act(group, back, record.a),
            mu=group.Ad_dual(F, record.mu + h * at.turning), pi=Q.pull(group, F, n, record.pi + h * at.force),
        )  # fmt: skip

    def _shift(self, system: System, record: State, h: Scalar) -> Element:
        """F = τ(hλ_ξ)."""
        return self.difference_map.tau(system.group, h * record.memory.xi)

    def _end(self, system: System, record: State, h: Scalar) -> tuple[State, Lift]:
        """The state at t + h, with the momenta that Φ and both shifts carry there, and the lift at its place."""
        group, Q, V = system.places
        shift, F = record.memory, self._shift(system, record, h)
        after, back = self.base.advance(system, self._shifted(system, record, h), h), group.inverse(F)
        turned = Q.act(group, F, after.n)
        carried = Q.pull(group, back, turned, after.pi)
        n, a = turned - h * shift.nu, V.act(group, F, after.a)
        place = after.replace(g=group.compose(after.g, back), n=n, a=a)
        at = self._lift(system, place, shift, h, carried)
        mu = group.Ad_dual(back, after.mu) - h * at.turning
        return place.replace(mu=mu, pi=carried - h * at.force), at

    def relative(self, system: System, record: State, h: Scalar) -> Element:
        group, F = system.group, self._shift(system, record, h)
        return group.compose(F, group.compose(self.base.relative(system, record, h), group.inverse(F)))

    def nodes(self, system: System, record: State, h: Scalar) -> list[tuple[float, Node]]:
        return self.base.nodes(system, self._shifted(system, record, h), h)

    def quadrature(self, system: System, record: State, h: Scalar) -> list[tuple[float, Point]]:
        return self.base.quadrature(system, self._shifted(system, record, h), h)

    def equations(self, system: System, record: State, h: Scalar) -> Array:
        end, at = self._end(system, record, h)
        moving = self.base.equations(system, self._shifted(system, record, h), h)
        dim = system.group.dim
        return jnp.concatenate([moving[:dim], end.mu - at.mu, moving[dim:], end.pi - at.pi])

    def residual(self, system: System, state: State, h: Scalar, z: Array) -> Array:
        """The equations, solved for velocities by ω at the node, so that their Jacobian is the identity up to O(h)."""
        dim, size = system.group.dim, len(state.xi) + len(state.nu)
        rows = self.equations(system, self.record(system, state, h, z), h)
        parts = jnp.split(rows, [dim, 2 * dim, dim + size])
        moving, ending = jnp.concatenate(parts[::2]), jnp.concatenate(parts[1::2])
        both = jnp.stack([ending, moving + 0.5 * ending], axis=1) / h
        speeds, shifts = jnp.linalg.solve(phase_space.two_form(system, state), both).T
        return jnp.concatenate([speeds[:dim], shifts[:dim], speeds[dim:], shifts[dim:]])

    def advance(self, system: System, record: State, h: Scalar) -> State:
        return self._end(system, record, h)[0]

    def sources(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        """hΔ_λ + Ad*_{F⁻¹}Δ of Φ in frame k, and −hΔ_λ in frame k + 1, with Δ_λ = ∂_a⟨ϑ, λ⟩⋄a."""
        back = system.group.inverse(self._shift(system, record, h))
        inner, _ = self.base.sources(system, self._shifted(system, record, h), h)
        ahead = h * self._lift(system, record, record.memory, h).source + system.group.Ad_dual(back, inner)
        return ahead, -h * self._end(system, record, h)[1].source

    def newton_residual(self, system: System, record: State, h: Scalar, after: State) -> Array:
        """|equations|∞ relative to the largest of the momenta of both nodes and of their changes by torque and force.

        Rows of μ are relative to μ and those of π to π.
        """
        rows, dim = jnp.abs(self.equations(system, record, h)), 2 * system.group.dim
        ((_, at),) = self.nodes(system, record, h)
        mu = largest(record.mu, after.mu, at.mu, h * at.torque)
        pi = largest(record.pi, after.pi, at.pi, h * at.force)
        of_mu, of_pi = largest(rows[:dim]), largest(rows[dim:])
        return jnp.maximum(above(of_mu, mu, mu + pi * largest(h * record.nu)), above(of_pi, pi, pi))
