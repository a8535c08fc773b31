"""The contracts of a step and of a method, and how a method becomes a program for a kernel."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import reduce
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.difference_maps import Cayley, DifferenceMap
from coadjoint.difference_maps.axioms import require_own_map
from coadjoint.errors import ArgumentError, shown
from coadjoint.groups.group import Array, Element
from coadjoint.kernels.program import FLOOR
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.discrete import Node
from coadjoint.mechanics.momentum_sizes import above, alone, largest, relative
from coadjoint.mechanics.noether import momentum_scale, total_momentum
from coadjoint.mechanics.over_step import advanced
from coadjoint.mechanics.start import momentum_start
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System

Start = Literal["momentum", "velocity"]
Energy = Literal["bounded", "exact", "quadratic", "discrete"]


class Claims(NamedTuple):
    """What a method claims of every smooth system; `coadjoint audit` measures each claim.

    `order` of convergence, with forces too, and `order_with_internal`, 2 at most, with actuators and sampled
    controllers; `symmetric`: step(−h) undoes step(h). Of unforced motion: `symplectic`, the two-form is kept;
    `momentum`, m of every isotropy direction is kept to round-off; `energy`, "bounded" for an error without drift,
    "exact" for Legendre's to round-off, "quadratic" for that where ℋ is quadratic and nothing elsewhere,
    "discrete" for −∂_hΛ to round-off.
    """

    order: int
    symmetric: bool
    symplectic: bool = True
    momentum: bool = True
    energy: Energy = "bounded"

    @property
    def order_with_internal(self) -> int:
        """Of a system whose internal state has a rule: forces have its mean over a step, its course is left out."""
        return min(self.order, 2)


class Step(ABC):
    """One implicit stage: the left discrete Legendre transform solved for z = (ξ, y), then explicit.

    A stage must give four members, which are abstract: `relative`, which the classes of `increments.py` have,
    `equations`, `advance` and `sources`; besides these `nodes`, or where Λ is no sum over nodes, `energy` and `work`,
    and `discrete_lagrangian` where there is a Λ. All else has a default.

    y are the frame coordinates of the velocity ν at the rule's own node. A step is a static object;
    `system`, `state`, `h` and z are its arguments. A *record* is a state with the unknowns of the step that starts
    at it.
    """

    difference_map: DifferenceMap
    tolerant = False
    """Whether the method goes on where this step's equations have no solution: then it has `advance_if`."""

    def blocks(self, system: System) -> tuple[int, ...]:
        """How many unknowns, in their order, are of one kind and unit: Newton stops by each block's own scale."""
        return system.group.dim, system.additional.dim(system.group)

    def require_fit(self, system: System) -> None:
        """Raise GroupError or ArgumentError where the step does not fit the system, or its map is wrong."""
        if system.verify:
            require_own_map(self.difference_map, system.group)
        self.difference_map.require_fit(system.group)

    def remember(self, system: System, state: State) -> State:
        """The state with the memory that a run of this step starts with."""
        return state

    def require_members(self, system: System, parameters: Any, axes: Any, states: State) -> None:
        """Raise ArgumentError where a member of an ensemble does not fit, as `remember` does where there is one.

        parameters: a tree with an axis of members where `axes`, a tree like it, is 0. states: (members, …) each.
        """
        return

    def turn(self, system: System, h: Array, xi: Array) -> Element | None:
        """X with which ν of the rule's own node stands in the frame X⁻¹; None for e. h: one number. xi: (dim G,)."""
        return None

    def velocity(self, system: System, state: State, h: Array, xi: Array, y: Array) -> Array:
        """ν = y on a flat Q; on a curved one X⁻¹(ρ(n, hE_n y) − n)/h, (ambient,).

        xi: (dim G,). y: (dim Q,) in the frame E of n itself, which stays while the equations are solved.
        """
        group, Q, _ = system.places
        if Q.flat:
            return y
        chord = Q.difference(group, state.n, h * Q.tangent(group, state.n, y)) / h
        X = self.turn(system, h, xi)
        return chord if X is None else Q.push(group, group.inverse(X), state.n, chord)

    def coordinates(self, system: System, record: State, X: Element | None, b: Array) -> Array:
        """A covector b (ambient,) at X⁻¹n: itself on a flat Q, on a curved one E_nᵀ X⁻* b (dim Q,), in n's frame."""
        group, Q, _ = system.places
        if Q.flat:
            return b
        carried = b if X is None else Q.pull(group, group.inverse(X), record.n, b)
        return Q.coordinates(group, record.n, carried)

    def record(self, system: System, state: State, h: Array, z: Array) -> State:
        """`state` with the unknowns z = (ξ, y), (dim G + dim Q,), of the step that starts at it."""
        xi, y = z[: system.group.dim], z[system.group.dim :]
        return state.replace(xi=xi, nu=self.velocity(system, state, h, xi, y))

    def residual(self, system: System, state: State, h: Array, z: Array) -> Array:
        """The equations of the step at the unknowns z; both of shape (unknowns,)."""
        return self.equations(system, self.record(system, state, h, z), h)

    def guess(self, system: System, state: State, h: Array) -> Array:
        """Where Newton's iteration begins, (unknowns,): the last unknowns."""
        group, Q, _ = system.places
        if Q.flat:
            return jnp.concatenate([state.xi, state.nu])
        X = self.turn(system, h, state.xi)
        nu = state.nu if X is None else Q.push(group, X, state.n, state.nu)
        return jnp.concatenate([state.xi, Q.coordinates(group, state.n, nu)])

    def nodes(self, system: System, record: State, h: Array) -> list[tuple[float, Node]]:
        """The quadrature of the rule, Λ = h Σ w ℓ(node): pairs of a weight, one number, and what ℓ gives at a node."""
        raise NotImplementedError

    def discrete_lagrangian(self, system: System, record: State, h: Array) -> Array:
        """Λ of the step that starts at the record, one number."""
        return h * sum(weight * at.lagrangian for weight, at in self.nodes(system, record, h))

    @abstractmethod
    def relative(self, system: System, record: State, h: Array) -> Element:
        """F = g_k⁻¹g_{k+1}, an element, of the step that starts at the record. h: one number, as in all members."""

    @abstractmethod
    def equations(self, system: System, record: State, h: Array) -> Array:
        """The left discrete Legendre transform minus (μ_k, π_k), (unknowns,).

        It is zero for the step that starts at the record.
        """

    @abstractmethod
    def advance(self, system: System, record: State, h: Array) -> State:
        """The state at t + h, from the right discrete Legendre transform and (P43), (P44). h: one number."""

    def advance_if(self, system: System, record: State, h: Array, sound: Array) -> State:
        """The state after a tolerant step.

        sound: one number; where it is 0 the equations have no solution and z is the guess.
        """
        raise NotImplementedError

    @abstractmethod
    def sources(self, system: System, record: State, h: Array) -> tuple[Array, Array]:
        """(Δ⁻, Δ⁺) ∈ 𝔤*, (dim G,) each, in frames k and k+1: I_{k+1} − I_k = ⟨𝒦_k, Δ⁻⟩ + ⟨𝒦_{k+1}, Δ⁺⟩ (Theorem 7)."""

    def chart(self, system: System, record: State, h: Array) -> Array | float:
        """How far the difference map is used into its chart, one number; below 1 is inside."""
        return self.difference_map.chart(system.group, h * record.xi)

    def energy(self, system: System, record: State, h: Array) -> Array:
        """The rule's own discrete energy E_k = −∂_hΛ at fixed F and s, one number: Σ w E(node).

        With the left rule it is K_k + U_k of (P68), (P69).
        """
        return sum(weight * at.energy for weight, at in self.nodes(system, record, h))  # type: ignore[return-value]

    def size(self, record: State, h: Array) -> Array:
        """The size of the step that starts at the record, one number."""
        return h

    def work(self, system: System, record: State, h: Array) -> Array:
        """Σ hw (⟨T, ξ⟩ + ⟨f, ν⟩) of each force, then −Σ hw ∂_tℓ where ℓ depends on time, (lines,).

        Their sum is E_{k+1} − E_k + O(h^{p+1}).
        """
        return h * sum(weight * at.power for weight, at in self.nodes(system, record, h))  # type: ignore[return-value]

    def impulse(self, system: System, record: State, h: Array, after: State) -> Array:
        """Ad*_{g_k⁻¹}Δ⁻ + Ad*_{g_{k+1}⁻¹}Δ⁺ ∈ 𝔤*, (dim G,).

        By this the step changes the spatial momentum (Theorem 7).
        """
        group = system.group
        ahead, behind = self.sources(system, record, h)
        return group.Ad_dual(group.inverse(record.g), ahead) + group.Ad_dual(group.inverse(after.g), behind)

    def balance(self, system: System, record: State, h: Array, after: State) -> Array:
        """|m_{k+1} − Ad*_F (m_k + Δ⁻) − Δ⁺|∞ relative to |μ| + |π||n|, one number: Theorem 7 as one vector identity."""
        ahead, behind = self.sources(system, record, h)
        F = self.relative(system, record, h)
        expected = system.group.Ad_dual(F, total_momentum(system, record) + ahead) + behind
        error = jnp.max(jnp.abs(total_momentum(system, after) - expected), initial=0.0)
        return relative(error, momentum_scale(system, record) + jnp.max(jnp.abs(ahead) + jnp.abs(behind), initial=0.0))

    def newton_residual(self, system: System, record: State, h: Array, after: State) -> Array:
        """|equations|∞, the rows of μ relative to |μ| and those of π relative to |π|, the larger of both, one number.

        |μ| is the largest at both nodes, or what ξ or ν alone would give where these cancel, and so is |π|. Round-off
        counts as such: 16 ε of the terms that were added up, and the momentum of a velocity under `FLOOR`/h, with
        which Newton's iteration stops. The torques in the rows of μ carry the round-off of π times a lever. So a body
        that does not turn, or stays where forces balance, is solved to round-off, too.
        """
        rows, dim = jnp.abs(self.equations(system, record, h)), self.blocks(system)[0]
        of_mu, of_pi = jnp.max(rows[:dim], initial=0.0), jnp.max(rows[dim:], initial=0.0)
        turning, moving = _momentum_sizes(system, record, h)
        mu = jnp.maximum(largest(record.mu, after.mu), turning.part)
        pi = jnp.maximum(largest(record.pi, after.pi), moving.part)
        torque = sum(largest(part) for part in self.sources(system, record, h))
        lever = mu + momentum_scale(system, record) + pi * largest(h * record.nu) + torque
        return jnp.maximum(above(of_mu, mu, lever, turning.least), above(of_pi, pi, pi, moving.least))


