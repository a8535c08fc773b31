"""RATTLE: a step of any method between two impulses of the reactions of constraints."""

from __future__ import annotations

import operator
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.difference_maps import DifferenceMap
from coadjoint.errors import ArgumentError
from coadjoint.groups.group import Element
from coadjoint.kernels.newton.coupled import Coupled, Factors
from coadjoint.kernels.newton.solver import Dense
from coadjoint.kernels.program import Structure
from coadjoint.kernels.trace.evaluate import traced
from coadjoint.mechanics.constrained_start import Known, checked_members, checked_start
from coadjoint.mechanics.constraints import Bound, places
from coadjoint.mechanics.coupling import structure
from coadjoint.mechanics.discrete import Node, Point
from coadjoint.mechanics.projection import tangent_start
from coadjoint.mechanics.reactions import Independent, chosen, closing, count, kicked, powers, site, source
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.coupled_links import Joined, require_coupling
from coadjoint.methods.step import Step


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Reactions:
    """The memory of RATTLE.

    step: λ of the step that starts at a record, (m,). end: λ′ of the step before, (m,), the guess of λ; at the start
    zero. base: the memory of the method. independent: where rows are redundant, the places of those that are kept;
    λ of the others is zero. kept: inside jit, grad or vmap instead, 1 at those rows and 0 at others, (m,).
    """

    step: Array
    end: Array
    base: Any
    independent: tuple[int, ...] | None = field(default=None, metadata={"static": True})
    kept: Array | None = None

    @property
    def rows(self) -> Independent:
        """The rows that are kept."""
        return self.independent if self.kept is None else self.kept


