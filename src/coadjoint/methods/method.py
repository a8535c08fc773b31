"""The contracts of a step and of a method, and how a method becomes a program for a kernel."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import reduce
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.difference_maps import Cayley, DifferenceMap
from coadjoint.errors import ArgumentError
from coadjoint.groups.group import Array, Element
from coadjoint.kernels.evaluate import evaluate
from coadjoint.mechanics.discrete import Node
from coadjoint.mechanics.noether import momentum_scale, total_momentum
from coadjoint.mechanics.start import momentum_start
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System, replace_parameters

Start = Literal["momentum", "velocity"]
Energy = Literal["bounded", "exact", "quadratic", "discrete"]


class Claims(NamedTuple):
    """What a method claims of every smooth system; `coadjoint audit` measures each claim.

    `order` of convergence, with forces too; `symmetric`: step(−h) undoes step(h). Of unforced motion: `symplectic`, the
    two-form is kept; `momentum`, m of every isotropy direction is kept to round-off; `energy`, "bounded" for an error
    without drift, "exact" for Legendre's to round-off, "quadratic" for that where ℋ is quadratic and nothing elsewhere,
    "discrete" for −∂_hΛ to round-off.
    """

    order: int
    symmetric: bool
    symplectic: bool = True
    momentum: bool = True
    energy: Energy = "bounded"


class Step:
    """One implicit stage: the left discrete Legendre transform solved for z = (ξ, y), then explicit.

    y are the frame coordinates of the velocity ν at the rule's own node. A step is a static object;
    `system`, `state`, `h` and z are its arguments. A *record* is a state with the unknowns of the step that starts
    at it.
    """

    difference_map: DifferenceMap
    tolerant = False
    """Whether the method goes on where this step's equations have no solution: then it has `advance_if`."""

    def groups(self, system: System) -> tuple[int, ...]:
        """How many unknowns, in their order, are of one kind and unit: Newton stops by each kind's own scale."""
        return system.group.dim, system.additional.dim(system.group)

    def require_fit(self, system: System) -> None:
        """Raise GroupError or ArgumentError where the step does not fit the system."""
        self.difference_map.require_fit(system.group)

    def remember(self, system: System, state: State) -> State:
        """The state with the memory that a run of this step starts with."""
        return state

    def turn(self, system: System, h: Array, xi: Array) -> Element | None:
        """X with which ν of the rule's own node stands in the frame X⁻¹; None for e."""
        return None

    def velocity(self, system: System, state: State, h: Array, xi: Array, y: Array) -> Array:
        """ν = y on a flat Q; on a curved one X⁻¹(ρ(n, hE_n y) − n)/h.

        The frame E is that of n itself, which stays while the equations are solved.
        """
        group, Q, _ = system.places
        if Q.flat:
            return y
        chord = Q.difference(group, state.n, h * Q.tangent(group, state.n, y)) / h
        X = self.turn(system, h, xi)
        return chord if X is None else Q.push(group, group.inverse(X), state.n, chord)

    def coordinates(self, system: System, record: State, X: Element | None, b: Array) -> Array:
        """A covector b at X⁻¹n: itself on a flat Q, on a curved one in the frame of n, E_nᵀ X⁻* b."""
        group, Q, _ = system.places
        if Q.flat:
            return b
        carried = b if X is None else Q.pull(group, group.inverse(X), record.n, b)
        return Q.coordinates(group, record.n, carried)

    def increment(self, system: System, h: Array, xi: Array) -> Element:
        """F = g_k⁻¹g_{k+1}."""
        raise NotImplementedError

    def relative(self, system: System, record: State, h: Array) -> Element:
        """F of the step that starts at the record."""
        return self.increment(system, h, record.xi)

    def record(self, system: System, state: State, h: Array, z: Array) -> State:
        """`state` with the unknowns of the step that starts at it."""
        xi, y = z[: system.group.dim], z[system.group.dim :]
        return state.replace(xi=xi, nu=self.velocity(system, state, h, xi, y))

    def residual(self, system: System, state: State, h: Array, z: Array) -> Array:
        """The equations of the step at the unknowns z."""
        return self.equations(system, self.record(system, state, h, z), h)

    def guess(self, system: System, state: State, h: Array) -> Array:
        """The last unknowns."""
        group, Q, _ = system.places
        if Q.flat:
            return jnp.concatenate([state.xi, state.nu])
        X = self.turn(system, h, state.xi)
        nu = state.nu if X is None else Q.push(group, X, state.n, state.nu)
        return jnp.concatenate([state.xi, Q.coordinates(group, state.n, nu)])

    def nodes(self, system: System, record: State, h: Array) -> list[tuple[float, Node]]:
        """The quadrature of the rule: Λ = h Σ w ℓ(node)."""
        raise NotImplementedError

    def discrete_lagrangian(self, system: System, record: State, h: Array) -> Array:
        """Λ of the step that starts at the record."""
        return h * sum(weight * at.lagrangian for weight, at in self.nodes(system, record, h))

    def equations(self, system: System, record: State, h: Array) -> Array:
        """The left discrete Legendre transform minus (μ_k, π_k), zero for the step that starts at the record."""
        raise NotImplementedError

    def advance(self, system: System, record: State, h: Array) -> State:
        """The state at t + h, from the right discrete Legendre transform and (P43), (P44)."""
        raise NotImplementedError

    def advance_if(self, system: System, record: State, h: Array, sound: Array) -> State:
        """The state after a tolerant step; where `sound` is 0 the equations have no solution and z is the guess."""
        raise NotImplementedError

    def sources(self, system: System, record: State, h: Array) -> tuple[Array, Array]:
        """(Δ⁻, Δ⁺) ∈ 𝔤* in frames k and k+1 with I_{k+1} − I_k = ⟨𝒦_k, Δ⁻⟩ + ⟨𝒦_{k+1}, Δ⁺⟩ (Theorem 7)."""
        raise NotImplementedError

    def chart(self, system: System, record: State, h: Array) -> Array | float:
        """How far the difference map is used into its chart; below 1 is inside."""
        return self.difference_map.chart(system.group, h * record.xi)

    def energy(self, system: System, record: State, h: Array) -> Array:
        """The rule's own discrete energy E_k = −∂_hΛ at fixed F and s: Σ w E(node). Left: K_k + U_k of (P68–P69)."""
        return sum(weight * at.energy for weight, at in self.nodes(system, record, h))  # type: ignore[return-value]

    def size(self, record: State, h: Array) -> Array:
        """The size of the step that starts at the record."""
        return h

    def work(self, system: System, record: State, h: Array) -> Array:
        """Σ hw (⟨T, ξ⟩ + ⟨f, ν⟩) of each force, then −Σ hw ∂_tℓ where ℓ depends on time: E_{k+1} − E_k + O(h^{p+1})."""
        return h * sum(weight * at.power for weight, at in self.nodes(system, record, h))  # type: ignore[return-value]

    def impulse(self, system: System, record: State, h: Array, after: State) -> Array:
        """Ad*_{g_k⁻¹}Δ⁻ + Ad*_{g_{k+1}⁻¹}Δ⁺ ∈ 𝔤*, by which the step changes the spatial momentum (Theorem 7)."""
        group = system.group
        ahead, behind = self.sources(system, record, h)
        return group.Ad_dual(group.inverse(record.g), ahead) + group.Ad_dual(group.inverse(after.g), behind)

    def balance(self, system: System, record: State, h: Array, after: State) -> Array:
        """|m_{k+1} − Ad*_F (m_k + Δ⁻) − Δ⁺|∞ relative to |μ| + |π||n|: Theorem 7 as one vector identity."""
        ahead, behind = self.sources(system, record, h)
        F = self.relative(system, record, h)
        expected = system.group.Ad_dual(F, total_momentum(system, record) + ahead) + behind
        error = jnp.max(jnp.abs(total_momentum(system, after) - expected))
        return _relative(error, momentum_scale(system, record) + jnp.max(jnp.abs(ahead) + jnp.abs(behind)))

    def newton_residual(self, system: System, record: State, h: Array, after: State) -> Array:
        """|equations|∞, the rows of μ relative to |μ|∞ and those of π relative to |π|∞, the larger at both nodes.

        The torques in the rows of μ carry the round-off of π times a lever; what is above it counts against |μ|, and
        all of it against |μ| and those torques: so a body that does not turn is solved to round-off, too.
        """
        rows, dim = jnp.abs(self.equations(system, record, h)), self.groups(system)[0]
        of_mu, of_pi = jnp.max(rows[:dim]), jnp.max(rows[dim:], initial=0.0)
        mu, pi = _largest(record.mu, after.mu), _largest(record.pi, after.pi)
        torque = sum(_largest(part) for part in self.sources(system, record, h))
        lever = momentum_scale(system, record) + pi * _largest(h * record.nu) + torque
        above = jnp.maximum(of_mu - 16 * np.finfo(float).eps * lever, 0.0)
        relative = _relative(of_mu, lever), _relative(above, jnp.where(mu > 0, mu, lever)), _relative(of_pi, pi)
        return jnp.max(jnp.stack(relative))


