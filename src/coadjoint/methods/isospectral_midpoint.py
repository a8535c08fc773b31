"""The isospectral midpoint rule: Hamiltonian steps whose unknown is the momentum."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.difference_maps import Cayley
from coadjoint.errors import ArgumentError, shown
from coadjoint.groups.group import Array
from coadjoint.kernels.newton.fixed_point import FixedPoint
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.momentum_sizes import largest, relative
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.increments import Whole
from coadjoint.methods.isospectral_algebra import algebra_of
from coadjoint.methods.isospectral_fields import fields, lifted, momenta_of, moved, parts
from coadjoint.methods.method import Method
from coadjoint.methods.step import Step

LONG_AGO = 1e30
"""How long ago, in s, a step is taken to be that has not happened: in extrapolations it has no weight."""


class LastMomenta(NamedTuple):
    """The memory of the method: the unknowns of the last three steps, the last one first, and the times they are of.

    momenta: (3, unknowns). times: (3,), s. along_a: ∂ℋ/∂a in the step that starts at a record, (ambient V*,).
    """

    momenta: Array
    times: Array
    along_a: Array


@dataclass(frozen=True)
class IsospectralMidpoint(Method, Whole):
    """Lie–Poisson systems on U(n), SU(n), SO(n), copies of one, and 𝔤 ⋉ 𝔤* over these, of order 2, symmetric.

    Of ℋ(μ): μ̇ = ad*_ξ μ, ξ = ∂ℋ/∂μ; as matrices, W of μ and P of −ξ, Ẇ = [P, W]. With ε = h/2 the unknown is the
    momentum W̃ with

        W̃ = W_k + ε[P̃, W̃] + ε² P̃W̃P̃,   P̃ = −∂ℋ/∂W̃,   W_{k+1} = C W_k C†,   C = (1 − εP̃)⁻¹(1 + εP̃):

    W_k = (1 − εP̃)W̃(1 + εP̃), W_{k+1} = (1 + εP̃)W̃(1 − εP̃), with the second by a unitary matrix, so that the spectrum
    of W, all its Casimirs, stays to round-off whatever the tolerance. W̃ is found by fixed-point iteration from what the
    last three steps say, so that a step costs some products of matrices and gradients of ℋ, and no Jacobian. A step
    must be short enough for it, ε‖P̃‖ < 0.4 or so.

    Of ℋ(μ, a), where advected=co.Coadjoint(): Ẇ = [P, W] + [B, Θ], Θ̇ = [P, Θ], Θ of a and B of −∂ℋ/∂a, by the same
    formulas over dual numbers, Θ + dW and P + dB with d² = 0:

        Θ̃ = Θ_k + ε[P̃, Θ̃] + ε² P̃Θ̃P̃,   Θ_{k+1} = C Θ_k C†,
        W̃ = W_k + ε([P̃, W̃] + [B̃, Θ̃]) + ε²(P̃W̃P̃ + B̃Θ̃P̃ + P̃Θ̃B̃),
        W_{k+1} = C W_k C† + [K, Θ_{k+1}],   K = 2ε(1 − εP̃)⁻¹B̃(1 + εP̃)⁻¹.

    The spectrum of Θ and all tr W f(Θ), its Casimirs, stay to round-off; the spectrum of W is none then.
    A dictionary of such spaces adds up [B_i, Θ_i]; co.Adjoint() is the same. `co.trace_casimirs` watches Casimirs.
    With invariance="right" all brackets have the other sign and g_{k+1} = Cg_k. On co.Power and on products of equal
    factors each copy has its own W, as vortices on a sphere have (`co.models.point_vortices.sphere`).

    difference_map: co.Cayley() alone. tolerance: that of the iteration, relative to W̃, by default 1e-14. carry_g:
    whether g, with g_{k+1} = g_k C†, is computed as well, by default False: then states have no g, and what needs it
    is refused. Starts from momenta, system.state(mu=…).
    Raises ArgumentError for other groups, and for systems without ℋ, with forces, with additional dynamics or with
    other advected parameters.
    Source: Modin and Viviani, Lie–Poisson methods for isospectral flows, Found. Comput. Math. 20 (2020), eq. 11; with
    Θ Modin and Roop, Spatio-temporal Lie–Poisson discretization for incompressible magnetohydrodynamics on the sphere,
    arXiv:2311.16045, its magnetic midpoint.
    """

    tolerance: float = 1e-14
    carry_g: bool = False

    def __post_init__(self):
        super().__post_init__()
        if not isinstance(self.tolerance, float) or not 0 < self.tolerance < 1e-3:
            raise ArgumentError(
                f"Argument `tolerance` must be a number over 0 and below 0.001, but is {shown(self.tolerance)}."
            )
        if not isinstance(self.carry_g, bool):
            raise ArgumentError(f"Argument `carry_g` must be True or False, but is {shown(self.carry_g)}.")
        if self.start != "momentum":
            raise ArgumentError('co.IsospectralMidpoint starts from momenta: leave out start="velocity".')

    @property
    def order(self) -> int:
        return 2

    @property
    def symmetric(self) -> bool:
        return True

    @property
    def regular(self) -> bool:
        return False

    @property
    def title(self) -> str:
        return f"IsospectralMidpoint({', carrying g' if self.carry_g else ''})".replace("(, ", "(")

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        return ((self, 1.0),)

    @property
    def remedies(self) -> tuple[str, str]:
        return "take a smaller dt: the iteration needs h‖ξ‖ below about 0.8", "take a smaller dt"

    def structure(self, system: System) -> FixedPoint:
        return FixedPoint(self.tolerance)

    def blocks(self, system: System) -> tuple[int, ...]:
        return (algebra_of(system.group).unknowns,) * (1 + fields(system))

    def require_fit(self, system: System) -> None:
        algebra_of(system.group)
        if self.difference_map != Cayley():
            raise ArgumentError(
                "co.IsospectralMidpoint is made of the Cayley transform, but got "
                f"{self.difference_map!r}: leave it out."
            )
        if self.carry_g:
            self.difference_map.require_fit(system.group)
        if system.hamiltonian is None:
            raise ArgumentError(
                "co.IsospectralMidpoint needs a system with a `hamiltonian` of the momentum: use co.Midpoint()."
            )
        if system.additional.ambient(system.group):
            raise ArgumentError("co.IsospectralMidpoint takes no additional dynamics: use co.HamiltonianMidpoint().")
        fields(system)
        if system.forces is not None:
            raise ArgumentError("co.IsospectralMidpoint takes no forces: use co.HamiltonianMidpoint().")

    def remember(self, system: System, state: State) -> State:
        if self.carry_g and state.g is None:
            raise ArgumentError(
                "The start has no g, because a run with co.IsospectralMidpoint() made it: start from system.state(…), "
                "or leave out carry_g=True."
            )

        def memory(mu, a, t):
            momenta = jnp.tile(lifted(system, mu, a), (3, 1))
            return LastMomenta(momenta, t - LONG_AGO * jnp.arange(1.0, 4.0), jnp.zeros_like(a))

        return state.replace(g=state.g if self.carry_g else None, memory=evaluate(memory, state.mu, state.a, state.t))

    def guess(self, system: System, state: State, h: Array) -> Array:
        """The parabola through the last three momenta, at the middle of the step."""
        return _weights(state.memory.times, state.t + 0.5 * h) @ state.memory.momenta

    def _slopes(self, system: System, state: State, h: Array, z: Array) -> tuple[Array, Array]:
        """ξ = ∂ℋ/∂μ, (dim G,), and ∂ℋ/∂a, (ambient V*,), at the unknowns."""

        def hamiltonian(mu, a):
            return self._hamiltonian(system, state, state.t + 0.5 * h, mu, a)

        mu, a = momenta_of(system, z)
        return jax.grad(hamiltonian, argnums=(0, 1))(mu, a) if len(a) else (jax.grad(hamiltonian)(mu, a), a)

    def _hamiltonian(self, system: System, state: State, t: Array, mu: Array, a: Array) -> Array:
        return system.reduced_hamiltonian(mu, state.n, state.pi, a, t, state.inputs, state.over_step)

    def residual(self, system: System, state: State, h: Array, z: Array) -> Array:
        """z − G(z), (unknowns,), G the right sides of the equations for W̃ and Θ̃."""
        return z - lifted(system, state.mu, state.a) - moved(system, *self._slopes(system, state, h, z), z, 0.5 * h)

    def record(self, system: System, state: State, h: Array, z: Array) -> State:
        last = state.memory
        momenta = jax.lax.stop_gradient(jnp.concatenate([z[None], last.momenta[:2]]))
        times = jax.lax.stop_gradient(jnp.concatenate([(state.t + 0.5 * h)[None], last.times[:2]]))
        xi, along_a = self._slopes(system, state, h, z)
        return state.replace(xi=xi, memory=LastMomenta(momenta, times, along_a))

    def equations(self, system: System, record: State, h: Array) -> Array:
        return self.residual(system, record, h, record.memory.momenta[0])

    def advance(self, system: System, record: State, h: Array) -> State:
        algebra = algebra_of(system.group)
        turn = algebra.turn(-record.xi, 0.5 * h)
        mu, a = algebra.turned(turn, record.mu), []
        for theta, along in zip(parts(system, record.a), parts(system, record.memory.along_a), strict=True):
            a.append(algebra.turned(turn, theta))
            mu = mu + algebra.kicked(turn, -along, a[-1], 0.5 * h)
        g = None if record.g is None else system.group.compose(record.g, algebra.element(turn))
        return record.later(h, g=g, mu=mu, a=jnp.concatenate(a) if a else record.a)

    def sources(self, system: System, record: State, h: Array) -> tuple[Array, Array]:
        return jnp.zeros(system.group.dim), jnp.zeros(system.group.dim)

    def impulse(self, system: System, record: State, h: Array, after: State) -> Array:
        """0: nothing forces."""
        return jnp.zeros(system.group.dim)

    def energy(self, system: System, record: State, h: Array) -> Array:
        """ℋ at the unknown, one number: this method has no Λ."""
        middle = momenta_of(system, record.memory.momenta[0])
        return self._hamiltonian(system, record, record.t + 0.5 * h, *middle)

    def work(self, system: System, record: State, h: Array) -> Array:
        """h ∂_tℋ in the middle where ℋ depends on time, (lines,)."""
        if not system.depends_on_time:
            return jnp.zeros(0)
        middle = momenta_of(system, record.memory.momenta[0])
        return h * jax.grad(lambda t: self._hamiltonian(system, record, t, *middle))(record.t + 0.5 * h)[None]

    def balance(self, system: System, record: State, h: Array, after: State) -> Array:
        """|X_{k+1} − X̃ + G(−ε)|∞ relative to X = (W, Θ), one number: both ends of the step fit the same X̃.

        Of W: W_{k+1} = (1 + εP̃)W̃(1 − εP̃) = W̃ + ε[P̃, W̃] − ε² P̃W̃P̃ = W̃ − G(−ε), where G(ε) = ε[P̃, W̃] + ε² P̃W̃P̃.
        """
        z, slopes = record.memory.momenta[0], (record.xi, record.memory.along_a)
        off = lifted(system, after.mu, after.a) - z + moved(system, *slopes, z, -0.5 * h)
        return relative(jnp.max(jnp.abs(off)), largest(after.mu, after.a))

    def newton_residual(self, system: System, record: State, h: Array, after: State) -> Array:
        """|equations|∞ relative to W and Θ, one number."""
        return relative(jnp.max(jnp.abs(self.equations(system, record, h))), largest(record.mu, record.a))


def _weights(times: Array, t: Array) -> Array:
    """Lagrange's weights (k,) of values at `times` (k,) for the value at t."""
    count = len(times)
    apart = times[:, None] - times[None] + jnp.eye(count)
    towards = t - jnp.broadcast_to(times, (count, count))
    return jnp.prod(jnp.where(np.eye(count, dtype=bool), 1.0, towards / apart), axis=1)