@dataclass(frozen=True)
class Rattle(Step):
    """An impulse ½hAᵀλ at node k, the step Φ_h of a method, an impulse ½hAᵀλ′ at node k + 1 (mathematics: 6).

    λ is that for which the step ends with φ(n_{k+1}, a_{k+1}) = 0, and for which its own velocities satisfy
    Σw(A·(ξ, ν) − b) = 0 over the nodes of its quadrature; λ′ that for which the velocities of node k + 1 satisfy
    A·(ξ, ν) = b, with A·(ξ, ν) − b = φ̇ of holonomic constraints. The adjoint of the step is that around Φ*_h, so that
    compositions keep their order. Around a symplectic Φ with holonomic constraints alone it is symplectic on T*N,
    N = {φ = 0}.

    base: the step Φ. Source: Reich, SIAM J. Numer. Anal. 33 (1996) 475; McLachlan, Modin, Verdier and Wilkins, Found.
    Comput. Math. 14 (2014) 339.
    """

    base: Step

    @property
    def difference_map(self) -> DifferenceMap:  # pyright: ignore[reportIncompatibleVariableOverride]
        """That of the base."""
        return self.base.difference_map

    @property
    def carries_g(self) -> bool:
        return self.base.carries_g

    def blocks(self, system: System) -> tuple[int, ...]:
        return (*self.base.blocks(system), count(system))

    def structure(self, system: System) -> Structure:
        """That of the base with the multipliers of joints as further unknowns of links; each step computes factors."""
        if not isinstance(self.base.structure(system), Coupled):
            return Dense(multipliers=True)
        found = structure(system.places, tuple(one.size for one in system.constraints))
        return Joined(found.count, found.sizes, found.pairs) if isinstance(found, Coupled) else Dense(True)

    def damping_rate(self, system: System) -> float:
        return self.base.damping_rate(system)

    def require_fit(self, system: System) -> None:
        name = getattr(self.base, "title", "A method of variable steps")
        if not self.base.constrainable:
            raise ArgumentError(
                f"{name} takes no constraints: use a method of one stage and fixed step, such as "
                "co.Midpoint(), or a composition of it such as co.Suzuki4(co.Midpoint())."
            )
        without = type(self.base).quadrature is Step.quadrature
        if without and not all(one.holonomic for one in system.constraints):
            raise ArgumentError(
                f"{name} has no quadrature on which co.Nonholonomic could hold velocities: use co.Midpoint() or "
                "another rule."
            )
        self.base.require_fit(system)

    def remember(self, system: System, state: State) -> State:
        bare = state.replace(memory=None)
        base = self.base.remember(system, bare)
        memory = None if isinstance(base.memory, Factors) else base.memory
        how = self.structure(system)
        if isinstance(how, Coupled):
            nothing = Reactions(np.zeros(count(system)), np.zeros(count(system)), memory)
            require_coupling(
                system, lambda here, s, h, z: self.residual(here, s.replace(memory=nothing), h, z), bare, how
            )
        kept = state.memory.end if isinstance(state.memory, Reactions) else np.zeros(count(system))
        independent = None if traced(state, system.parameters) else checked_start(system, bare)
        return state.replace(memory=Reactions(kept, kept, memory, independent))

    def remember_by_xla(self, system: System, state: State) -> State:
        return state

    def require_members(
        self, system: System, parameters: PyTree, axes: PyTree, states: State, starts: State
    ) -> State | None:
        self.base.require_members(system, parameters, axes, states, starts)
        independent = checked_members(system, parameters, axes, states.replace(memory=None))
        if not isinstance(states.memory, Reactions):
            return None
        return states.replace(memory=replace(states.memory, independent=independent))

    def turn(self, system: System, h: Scalar, xi: Array) -> Element | None:
        return self.base.turn(system, h, xi)

    def _unknowns(self, system: System) -> int:
        """The number of unknowns of the base, which come first."""
        return sum(self.base.blocks(system))

    def guess(self, system: System, state: State, h: Scalar) -> Array:
        return jnp.concatenate([self.base.guess(system, self._bare(state), h), state.memory.end])

    def record(self, system: System, state: State, h: Scalar, z: Array) -> State:
        of_base = self._unknowns(system)
        found = self.base.record(system, self._bare(state), h, z[:of_base])
        return found.replace(memory=replace(state.memory, step=z[of_base:], base=found.memory))

    @staticmethod
    def _bare(state: State) -> State:
        """The state with the memory of the base."""
        return state.replace(memory=state.memory.base)

    def inner(self, system: System, record: State, h: Scalar) -> State:
        """The record of the base's own step: with (μ, π) after the impulse ½hAᵀλ."""
        return kicked(system, self._bare(record), 0.5 * h * record.memory.step)

    def equations(self, system: System, record: State, h: Scalar) -> Array:
        inner = self.inner(system, record, h)
        held = chosen(self._held(system, inner, h), record.memory.step, record.memory.rows)
        return jnp.concatenate([self.base.equations(system, inner, h), held])

    def _held(self, system: System, inner: State, h: Scalar) -> Array:
        """φ(n_{k+1}, a_{k+1})/h, and Σw(A·(ξ, ν) − b) over the nodes of the quadrature, (m,)."""
        after = self.base.advance(system, inner, h) if any(one.holonomic for one in system.constraints) else inner
        points = self.base.quadrature(system, inner, h) if not all(one.holonomic for one in system.constraints) else []

        held = iter(places(system, [one for one in system.constraints if one.holonomic], site(after)))

        def of(one: Bound) -> Array:
            if one.holonomic:
                return next(held) / h
            rates = [w * one.rate(system, _site_of(inner, point), point.xi, point.nu) for w, point in points]
            return reduce(operator.add, rates)

        return jnp.concatenate([of(one) for one in system.constraints])

    def advance(self, system: System, record: State, h: Scalar) -> State:
        return self._ended(system, record, h)[0]

    def _ended(self, system: System, record: State, h: Scalar) -> tuple[State, Array]:
        """The state at node k + 1, and the impulse ½hλ′ there."""
        free = self.base.advance(system, self.inner(system, record, h), h)
        impulse = closing(system, free, record.memory.rows)
        after = kicked(system, free, impulse)
        end = 2 * impulse / h
        return after.replace(memory=replace(record.memory, step=end, end=end, base=free.memory)), impulse

    def relative(self, system: System, record: State, h: Scalar) -> Element:
        return self.base.relative(system, self._bare(record), h)

    def chart(self, system: System, record: State, h: Scalar) -> Scalar:
        return self.base.chart(system, self._bare(record), h)

    def nodes(self, system: System, record: State, h: Scalar) -> list[tuple[float, Node]]:
        return self.base.nodes(system, self.inner(system, record, h), h)

    def quadrature(self, system: System, record: State, h: Scalar) -> list[tuple[float, Point]]:
        return self.base.quadrature(system, self.inner(system, record, h), h)

    def discrete_lagrangian(self, system: System, record: State, h: Scalar) -> Scalar:
        return self.base.discrete_lagrangian(system, self.inner(system, record, h), h)

    def energy(self, system: System, record: State, h: Scalar) -> Array:
        return self.base.energy(system, self.inner(system, record, h), h)

    def size(self, record: State, h: Scalar) -> Scalar:
        return self.base.size(record, h)

    def work(self, system: System, record: State, h: Scalar) -> Array:
        """The work of the base, then ½h(⟨λ, b⟩ at node k + ⟨λ′, b⟩ at node k + 1) of each line of a reaction."""
        return self.work_to(system, record, h, self.advance(system, record, h))

    def work_to(self, system: System, record: State, h: Scalar, after: State) -> Array:
        """`work`, one number each; λ′ is in the memory of the state after the step."""
        here, there = (site(record), record.memory.step), (site(after), after.memory.end)
        lines = sum(powers(system, at, 0.5 * h * strength) for at, strength in (here, there))
        return jnp.concatenate([self.base.work(system, self.inner(system, record, h), h), lines])

    def sources(self, system: System, record: State, h: Scalar) -> tuple[Array, Array]:
        """Those of the base, and the changes of m by the reactions at both nodes."""
        return self.sources_to(system, record, h, self.advance(system, record, h))

    def sources_to(self, system: System, record: State, h: Scalar, after: State) -> tuple[Array, Array]:
        """`work`, one number each; λ′ is in the memory of the state after the step."""
        ahead, behind = self.base.sources(system, self.inner(system, record, h), h)
        return (
            ahead + source(system, site(record), 0.5 * h * record.memory.step),
            behind + source(system, site(after), 0.5 * h * after.memory.end),
        )

    def newton_residual(self, system: System, record: State, h: Scalar, after: State) -> Array:
        """That of the base; the constraints have monitors of their own."""
        return self.base.newton_residual(system, self.inner(system, record, h), h, after)