def _largest(*arrays: Array) -> Array:
    """The largest entry in size, 0 of nothing."""
    return jnp.max(jnp.abs(jnp.concatenate([jnp.ravel(array) for array in arrays])), initial=0.0)


def _relative(error: Array, scale: Array) -> Array:
    """error/scale, and the error itself at scale 0."""
    return jnp.where(scale > 0, error / jnp.where(scale > 0, scale, 1.0), error)


@dataclass(frozen=True)
class Method:
    """A one-step method over a group difference map.

    `start="momentum"` takes (μ₀, π₀) from the continuous Legendre transform, which order ≥ 2 needs; `"velocity"`
    takes ξ₀, ν₀ as the first discrete velocities, as the paper does. A record of another run goes on with its momenta.
    """

    difference_map: DifferenceMap = field(default_factory=Cayley)
    start: Start = "momentum"

    def __post_init__(self):
        if not isinstance(self.difference_map, DifferenceMap):
            raise ArgumentError(
                "Argument `difference_map` must be a difference map such as co.Cayley(), "
                f"but is {self.difference_map!r}."
            )
        if self.start not in ("momentum", "velocity"):
            raise ArgumentError(f'Argument `start` must be "momentum" or "velocity", but is {self.start!r}.')

    @property
    def order(self) -> int:
        """The order of convergence."""
        raise NotImplementedError

    @property
    def symmetric(self) -> bool:
        """Whether step(−h) undoes step(h): what compositions of even order need."""
        return False

    @property
    def claims(self) -> Claims:
        """What the method keeps: a variational method with fixed steps keeps all of it, and energy within a band."""
        return Claims(self.order, self.symmetric)

    @property
    def variable(self) -> bool:
        """Whether steps have sizes of their own, so that nodes are not at whole multiples of dt."""
        return False

    def holds(self, records: State) -> Array:
        """Of which records' steps the claim on energy holds, (rows,): all, unless the method tells otherwise."""
        return np.ones(np.shape(records.t), bool)

    @property
    def stages(self) -> tuple[tuple[Step, float], ...]:
        """The implicit stages of a step with their fractions of h."""
        raise NotImplementedError

    @property
    def remedies(self) -> tuple[str, str]:
        """What to do about a step that Newton could not solve, and about one that left the chart."""
        return "take a smaller dt", "take a smaller dt, or co.Exponential()"

    @property
    def adjoint(self) -> Method:
        """Φ*_h = Φ₋ₕ⁻¹, the method itself where it is symmetric; raises ArgumentError where it is not known."""
        if self.symmetric:
            return self
        raise ArgumentError(f"The adjoint of {self.title} is not known: use a symmetric method.")

    @property
    def substeps(self) -> tuple[float, ...]:
        """The substeps of a composition, as parts of h."""
        return (1.0,)

    @property
    def pattern(self) -> tuple[tuple[Step, float], ...]:
        """The stages of one substep with their fractions of it."""
        return self.stages

    @property
    def recorded(self) -> tuple[Step, float]:
        """The stage whose record is that of the step: the first that is not tolerant."""
        return next(stage for stage in self.stages if not stage[0].tolerant)

    @property
    def title(self) -> str:
        """The method in words, for cards and figures."""
        return f"{type(self).__name__}({self.difference_map!r})"

    def begin(self, system: System, state: State, h: float) -> State:
        """The state with the momenta and memory that the method starts from."""
        steps = [step for step, _ in self.stages]
        for step in steps:
            step.require_fit(system)
        velocities = self.start == "velocity" and state.from_velocities
        begun = velocity_start(system, state, *self.recorded, h) if velocities else momentum_start(system, state)
        return reduce(lambda state, step: step.remember(system, state), steps, begun.replace(memory=None))


def velocity_start(system: System, state: State, step: Step, fraction: float, h: float) -> State:
    """(μ₀, π₀) for which the first step has exactly ξ₀ and ν₀ as unknowns: the residual is affine in (μ, π)."""
    group, Q, _ = system.places

    def momenta(state, parameters, h):
        here = replace_parameters(system, parameters)
        z = step.guess(here, state, h)

        def mismatch(p):
            pi = Q.tangent(group, state.n, p[group.dim :])
            return step.residual(here, state.replace(mu=p[: group.dim], pi=pi), h, z)

        p = jnp.concatenate([state.mu, Q.coordinates(group, state.n, state.pi)])
        p = p - jnp.linalg.solve(jax.jacfwd(mismatch)(p), mismatch(p))
        return p[: group.dim], Q.tangent(group, state.n, p[group.dim :])

    mu, pi = evaluate(momenta, state, system.parameters, h * fraction)
    return state.replace(mu=mu, pi=pi, from_velocities=False)
