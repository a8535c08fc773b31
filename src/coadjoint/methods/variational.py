"""The method of a discrete Lagrangian given by the user, in algebra form (Theorem 6)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.checks import truth
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate, traced
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.discrete import power
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.increments import FullStep
from coadjoint.methods.method import Method
from coadjoint.methods.step import Step

SYMMETRIC = 1e-10
"""The difference of Λ and its adjoint, relative to them, that counts as round-off."""


class LagrangianSlopes(NamedTuple):
    """The values that a step takes from Λ and the forces.

    `momentum` is D^R_FΛ = (dτ⁻¹_{hξ})*∂_ξΛ/h; then s, ∂_nΛ, ∂_sΛ, ∂_aΛ; T⁻ and φ⁻.

    momentum, torque: (dim G,). s, along_n, along_s, force: (ambient,). along_a: (dim V*,).
    """

    momentum: Array
    s: Array
    along_n: Array
    along_s: Array
    along_a: Array
    torque: Array
    force: Array


@dataclass(frozen=True)
class Variational(Method, FullStep):
    """Λ(ξ, n, s, a; h) of `System(discrete_lagrangian=…)`, differentiated; order and symmetry are those of Λ.

    left: μ_k = (dτ⁻¹_{hξ})*∂_ξΛ/h − ∂_aΛ⋄a − ∂_nΛ⋄n − ∂_sΛ⋄s − T⁻, π_k = −∂_nΛ − φ⁻; right: μ_{k+1} =
    (dτ⁻¹_{−hξ})*∂_ξΛ/h, π_{k+1} = F*∂_sΛ; n_{k+1} = F⁻¹s, a_{k+1} = F⁻¹a (P42–P44). The unknown is ν = (s − n)/h,
    never s. Forces enter at the left node: T⁻ = hT, φ⁻ = hf. μ_{k+1} and π_{k+1} are taken by transport.

    symmetric: whether Λ(ξ, n, s, a; h) = −Λ(ξ, F⁻¹s, F⁻¹n, F⁻¹a; −h), so that Φ₋ₕ undoes Φ_h, by default False. Then
    the order is 2 and compositions such as co.Suzuki4 take it; a run checks it for every member and raises
    ArgumentError if it does not hold, as with forces, which act at the left node. Inside jit, grad or vmap, and when a
    stepper changes parameters, it is not checked.
    """

    takes_smooth_actions = True

    symmetric: bool = False  # pyright: ignore[reportIncompatibleMethodOverride, reportAssignmentType]

    def __post_init__(self):
        super().__post_init__()
        truth(self.symmetric, "symmetric")

    @property
    def order(self) -> int:
        return 2 if self.symmetric else 1

    def remember(self, system: System, state: State) -> State:
        if self.symmetric and not traced(state, system.parameters):
            if system.forces:
                raise ArgumentError(
                    "Forces stand at the left node of co.Variational, so that its steps are not symmetric: leave out "
                    "`symmetric`, or use co.Midpoint() with a Lagrangian."
                )
            _require_symmetric(evaluate(partial(self._sides, system), state)[None])
        return super().remember(system, state)

    def require_members(
        self, system: System, parameters: PyTree, axes: PyTree, states: State, starts: State
    ) -> State | None:
        def sides(parameters: PyTree, state: State) -> Array:
            return self._sides(replace_parameters(system, parameters), state)

        if self.symmetric:
            _require_symmetric(evaluate(jax.vmap(sides, in_axes=(axes, 0)), parameters, states))
        return super().require_members(system, parameters, axes, states, starts)

    def _sides(self, system: System, state: State) -> Array:
        """Λ and its adjoint at three random (ξ, ν), (3, 2)."""
        adjoint: Any = Variational(self.difference_map).adjoint
        random, h, rows = np.random.default_rng(1788), 0.1, []
        for _ in range(3):
            xi, nu = random.normal(size=np.shape(state.xi)), random.normal(size=np.shape(state.nu))
            record = state.replace(xi=xi, nu=nu if system.additional.flat else state.nu)
            rows.append(jnp.stack([rule._value(system, record, h, record.t) for rule in (self, adjoint)]))
        return jnp.stack(rows)

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        return ((self, 1.0),)

    def discrete_lagrangian(self, system: System, record: State, h: Scalar) -> Array:
        return self._value(system, record, h, record.t)

    def _slopes(self, system: System, record: State, h: Scalar) -> LagrangianSlopes:
        s = record.n + h * record.nu

        def discrete(xi: Array, n: Array, s: Array, a: Array):
            return system.reduced_discrete_lagrangian(xi, n, s, a, h, record.t, record.inputs, record.over_step)

        slopes = jax.grad(discrete, argnums=(0, 1, 2, 3))(record.xi, record.n, s, record.a)
        along_xi, along_n, along_s, along_a = slopes
        momentum = self.difference_map.dtau_inverse_dual(system.group, h * record.xi, along_xi / h)
        return LagrangianSlopes(momentum, s, along_n, along_s, along_a, *self._impulse(system, record, h))

    def _impulse(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        """(T⁻, φ⁻) = (hT, hf) at the left node."""
        motion = system.motion(record.xi, record.n, record.nu, record.a, record.t, record.inputs, record.over_step)
        torque, force = system.body_force(motion)
        return h * torque, h * force

    def _torque(self, system: System, state: State, at: LagrangianSlopes) -> Array:
        """∂_aΛ⋄a + ∂_nΛ⋄n + ∂_sΛ⋄s + T⁻."""
        group, Q, V = system.places
        from_q = Q.diamond(group, at.along_n, state.n) + Q.diamond(group, at.along_s, at.s)
        return V.diamond(group, at.along_a, state.a) + from_q + at.torque

    def equations(self, system: System, record: State, h: Scalar) -> Array:
        at = self._slopes(system, record, h)
        rest = self.coordinates(system, record, None, record.pi + at.force + at.along_n)
        return jnp.concatenate([at.momentum - self._torque(system, record, at) - record.mu, rest])

    def advance(self, system: System, record: State, h: Scalar) -> State:
        group, Q, V = system.places
        at = self._slopes(system, record, h)
        F = self.relative(system, record, h)
        back = group.inverse(F)
        n = Q.act(group, back, at.s)
        legendre = Q.pull(group, F, n, at.along_s)
        transported = Q.pull(group, F, n, record.pi + at.force + at.along_n + at.along_s)
        return record.later(
            h,
            g=group.compose(record.g, F),
            n=n,
            a=V.act(group, back, record.a),
            mu=group.Ad_dual(F, record.mu + self._torque(system, record, at)),
            pi=Q.momentum(group, n, transported, legendre),
        )

    def sources(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        group, Q, V = system.places
        at = self._slopes(system, record, h)
        source = V.diamond(group, at.along_a, record.a) + at.torque - Q.diamond(group, at.force, record.n)
        return source, jnp.zeros_like(source)

    def work(self, system: System, record: State, h: Scalar) -> Array:
        """h(⟨T, ξ⟩ + ⟨f, ν⟩) of each force at the left node, then −∂_tΛ."""
        xi, nu = record.xi, record.nu
        motion = system.motion(xi, record.n, nu, record.a, record.t, record.inputs, record.over_step)
        value = partial(self._value, system, record, h)
        along_t = [jax.grad(value)(jnp.asarray(record.t)) / h] if system.depends_on_time else []
        return h * power(system.body_forces(motion), xi, nu, along_t)

    def _value(self, system: System, record: State, h: Scalar, t: Scalar) -> Array:
        """Λ at the record, with another time."""
        s = record.n + h * record.nu
        return system.reduced_discrete_lagrangian(
            record.xi, record.n, s, record.a, h, t, record.inputs, record.over_step
        )

    def energy(self, system: System, record: State, h: Scalar) -> Array:
        """E_k = −∂_hΛ at fixed F and s: −∂_hΛ + ⟨∂_ξΛ, ξ⟩/h in algebra form."""
        s = record.n + h * record.nu

        def discrete(xi: Array, h: Scalar):
            return system.reduced_discrete_lagrangian(
                xi, record.n, s, record.a, h, record.t, record.inputs, record.over_step
            )

        along_xi, along_h = jax.grad(discrete, argnums=(0, 1))(record.xi, h)
        return along_xi @ record.xi / h - along_h


def _require_symmetric(sides: Array) -> None:
    """Raise ArgumentError unless Λ is its own adjoint; sides: of each member at three points, (members, 3, 2)."""
    size = np.sum(np.abs(sides), axis=-1)
    member, point = np.unravel_index(np.argmax(np.abs(sides[..., 0] - sides[..., 1]) - SYMMETRIC * size), size.shape)
    one, other = sides[member, point]
    if not np.isfinite(size[member, point]):
        raise ArgumentError(
            "The discrete Lagrangian of this system is not finite at a random point, so that its symmetry cannot be "
            "checked: leave out `symmetric`, or use co.methods.Symmetrised(co.Variational())."
        )
    if not np.abs(one - other) <= SYMMETRIC * size[member, point]:
        where = f" of member {member}" if len(sides) > 1 else ""
        raise ArgumentError(
            f"The discrete Lagrangian of this system is not symmetric: Λ(ξ, n, s, a; h){where} = {one:.6g}, but "
            f"−Λ(ξ, F⁻¹s, F⁻¹n, F⁻¹a; −h) = {other:.6g} at a random point; leave out `symmetric`, or use "
            "co.methods.Symmetrised(co.Variational())."
        )