def _site_of(state: State, point: Point) -> Any:
    return site(state)._replace(n=point.n, a=point.a, t=jnp.asarray(point.t, dtype=float))


def kept(state: State) -> Reactions | None:
    """The memory that a record gives to a run that continues from it: the guess of the multipliers."""
    return state.memory if isinstance(state.memory, Reactions) else None


def begun_in_trace(system: System, state: State, known: Known) -> tuple[State, Array | None]:
    """A state begun inside jit, grad or vmap with its rows (m,); whether it is on the constraints, if unknown.

    known: `known_start` of the system.
    """
    if not system.constraints:
        return state, None
    if known[0]:
        return state.replace(memory=replace(state.memory, independent=known[1])), None
    state, kept, on = tangent_start(system, state)
    return state.replace(memory=replace(state.memory, kept=kept)), on


def redundancy(state: State) -> list[str]:
    """A sentence about redundant rows of the constraints of a state that was begun, if there are any."""
    memory = kept(state)
    if memory is None or memory.independent is None:
        return []
    rank, rows = len(memory.independent), np.shape(memory.step)[-1]
    return [
        f"The constraints have {rows} rows, of which {rows - rank} follow from the others at the start: the reactions "
        "are the least of those that do the same."
    ]


def constrained(system: System, step: Step) -> Step:
    """The step of a method for a system: RATTLE around it where the system has constraints."""
    return Rattle(step) if system.constraints else step


def around(system: System, stages: tuple[tuple[Step, float], ...]) -> tuple[tuple[Step, float], ...]:
    """The stages of a method for a system."""
    if not system.constraints:
        return stages
    return tuple((constrained(system, step), fraction) for step, fraction in stages)