class _Sizes(NamedTuple):
    """Of one kind of momentum: what ξ alone or ν alone would give, and what velocities that count as 0 would."""

    part: Array
    least: Array


def _momentum_sizes(system: System, record: State, h: Array) -> tuple[_Sizes, _Sizes]:
    """The sizes of μ and of π."""
    least = FLOOR / jnp.abs(h)
    xi, nu = record.xi + least, record.nu + least
    by_xi_and_nu, speeds = alone(system, record, xi, nu), [largest(xi), largest(nu)]

    def sizes(kind: int) -> _Sizes:
        parts = [part[kind] for part in by_xi_and_nu]
        of_least = [least * relative(part, speed) for part, speed in zip(parts, speeds, strict=True)]
        return _Sizes(jnp.maximum(*parts), jnp.maximum(*of_least))

    return sizes(0), sizes(1)


_ADJOINTS: dict[type[Method], type[Method]] = {}
"""Methods and their adjoints, each way."""


@dataclass(frozen=True)
class Method(ABC):
    """A one-step method over a group difference map.

    A method must give two members, which are abstract: `order` and `stages`.

    difference_map: τ, by default `co.Cayley()`. start: "momentum" (the default) takes (μ₀, π₀) from the continuous
    Legendre transform, which order ≥ 2 needs; "velocity" takes ξ₀, ν₀ as the first discrete velocities, as the paper
    does. A record of another run goes on with its momenta.
    """

    difference_map: DifferenceMap = field(default_factory=Cayley)
    start: Start = "momentum"

    def __init_subclass__(cls, adjoint_of: type[Method] | None = None, **more: Any):
        """adjoint_of: the method of which Φ*_h = Φ₋ₕ⁻¹ this one is; that one is then its adjoint, too."""
        super().__init_subclass__(**more)
        if adjoint_of is not None:
            _ADJOINTS.update({cls: adjoint_of, adjoint_of: cls})

    def __post_init__(self):
        if not isinstance(self.difference_map, DifferenceMap):
            raise ArgumentError(
                "Argument `difference_map` must be a difference map such as co.Cayley(), "
                f"but is {shown(self.difference_map)}."
            )
        if not isinstance(self.start, str) or self.start not in ("momentum", "velocity"):
            raise ArgumentError(f'Argument `start` must be "momentum" or "velocity", but is {shown(self.start)}.')

    @property
    @abstractmethod
    def order(self) -> int:
        """The order of convergence."""

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
        """Of which records' steps the claim on energy holds, (rows,): all, unless the method overrides this."""
        return np.ones(np.shape(records.t), bool)

    def over_fixed_steps(self, records: State, h: float) -> tuple[State, np.ndarray]:
        """Records with a leading axis as starts of steps of any size, and the sizes (rows,) of those they began."""
        return records, np.full(np.shape(records.t), h)

    @property
    @abstractmethod
    def stages(self) -> tuple[tuple[Step, float], ...]:
        """The implicit stages of a step with their fractions of h."""

    @property
    def remedies(self) -> tuple[str, str]:
        """What to do about a step that Newton could not solve, and about one that left the chart."""
        return "take a smaller dt", "take a smaller dt, or co.Exponential()"

    @property
    def adjoint(self) -> Method:
        """Φ*_h = Φ₋ₕ⁻¹, the method itself where it is symmetric; raises ArgumentError where it is not known."""
        if self.symmetric:
            return self
        kind = next((_ADJOINTS[kind] for kind in type(self).__mro__ if kind in _ADJOINTS), None)
        if kind is not None:
            return kind(self.difference_map, self.start)
        raise ArgumentError(f"The adjoint of {self.title} is not known: use a symmetric method.")

    @property
    def regular(self) -> bool:
        """Whether steps need an invertible Legendre transform."""
        return True

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
        return f"{type(self).__name__}({shown(self.difference_map)})"

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
        over = advanced(here, state.replace(mu=None), h)
        state = state.with_course(over.internal, over.internal_mean, over.internal_end, over.internal_due)
        z = step.guess(here, state, fraction * h)

        def mismatch(p):
            pi = Q.tangent(group, state.n, p[group.dim :])
            return step.residual(here, state.replace(mu=p[: group.dim], pi=pi), fraction * h, z)

        p = jnp.concatenate([state.mu, Q.coordinates(group, state.n, state.pi)])
        p = p - jnp.linalg.solve(jax.jacfwd(mismatch)(p), mismatch(p))
        return p[: group.dim], Q.tangent(group, state.n, p[group.dim :])

    mu, pi = evaluate(momenta, state, system.parameters, h)
    return state.replace(mu=mu, pi=pi, from_velocities=False)
