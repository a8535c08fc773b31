"""The contract of a step: one implicit stage of a method."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import jax.numpy as jnp

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.difference_maps import DifferenceMap
from coadjoint.difference_maps.axioms import require_own_map
from coadjoint.errors import must_give
from coadjoint.groups.group import Element
from coadjoint.kernels.newton.coupled import Coupled, Factors
from coadjoint.kernels.newton.solver import Dense
from coadjoint.kernels.program import FLOOR, Structure
from coadjoint.mechanics.coupling import structure
from coadjoint.mechanics.discrete import Node, Point
from coadjoint.mechanics.momentum_sizes import above, alone, largest, relative
from coadjoint.mechanics.noether import momentum_scale, total_momentum
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.coupled_links import require_coupling
from coadjoint.spaces.space import require_affine


class Step(ABC):
    """One implicit stage: the left discrete Legendre transform solved for z = (ξ, y), then an explicit update.

    A stage must give four abstract members: `relative`, which the classes of `increments.py` have, `equations`,
    `advance` and `sources`. It also gives `nodes`, or `energy` and `work` if Λ is not a sum over nodes, and
    `discrete_lagrangian` if there is a Λ. All other members have defaults.

    y are the frame coordinates of the velocity ν at the rule's own node. A step is a static object;
    `system`, `state`, `h` and z are its arguments. A *record* is a state with the unknowns of the step that starts
    at it.
    """

    difference_map: DifferenceMap
    tolerant = False
    """Whether the method continues if this step's equations have no solution: then it has `advance_if`."""

    constrainable = True
    """Whether RATTLE may be put around the step: it begins and ends with momenta of the nodes, over a given h."""

    takes_smooth_actions = False
    """Whether Q may carry an action that is not affine: the step turns both ends of q, and no vectors between them."""

    @property
    def carries_g(self) -> bool:
        """Whether the step moves g, which its start must have then."""
        return True

    def blocks(self, system: System) -> tuple[int, ...]:
        """The sizes of blocks of unknowns of one kind and unit, in order: Newton stops by the scale of each block."""
        return system.group.dim, system.additional.dim(system.group)

    def structure(self, system: System) -> Structure:
        """How the equations are solved, `kernels.program.Structure`: by default Newton's method with all unknowns,
        and that of `co.Power`'s coupling where these are (ξ, y).
        """
        plain = self.blocks(system) == Step.blocks(self, system)
        return structure(system.places) if plain else Dense()

    def damping_rate(self, system: System) -> float:
        """The fastest rate, 1/s, at which the step itself damps, besides forces of the system."""
        return 0.0

    def carried(self, state: State) -> PyTree:
        """Factors that the solution of the last step left in the state for this one; () if there are none."""
        return state.memory if isinstance(state.memory, Factors) else ()

    def carry(self, after: State, carried: PyTree) -> State:
        """The state after a step with its factors for the next one; `carried` None removes them, () changes nothing."""
        return after if carried == () else after.replace(memory=carried)

    def evaluated(self, system: System, state: State, h: Scalar, z: Array) -> PyTree:
        """The function values for `structure` at the unknowns z (unknowns,): `residual`."""
        return self.residual(system, state, h, z)

    def solved(self, state: State, found: PyTree) -> State:
        """The state with the further results of `structure`, for `record` and `advance`."""
        return state

    def require_fit(self, system: System) -> None:
        """Raise GroupError or ArgumentError if the step does not fit the system, or its map is wrong."""
        if not self.takes_smooth_actions:
            require_affine(
                system.additional,
                f"{type(self).__name__} averages positions and",
                "use co.Midpoint(), co.LeftRectangle(), or co.Variational() with a discrete Lagrangian",
            )
        if system.verify:
            require_own_map(self.difference_map, system.group)
        self.difference_map.require_fit(system.group)

    def remember(self, system: System, state: State) -> State:
        """The state with the memory that a run of this step starts with; of links, checked that they are coupled so."""
        how = self.structure(system)
        if not isinstance(how, Coupled):
            return state
        require_coupling(system, self.residual, state, how)
        return state

    def remember_by_xla(self, system: System, state: State) -> State:
        """The state with the memory of a run by XLA: factors of links are carried over, at the start none yet."""
        how = self.structure(system)
        if not isinstance(how, Coupled) or state.memory is not None:
            return state
        return state.replace(memory=how.nothing())

    def require_members(
        self, system: System, parameters: PyTree, axes: PyTree, states: State, starts: State
    ) -> State | None:
        """Raise ArgumentError if a member of an ensemble does not fit, as `remember` does where there is one.

        parameters: a tree with an axis of members where `axes`, a tree like it, is 0. states: (members, …) each.
        starts: one, or (members, …), as they were given.
        Returns the states with what numbers tell of them, None where they stay.
        """
        return None

    def turn(self, system: System, h: Scalar, xi: Array) -> Element | None:
        """X for which ν of the rule's own node is given in the frame X⁻¹; None for e. h: one number. xi: (dim G,)."""
        return None

    def velocity(self, system: System, state: State, h: Scalar, xi: Array, y: Array) -> Array:
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

    def record(self, system: System, state: State, h: Scalar, z: Array) -> State:
        """`state` with the unknowns z = (ξ, y), (dim G + dim Q,), of the step that starts at it."""
        xi, y = z[: system.group.dim], z[system.group.dim :]
        return in_records(state).replace(xi=xi, nu=self.velocity(system, state, h, xi, y))

    def residual(self, system: System, state: State, h: Scalar, z: Array) -> Array:
        """The equations of the step at the unknowns z; both of shape (unknowns,)."""
        return self.equations(system, self.record(system, state, h, z), h)

    def guess(self, system: System, state: State, h: Scalar) -> Array:
        """Where Newton's iteration begins, (unknowns,): the last unknowns."""
        group, Q, _ = system.places
        if Q.flat:
            return jnp.concatenate([state.xi, state.nu])
        X = self.turn(system, h, state.xi)
        nu = state.nu if X is None else Q.push(group, X, state.n, state.nu)
        return jnp.concatenate([state.xi, Q.coordinates(group, state.n, nu)])

    def nodes(self, system: System, record: State, h: Scalar) -> list[tuple[float, Node]]:
        """The quadrature of the rule, Λ = h Σ w ℓ(node): pairs of a weight, one number, and values of ℓ at a node."""
        must_give(self, "nodes")

    def quadrature(self, system: System, record: State, h: Scalar) -> list[tuple[float, Point]]:
        """Where the rule evaluates ℓ, in the order of `nodes`: pairs of a weight, one number, and a point."""
        must_give(self, "quadrature")

    def discrete_lagrangian(self, system: System, record: State, h: Scalar) -> Scalar:
        """Λ of the step that starts at the record, one number."""
        return h * sum(weight * at.lagrangian for weight, at in self.nodes(system, record, h))

    @abstractmethod
    def relative(self, system: System, record: State, h: Scalar) -> Element:
        """F = g_k⁻¹g_{k+1}, an element, of the step that starts at the record. h: one number, as in all members."""

    @abstractmethod
    def equations(self, system: System, record: State, h: Scalar) -> Array:
        """The left discrete Legendre transform minus (μ_k, π_k), (unknowns,).

        It is zero for the step that starts at the record.
        """

    @abstractmethod
    def advance(self, system: System, record: State, h: Scalar) -> State:
        """The state at t + h, from the right discrete Legendre transform and (P43), (P44). h: one number."""

    def advance_if(self, system: System, record: State, h: Scalar, sound: Array) -> State:
        """The state after a tolerant step.

        sound: one number; where it is 0 the equations have no solution and z is the guess.
        """
        must_give(self, "advance_if")

    @abstractmethod
    def sources(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        """(Δ⁻, Δ⁺) ∈ 𝔤*, (dim G,) each, in frames k and k+1: I_{k+1} − I_k = ⟨𝒦_k, Δ⁻⟩ + ⟨𝒦_{k+1}, Δ⁺⟩ (Theorem 7)."""

    def sources_to(self, system: System, record: State, h: Scalar, after: State) -> tuple[Array, Array]:
        """`sources`, (dim G,) each, of a step that ends at a known node; h: one number."""
        return self.sources(system, record, h)

    def chart(self, system: System, record: State, h: Scalar) -> Array | float:
        """How far the difference map is used into its chart, one number; below 1 is inside."""
        return self.difference_map.chart(system.group, h * record.xi)

    def energy(self, system: System, record: State, h: Scalar) -> Array:
        """The rule's own discrete energy E_k = −∂_hΛ at fixed F and s, one number: Σ w E(node).

        With the left rule it is K_k + U_k of (P68), (P69).
        """
        return sum(weight * at.energy for weight, at in self.nodes(system, record, h))  # type: ignore[return-value]

    def size(self, record: State, h: Scalar) -> Scalar:
        """The size of the step that starts at the record, one number."""
        return h

    def work(self, system: System, record: State, h: Scalar) -> Array:
        """Σ hw (⟨T, ξ⟩ + ⟨f, ν⟩) of each force, then −Σ hw ∂_tℓ where ℓ depends on time, (lines,).

        Their sum is E_{k+1} − E_k + O(h^{p+1}).
        """
        return h * sum(weight * at.power for weight, at in self.nodes(system, record, h))  # type: ignore[return-value]

    def impulse(self, system: System, record: State, h: Scalar, after: State) -> Array:
        """Ad*_{g_k⁻¹}Δ⁻ + Ad*_{g_{k+1}⁻¹}Δ⁺ ∈ 𝔤*, (dim G,).

        By this the step changes the spatial momentum (Theorem 7).
        """
        group = system.group
        ahead, behind = self.sources_to(system, record, h, after)
        return group.Ad_dual(group.inverse(record.g), ahead) + group.Ad_dual(group.inverse(after.g), behind)

    def balance(self, system: System, record: State, h: Scalar, after: State) -> Array:
        """|m_{k+1} − Ad*_F (m_k + Δ⁻) − Δ⁺|∞ relative to |μ| + |π||n|, one number: Theorem 7 as one vector identity."""
        ahead, behind = self.sources_to(system, record, h, after)
        F = self.relative(system, record, h)
        expected = system.group.Ad_dual(F, total_momentum(system, record) + ahead) + behind
        error = jnp.max(jnp.abs(total_momentum(system, after) - expected), initial=0.0)
        return relative(error, momentum_scale(system, record) + jnp.max(jnp.abs(ahead) + jnp.abs(behind), initial=0.0))

    def certificate(self, system: System, record: State, h: Scalar, after: State) -> dict[str, Array]:
        """`balance` and `newton_residual` by their names, one number each."""
        return {
            "balance": self.balance(system, record, h, after),
            "newton_residual": self.newton_residual(system, record, h, after),
        }

    def newton_residual(self, system: System, record: State, h: Scalar, after: State) -> Array:
        """|equations|∞, the rows of μ relative to |μ| and those of π relative to |π|, the larger of both, one number.

        |μ| is the largest at both nodes, or the momentum of ξ or ν alone if these cancel; |π| likewise. The residual
        excludes round-off: 16 ε of the added terms, and the momentum of a velocity under `FLOOR`/h, with which Newton's
        iteration stops. The torques in the rows of μ carry the round-off of π times a lever. Thus a body that does not
        turn, or stays where forces balance, is also solved to round-off.
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
    """Sizes of one kind of momentum: that of ξ alone or ν alone, and that of velocities that count as 0."""

    part: Array
    least: Array


def _momentum_sizes(system: System, record: State, h: Scalar) -> tuple[_Sizes, _Sizes]:
    """The sizes of μ and of π."""
    least = FLOOR / jnp.abs(h)
    xi, nu = record.xi + least, record.nu + least
    by_xi_and_nu, speeds = alone(system, record, xi, nu), [largest(xi), largest(nu)]

    def sizes(kind: int) -> _Sizes:
        parts = [part[kind] for part in by_xi_and_nu]
        of_least = [least * relative(part, speed) for part, speed in zip(parts, speeds, strict=True)]
        return _Sizes(jnp.maximum(*parts), jnp.maximum(*of_least))

    return sizes(0), sizes(1)


def in_records(state: State) -> State:
    """The state without the factors that pass from step to step, which records do not keep."""
    return state.replace(memory=None) if isinstance(state.memory, Factors) else state
