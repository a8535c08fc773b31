"""The midpoint rule of a Hamiltonian in velocities and momenta, for ℋ whose second derivative may be singular."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp

from coadjoint.arrays import Array, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.groups.group import Element
from coadjoint.mechanics.discrete import Node, Point, power
from coadjoint.mechanics.reduced_functions import added
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.midpoint import Midpoint
from coadjoint.spaces.space import require_flat


class MiddleMomenta(NamedTuple):
    """The memory of the method: m and p at the middle of the step.

    mu: (dim G,). pi: (ambient,).
    """

    mu: Array
    pi: Array


@dataclass(frozen=True)
class HamiltonianMidpoint(Midpoint):
    """`Midpoint` with four unknowns, ξ, ν, m, p: the equations of `Midpoint` with m for ∂_ξℓ and p for ∂_νℓ, and

    ξ = ∂_μℋ(m, n̄, p, ā), ν = ∂_πℋ(m, n̄, p, ā) at the middle. The discrete Hamilton–Pontryagin principle, stationary
    Σ h(⟨m, ξ⟩ + ⟨p, ν⟩ − ℋ), gives these equations without a Legendre transform, so that ∂²ℋ/∂(μ, π)² may be singular
    and ξ may belong to many momenta: point vortices, Lie–Poisson systems. Where it is regular the steps are those of
    `Midpoint`. Order 2, symmetric. Such a system starts from momenta, system.state(mu=…).

    Raises ArgumentError for a system without a Hamiltonian, and on a curved space of additional dynamics.
    Source: Bou-Rabee and Marsden, Hamilton–Pontryagin integrators on Lie groups I, Found. Comput. Math. 9 (2009).
    """

    @property
    def regular(self) -> bool:
        return False

    def blocks(self, system: System) -> tuple[int, ...]:
        sizes = system.group.dim, system.additional.dim(system.group)
        return (*sizes, *sizes)

    def require_fit(self, system: System) -> None:
        super().require_fit(system)
        if system.hamiltonian is None:
            raise ArgumentError("co.HamiltonianMidpoint needs a system with a `hamiltonian`: use co.Midpoint().")
        require_flat(system.additional, "co.HamiltonianMidpoint", "use co.Midpoint()")
        self._start_from_momenta()

    def remember(self, system: System, state: State) -> State:
        return state.replace(memory=MiddleMomenta(state.mu, state.pi))

    def guess(self, system: System, state: State, h: Scalar) -> Array:
        return jnp.concatenate([state.xi, state.nu, state.memory.mu, state.memory.pi])

    def record(self, system: System, state: State, h: Scalar, z: Array) -> State:
        dim, ambient = system.group.dim, len(state.nu)
        xi, nu, mu, pi = jnp.split(z, [dim, dim + ambient, 2 * dim + ambient])
        return state.replace(xi=xi, nu=nu, memory=MiddleMomenta(mu, pi))

    def _at(self, system: System, record: State, h: Scalar) -> tuple[Element, Array, Point, Node, Array]:
        """The half step, H⁻¹n, the middle, ℋ and its slopes there, and (∂_μℋ, ∂_πℋ)."""
        group, Q, V = system.places
        half = self.turn(system, h, record.xi)
        back = group.inverse(half)
        start = Q.act(group, back, record.n)
        n, a, t = start + 0.5 * h * record.nu, V.act(group, back, record.a), record.t + 0.5 * h
        point, (mu, pi) = Point(record.xi, n, record.nu, a, t), record.memory

        def hamiltonian(mu: Array, n: Array, pi: Array, a: Array, t: Scalar):
            return system.reduced_hamiltonian(mu, n, pi, a, t, record.inputs, record.over_step)

        along = (0, 1, 2, 3, 4) if system.depends_on_time else (0, 1, 2, 3)
        value, slopes = jax.value_and_grad(hamiltonian, argnums=along)(mu, n, pi, a, jnp.asarray(t))
        xi, along_n, nu, along_a, *along_t = slopes
        motion = system.motion(record.xi, n, record.nu, a, t, record.inputs, record.over_step, (mu, pi))
        forces = system.body_forces(motion)
        torque, force = added(system, forces)
        advected = -V.diamond(group, along_a, a)
        turning = advected - Q.diamond(group, along_n, n) + Q.lifted_diamond(group, pi, n, record.nu) + torque
        node = Node(
            mu=mu,
            pi=pi,
            torque=turning,
            force=force - along_n,
            source=advected + torque - Q.diamond(group, force, n),
            energy=value,
            lagrangian=mu @ record.xi + pi @ record.nu - value,
            power=power(forces, record.xi, record.nu, [-slope for slope in along_t]),
        )
        return half, start, point, node, jnp.concatenate([xi, nu])

    def _node(self, system: System, record: State, h: Scalar) -> tuple[Element, Array, Point, Node]:
        return self._at(system, record, h)[:4]

    def equations(self, system: System, record: State, h: Scalar) -> Array:
        velocities = jnp.concatenate([record.xi, record.nu])
        return jnp.concatenate([super().equations(system, record, h), velocities - self._at(system, record, h)[-1]])

    def newton_residual(self, system: System, record: State, h: Scalar, after: State) -> Array:
        """|equations|∞, those of momenta relative to (μ, π), the others relative to (ξ, ν)."""
        rows = jnp.abs(self.equations(system, record, h))
        size = len(record.xi) + len(record.nu)
        momenta = [record.mu, record.pi, after.mu, after.pi]
        scales = [jnp.max(jnp.abs(jnp.concatenate(part)), initial=0.0) for part in (momenta, [record.xi, record.nu])]
        parts = [jnp.max(rows[:size], initial=0.0), jnp.max(rows[size:], initial=0.0)]
        return jnp.maximum(*(x / jnp.where(scale > 0, scale, 1.0) for x, scale in zip(parts, scales, strict=True)))
