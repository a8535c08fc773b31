"""The adjoint of the method of a discrete Lagrangian."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp

from coadjoint.arrays import Array, Scalar
from coadjoint.mechanics.discrete import power
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.variational import LagrangianSlopes, Variational


@dataclass(frozen=True)
class AdjointVariational(Variational, adjoint_of=Variational):
    """Φ*_h = Φ₋ₕ⁻¹ of `Variational`: Λ*(ξ, n, s, a; h) = −Λ(ξ, F⁻¹s, F⁻¹n, F⁻¹a; −h).

    Λ is that of `System(discrete_lagrangian=…)`. Its forces act where those of Φ₋ₕ do, at the right node: T⁺ = hT,
    φ⁺ = hf at (ξ, F⁻¹s, F⁻¹ν, F⁻¹a, t + h).
    """

    def _value(self, system: System, record: State, h: Scalar, t: Scalar) -> Array:
        s = record.n + h * record.nu
        return self._discrete(system, record, h, record.xi, record.n, s, record.a, t)

    def _discrete(self, system: System, record: State, h: Scalar, xi: Array, n: Array, s: Array, a: Array, t: Scalar):
        group, Q, V = system.places
        back = group.inverse(self.difference_map.tau(group, h * xi))
        carried = Q.act(group, back, s), Q.act(group, back, n), V.act(group, back, a)
        return -system.reduced_discrete_lagrangian(xi, *carried, -h, t + h, record.inputs, record.over_step)

    def _slopes(self, system: System, record: State, h: Scalar) -> LagrangianSlopes:
        s = record.n + h * record.nu

        def discrete(xi: Array, n: Array, s: Array, a: Array):
            return self._discrete(system, record, h, xi, n, s, a, record.t)

        slopes = jax.grad(discrete, argnums=(0, 1, 2, 3))(record.xi, record.n, s, record.a)
        along_xi, along_n, along_s, along_a = slopes
        momentum = self.difference_map.dtau_inverse_dual(system.group, h * record.xi, along_xi / h)
        nothing = jnp.zeros(system.group.dim), jnp.zeros_like(record.n)
        return LagrangianSlopes(momentum, s, along_n, along_s, along_a, *nothing)

    def _end(self, system: System, record: State, h: Scalar) -> State:
        """(ξ, F⁻¹s, F⁻¹ν, F⁻¹a, t + h), where the forces act."""
        group, Q, V = system.places
        back = group.inverse(self.relative(system, record, h))
        n, a = Q.act(group, back, record.n + h * record.nu), V.act(group, back, record.a)
        return record.replace(n=n, a=a, nu=Q.push(group, back, record.n, record.nu), t=record.t + h)

    def advance(self, system: System, record: State, h: Scalar) -> State:
        torque, force = self._impulse(system, self._end(system, record, h), h)
        after = super().advance(system, record, h)
        pi = system.additional.momentum(system.group, after.n, after.pi + force, after.pi + force)
        return after.replace(mu=after.mu + torque, pi=pi)

    def sources(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        group, Q, _ = system.places
        end = self._end(system, record, h)
        torque, force = self._impulse(system, end, h)
        return super().sources(system, record, h)[0], torque - Q.diamond(group, force, end.n)

    def work(self, system: System, record: State, h: Scalar) -> Array:
        """h(⟨T, ξ⟩ + ⟨f, ν⟩) of each force at the right node, then −∂_tΛ*."""
        end = self._end(system, record, h)
        motion = system.motion(end.xi, end.n, end.nu, end.a, end.t, end.inputs, end.over_step)
        value = partial(self._value, system, record, h)
        along_t = [jax.grad(value)(jnp.asarray(record.t)) / h] if system.depends_on_time else []
        return h * power(system.body_forces(motion), end.xi, end.nu, along_t)

    def energy(self, system: System, record: State, h: Scalar) -> Array:
        """E_k = −∂_hΛ* at fixed F and s: −∂_hΛ* + ⟨∂_ξΛ*, ξ⟩/h in algebra form."""
        s = record.n + h * record.nu

        def discrete(xi: Array, h: Scalar):
            return self._discrete(system, record, h, xi, record.n, s, record.a, record.t)

        along_xi, along_h = jax.grad(discrete, argnums=(0, 1))(record.xi, h)
        return along_xi @ record.xi / h - along_h
