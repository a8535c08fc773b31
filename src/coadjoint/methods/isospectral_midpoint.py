"""The isospectral midpoint rule: Hamiltonian steps whose unknown is the momentum."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, Scalar
from coadjoint.checks import truth
from coadjoint.difference_maps import Cayley
from coadjoint.errors import ArgumentError, GroupError
from coadjoint.kernels.newton.fixed_point import FixedPoint
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.momentum_sizes import largest, relative
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.increments import FullStep
from coadjoint.methods.isospectral_algebra import algebra_of
from coadjoint.methods.isospectral_end import LARGE, SINGLE, RightSides, correction, valued
from coadjoint.methods.isospectral_fields import brackets, fields, lifted, momenta_of, moved, moves, rows_of
from coadjoint.methods.method import Method
from coadjoint.methods.step import Step

LONG_AGO = 1e30
"""The age, in s, assigned to a step that was not taken, so that it has no weight in extrapolations."""

STEPS = 7
"""The number of previous steps from which the first guess is extrapolated."""

WILD = 150.0
"""The largest sum of the sizes of the weights of an extrapolation; that of seven equal steps is 127."""


class LastSteps(NamedTuple):
    """The memory of the method: the unknowns z of the step that starts at a record, and the rates of past unknowns.

    middle: z, (unknowns,). along_a: ∂ℋ/∂a at them, (ambient V*,). rates: (z − z_k)/h of the last seven steps, the last
    one first, with z_k from μ_k and a_k, (7, unknowns), 1/s. times: the middles of these steps, (7,), s. shrinks: the
    contraction factor of the iteration of the last step, over |h|, one number, 1/s. found: within a step, the last
    result of its iteration.
    """

    middle: Array
    along_a: Array
    rates: Array
    times: Array
    shrinks: Array
    found: RightSides | None = None


@dataclass(frozen=True)
class IsospectralMidpoint(Method, FullStep):
    """Lie–Poisson systems on U(n), SU(n), SO(n), copies of one, and 𝔤 ⋉ 𝔤* over these, of order 2, symmetric.

    Of ℋ(μ): μ̇ = ad*_ξ μ, ξ = ∂ℋ/∂μ; as matrices, W of μ and P of −ξ, Ẇ = [P, W]. With ε = h/2 the unknown is the
    momentum W̃ with

        W̃ = W_k + ε[P̃, W̃] + ε² P̃W̃P̃,   P̃ = −∂ℋ/∂W̃,   W_{k+1} = C W_k C†,   C = (1 − εP̃)⁻¹(1 + εP̃):

    W_k = (1 − εP̃)W̃(1 + εP̃), W_{k+1} = (1 + εP̃)W̃(1 − εP̃). W̃ is found by fixed-point iteration from an extrapolation
    of the last seven steps, and then by the same iteration to round-off with P̃ fixed, so that
    W_{k+1} = W_k + 2ε[P̃, W̃] is that of a unitary C: the spectrum of W and all its Casimirs are kept to round-off for
    any tolerance. A step costs several matrix products and gradients of ℋ, but no Jacobian. The iteration requires
    short steps, ε‖P̃‖ < 0.4 approximately.

    Of ℋ(μ, a), where advected=co.Coadjoint(): Ẇ = [P, W] + [B, Θ], Θ̇ = [P, Θ], Θ of a and B of −∂ℋ/∂a, by the same
    formulas over dual numbers, Θ + dW and P + dB with d² = 0:

        Θ̃ = Θ_k + ε[P̃, Θ̃] + ε² P̃Θ̃P̃,   Θ_{k+1} = C Θ_k C†,
        W̃ = W_k + ε([P̃, W̃] + [B̃, Θ̃]) + ε²(P̃W̃P̃ + B̃Θ̃P̃ + P̃Θ̃B̃),
        W_{k+1} = W_k + 2ε([P̃, W̃] + [B̃, Θ̃]).

    The Casimirs, the spectrum of Θ and all tr W f(Θ), are kept to round-off; the spectrum of W is not a Casimir then.
    A dictionary of such spaces adds up [B_i, Θ_i]; co.spaces.Adjoint() is the same. `co.mechanics.trace_casimirs`
    watches Casimirs. With invariance="right" all brackets have the other sign and g_{k+1} = Cg_k. On co.Power and on
    products of equal factors each copy has its own W, as vortices on a sphere have (`co.models.point_vortices.sphere`).

    difference_map: co.Cayley() alone. tolerance: that of the iteration, relative to W̃, by default 1e-14. carry_g:
    whether g, with g_{k+1} = g_k C†, is also computed, by default False: then states have no g, and functions that need
    it raise ArgumentError. Starts from momenta, system.state(mu=…).
    Raises ArgumentError for other groups, and for systems without ℋ, with forces, with additional dynamics or with
    other advected parameters.
    Source: Modin and Viviani, Lie–Poisson methods for isospectral flows, Found. Comput. Math. 20 (2020), eq. 11; with
    Θ Modin and Roop, Spatio-temporal Lie–Poisson discretization for incompressible magnetohydrodynamics on the sphere,
    arXiv:2311.16045, its magnetic midpoint.
    """

    constrainable = False

    tolerance: float = 1e-14
    carry_g: bool = False

    def __post_init__(self):
        super().__post_init__()
        fits = isinstance(self.tolerance, float) and 0 < self.tolerance < 0.001
        checks.expect(fits, self.tolerance, "tolerance", "a number over 0 and below 0.001")
        truth(self.carry_g, "carry_g")
        self._start_from_momenta()

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
    def carries_g(self) -> bool:
        return self.carry_g

    @property
    def remedies(self) -> tuple[str, str]:
        return "take a smaller dt: the iteration needs h‖ξ‖ below about 0.8", "take a smaller dt"

    def structure(self, system: System) -> FixedPoint:
        return FixedPoint(self.tolerance, rows_of(system), finds=True)

    def blocks(self, system: System) -> tuple[int, ...]:
        return (algebra_of(system.group).unknowns,) * (1 + fields(system))

    def carried(self, state: State) -> Array:
        """The contraction factor of the iteration of the last step, over |h|, one number, 1/s."""
        return state.memory.shrinks

    def carry(self, after: State, carried: Array) -> State:
        return after.replace(memory=after.memory._replace(shrinks=carried))

    def solved(self, state: State, found: RightSides) -> State:
        return state.replace(memory=state.memory._replace(found=found))

    def require_fit(self, system: System) -> None:
        algebra_of(system.group)
        if self.difference_map != Cayley():
            raise ArgumentError(
                "co.IsospectralMidpoint is made of the Cayley transform, but got "
                f"{self.difference_map!r}: leave it out."
            )
        if self.carry_g:
            try:
                self.difference_map.require_fit(system.group)
            except GroupError:
                raise GroupError(
                    "With carry_g=True g moves by the Cayley transform, which does not map the algebra of "
                    f"{system.group!r} into the group: leave out carry_g=True, or take co.Un, with an energy that does "
                    "not depend on the trace."
                ) from None
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
        def memory(mu: Array, a: Array, t: Scalar):
            z = lifted(system, mu, a)
            times = t - LONG_AGO * jnp.arange(1.0, STEPS + 1)
            return LastSteps(z, jnp.zeros_like(a), jnp.zeros((STEPS, len(z))), times, jnp.asarray(LONG_AGO))

        return state.replace(g=state.g if self.carry_g else None, memory=evaluate(memory, state.mu, state.a, state.t))

    def guess(self, system: System, state: State, h: Scalar) -> Array:
        """z_k plus the increment from the polynomial through the rates of the last steps."""
        last = state.memory
        return lifted(system, state.mu, state.a) + h * (_weights(last.times, state.t + 0.5 * h) @ last.rates)

    def _slopes(self, system: System, state: State, h: Scalar, z: Array) -> tuple[Array, Array]:
        """ξ = ∂ℋ/∂μ, (dim G,), and ∂ℋ/∂a, (ambient V*,), at the unknowns."""

        def hamiltonian(mu: Array, a: Array):
            return self._hamiltonian(system, state, state.t + 0.5 * h, mu, a)

        mu, a = momenta_of(system, z)
        return jax.grad(hamiltonian, argnums=(0, 1))(mu, a) if len(a) else (jax.grad(hamiltonian)(mu, a), a)

    def _hamiltonian(self, system: System, state: State, t: Scalar, mu: Array, a: Array) -> Array:
        return system.reduced_hamiltonian(mu, state.n, state.pi, a, t, state.inputs, state.over_step)

    def residual(self, system: System, state: State, h: Scalar, z: Array) -> Array:
        """z − G(z), (unknowns,), G the right sides of the equations for W̃ and Θ̃."""
        return self.evaluated(system, state, h, z)[0]

    def evaluated(self, system: System, state: State, h: Scalar, z: Array) -> tuple[Array, RightSides]:
        """z − G(z), (unknowns,), and the right sides from which it is computed."""
        found = self._right_sides(system, state, h, z, self._slopes(system, state, h, z))
        return found.off, found

    def _right_sides(
        self, system: System, state: State, h: Scalar, z: Array, slopes: tuple[Array, Array]
    ) -> RightSides:
        whole, odd = moves(system, *slopes, z, 0.5 * h)
        return RightSides(z, *slopes, z - lifted(system, state.mu, state.a) - whole, odd)

    def record(self, system: System, state: State, h: Scalar, z: Array) -> State:
        xi, along_a = self._slopes(system, state, h, z)
        return state.replace(xi=xi, memory=state.memory._replace(middle=z, along_a=along_a))

    def equations(self, system: System, record: State, h: Scalar) -> Array:
        return self.residual(system, record, h, record.memory.middle)

    def advance(self, system: System, record: State, h: Scalar) -> State:
        """C W_k C† = W_k + 2ε[P̃, Ŵ], where Ŵ = W_k + ε[P̃, Ŵ] + ε² P̃ŴP̃ with P̃ fixed, independent of Ŵ.

        P̃ is evaluated at the last iterate W: [P̃, Ŵ] = [P̃, W] + [P̃, δ], where the first term is known from there and
        `correction` gives the second. Therefore the spectrum is kept however close W is to Ŵ. With a tolerance up to
        1e-10, δ is so small that single precision resolves it to round-off. Derivatives are those at W̃.
        """
        z, slopes, epsilon = record.memory.middle, (record.xi, record.memory.along_a), 0.5 * h
        found = record.memory.found
        found = self._right_sides(system, record, h, z, slopes) if found is None else found
        found = jax.lax.stop_gradient(found)
        large = len(z) >= LARGE * np.prod(rows_of(system))
        precision = jnp.float32 if self.tolerance <= SINGLE and large else jnp.float64
        still = jax.lax.stop_gradient((z, epsilon))  # the correction is 0 at the solution
        more, odd = correction(system, (found.xi, found.along_a), found.off, *still, precision)
        taken = valued(found.odd, brackets(system, *slopes, z, epsilon))
        mu, a = momenta_of(system, 2 * (taken + odd))
        g = None
        if record.g is not None:
            algebra = algebra_of(system.group)
            turn = algebra.turn(-valued(found.xi, record.xi), epsilon)
            g = system.group.compose(record.g, algebra.element(turn))
        rate = (found.at - found.off - jax.lax.stop_gradient(lifted(system, record.mu, record.a)) + more) / h
        last = record.memory._replace(
            rates=jnp.concatenate([rate[None], record.memory.rates[:-1]]),
            times=jnp.concatenate([(record.t + epsilon)[None], record.memory.times[:-1]]),
            found=None,
        )
        return record.later(h, g=g, mu=record.mu + mu, a=record.a + a, memory=jax.lax.stop_gradient(last))

    def sources(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        return jnp.zeros(system.group.dim), jnp.zeros(system.group.dim)

    def impulse(self, system: System, record: State, h: Scalar, after: State) -> Array:
        """0: nothing forces."""
        return jnp.zeros(system.group.dim)

    def energy(self, system: System, record: State, h: Scalar) -> Array:
        """ℋ at the unknown, one number: this method has no Λ."""
        middle = momenta_of(system, record.memory.middle)
        return self._hamiltonian(system, record, record.t + 0.5 * h, *middle)

    def work(self, system: System, record: State, h: Scalar) -> Array:
        """h ∂_tℋ in the middle where ℋ depends on time, (lines,)."""
        if not system.depends_on_time:
            return jnp.zeros(0)
        middle = momenta_of(system, record.memory.middle)
        return h * jax.grad(lambda t: self._hamiltonian(system, record, t, *middle))(record.t + 0.5 * h)[None]

    def balance(self, system: System, record: State, h: Scalar, after: State) -> Array:
        """|X_{k+1} − X̃ + G(−ε)|∞ relative to X = (W, Θ), one number: both ends of the step fit the same X̃.

        Of W: W_{k+1} = (1 + εP̃)W̃(1 − εP̃) = W̃ + ε[P̃, W̃] − ε² P̃W̃P̃ = W̃ − G(−ε), where G(ε) = ε[P̃, W̃] + ε² P̃W̃P̃.
        """
        z, slopes = record.memory.middle, (record.xi, record.memory.along_a)
        off = lifted(system, after.mu, after.a) - z + moved(system, *slopes, z, -0.5 * h)
        return relative(jnp.max(jnp.abs(off)), largest(after.mu, after.a))

    def newton_residual(self, system: System, record: State, h: Scalar, after: State) -> Array:
        """|equations|∞ relative to W and Θ, one number."""
        return relative(jnp.max(jnp.abs(self.equations(system, record, h))), largest(record.mu, record.a))


def _weights(times: Array, t: Scalar) -> Array:
    """Lagrange's weights (k,) of values at `times` (k,) for the value at t, of as many of the first as are not wild."""
    count = len(times)
    apart = times[:, None] - times[None] + jnp.eye(count)
    ratios = jnp.where(np.eye(count, dtype=bool), 1.0, (t - times) / apart)
    taken = np.tri(count, dtype=bool)
    weights = jnp.where(taken, jnp.prod(jnp.where(taken[:, None], ratios, 1.0), axis=2), 0.0)
    tame = jnp.sum(jnp.abs(weights), axis=1) < WILD
    return weights[count - 1 - jnp.argmax(tame[::-1])]
