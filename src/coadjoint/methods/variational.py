"""The method of a discrete Lagrangian given by the user, in algebra form (Theorem 6)."""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp

from coadjoint.groups.group import Array, Element
from coadjoint.mechanics.discrete import power
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.method import Method, Step


@dataclass(frozen=True)
class Variational(Method, Step):
    """Λ(ξ, n, s, a; h) of `System(discrete_lagrangian=…)`, differentiated; order and symmetry are those of Λ.

    left: μ_k = (dτ⁻¹_{hξ})*∂_ξΛ/h − ∂_aΛ⋄a − ∂_nΛ⋄n − ∂_sΛ⋄s − T⁻, π_k = −∂_nΛ − φ⁻; right: μ_{k+1} =
    (dτ⁻¹_{−hξ})*∂_ξΛ/h, π_{k+1} = F*∂_sΛ; n_{k+1} = F⁻¹s, a_{k+1} = F⁻¹a (P42–P44). The unknown is ν = (s − n)/h,
    never s. Forces enter at the left node: T⁻ = hT, φ⁻ = hf. μ_{k+1} and π_{k+1} are taken by transport.
    """

    @property
    def order(self) -> int:
        return 1

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        return ((self, 1.0),)

    def increment(self, system: System, h: Array, xi: Array) -> Element:
        return self.difference_map.tau(system.group, h * xi)

    def _slopes(self, system: System, record: State, h: Array):
        """ξ, s, and the gradients of Λ in ξ, n, s, a with the forces (T⁻, φ⁻)."""
        xi = record.xi
        nu = record.nu
        s = record.n + h * nu

        def discrete(xi, n, s, a):
            return system.reduced_discrete_lagrangian(xi, n, s, a, h, record.t, record.inputs)

        gradients = jax.grad(discrete, argnums=(0, 1, 2, 3))(xi, record.n, s, record.a)
        motion = system.motion(xi, record.n, nu, record.a, record.t, record.inputs, record.internal)
        torque, force = system.body_force(motion)
        return xi, s, gradients, (h * torque, h * force)

    def _torque(self, system: System, state: State, s: Array, gradients, torque: Array) -> Array:
        group, Q, V = system.places
        _, along_n, along_s, along_a = gradients
        from_q = Q.diamond(group, along_n, state.n) + Q.diamond(group, along_s, s)
        return V.diamond(group, along_a, state.a) + from_q + torque

    def equations(self, system: System, record: State, h: Array) -> Array:
        group = system.group
        xi, s, gradients, (torque, force) = self._slopes(system, record, h)
        momentum = self.difference_map.dtau_inverse_dual(group, h * xi, gradients[0] / h)
        rest = self.coordinates(system, record, None, record.pi + force + gradients[1])
        return jnp.concatenate([momentum - self._torque(system, record, s, gradients, torque) - record.mu, rest])

    def advance(self, system: System, record: State, h: Array) -> State:
        group, Q, V = system.places
        xi, s, gradients, (torque, force) = self._slopes(system, record, h)
        F = self.increment(system, h, xi)
        back = group.inverse(F)
        n = Q.act(group, back, s)
        legendre = Q.pull(group, F, n, gradients[2])
        transported = Q.pull(group, F, n, record.pi + force + gradients[1] + gradients[2])
        return record.later(
            h,
            g=group.compose(record.g, F),
            n=n,
            a=V.act(group, back, record.a),
            mu=group.Ad_dual(F, record.mu + self._torque(system, record, s, gradients, torque)),
            pi=Q.momentum(group, n, transported, legendre),
        )

    def sources(self, system: System, record: State, h: Array) -> tuple[Array, Array]:
        group, Q, V = system.places
        _, _, gradients, (torque, force) = self._slopes(system, record, h)
        source = V.diamond(group, gradients[3], record.a) + torque - Q.diamond(group, force, record.n)
        return source, jnp.zeros_like(source)

    def work(self, system: System, record: State, h: Array) -> Array:
        """h(⟨T, ξ⟩ + ⟨f, ν⟩) of each force at the left node, then −∂_tΛ."""
        xi, nu = record.xi, record.nu
        s = record.n + h * nu
        motion = system.motion(xi, record.n, nu, record.a, record.t, record.inputs, record.internal)

        def discrete(t):
            return system.reduced_discrete_lagrangian(xi, record.n, s, record.a, h, t, record.inputs) / h

        along_t = [jax.grad(discrete)(jnp.asarray(record.t))] if system.depends_on_time else []
        return h * power(system.body_forces(motion), xi, nu, along_t)

    def energy(self, system: System, record: State, h: Array) -> Array:
        """E_k = −∂_hΛ at fixed F and s: −∂_hΛ + ⟨∂_ξΛ, ξ⟩/h in algebra form."""
        xi, s, gradients, _ = self._slopes(system, record, h)

        def discrete(h):
            return system.reduced_discrete_lagrangian(xi, record.n, s, record.a, h, record.t, record.inputs)

        return gradients[0] @ xi / h - jax.grad(discrete)(h)
