"""How a method on a system becomes a program for a kernel."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from typing import Any, Literal

import jax
import jax.numpy as jnp

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.kernels.program import Structure
from coadjoint.kernels.trace.identity import identity
from coadjoint.kernels.trace.jaxprs import depends
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.identity import OPAQUE, parts
from coadjoint.mechanics.internal_state import at_node, stepped
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.work_balance import entered, with_tables
from coadjoint.methods.linked_stage import StepOfLinks, linked
from coadjoint.methods.method import Method
from coadjoint.methods.rattle import around
from coadjoint.methods.renewal import ALL_HELD, RENEWED, held
from coadjoint.methods.step import Step

EVENTS = "values of events"
"""The monitor of a program that locates zeros of functions; no name of a user's quantity."""


@dataclass(frozen=True)
class Constants:
    """The arguments of a program other than h and the state: the system's parameters and the constants of monitors.

    `renewal` selects the values that every step renews at the node where it starts: RENEWED, inputs and internal state;
    INPUTS_HELD, the internal state alone, with the inputs that the state holds; ALL_HELD, neither. None means the
    first, in a program without the others.

    renewal: one number.
    """

    system: Parameters | None
    monitors: Any
    renewal: Scalar | None = None


jax.tree_util.register_dataclass(Constants, ["system", "monitors", "renewal"], [])

Monitor = Callable[[System, Step, State, PyTree, PyTree], PyTree]


_current: ContextVar[str | None] = ContextVar("current", default=None)


@contextmanager
def as_read(version: str) -> Generator[None]:
    """A context in which functions are unchanged since this version was read from them, just before."""
    token = _current.set(version)
    try:
        yield
    finally:
        _current.reset(token)


def value_at_node(system: System, function: Callable[[State], PyTree], state: State) -> PyTree:
    """A function of the state at a node, whose velocities, where it reads them, are those of the momenta there."""
    read = jax.tree.unflatten(jax.tree.structure(state), depends(function, state))
    moving = any(jax.tree.leaves((read.xi, read.nu)))
    return function(at_node(system, state) if moving else state)


@dataclass(frozen=True)
class StepProgram:
    """A method on a system as a kernel's `Program`: pure functions of parameters, state and h."""

    skeleton: System
    method: Method
    observed: tuple[Monitor, ...] = ()
    version: str = ""
    """A digest of the user's functions (`mechanics.identity.version`): programs with different digests differ."""
    events: tuple[Callable[[State], PyTree], ...] = ()
    """Functions of a record whose zeros are located."""
    until: Callable[[State], PyTree] | None = None
    """A function of a state whose change of sign stops a stepper at the node before."""
    direction: Literal["rising", "falling", "both"] = "both"
    """The changes of sign that stop it."""

    @property
    def identity(self) -> str | None:
        """An identifier of the program's behaviour, the same in every process; None if it cannot be determined.

        `version` identifies functions from outside the library as long as they are known to be unchanged since it was
        read from them.
        """
        found = identity(parts(self.skeleton), self.method, self.observed, self.events, self.until, self.direction)
        if found is None or found.library_only:
            return None if found is None else found.digest
        told = self.version == _current.get() and not self.version.endswith(OPAQUE)
        return f"{found.digest} {self.version}" if told else None

    @property
    def stages(self) -> tuple[StepStage, ...]:
        pattern = around(self.skeleton, self.method.pattern)
        return tuple(StepStage(self.skeleton, step, fraction) for step, fraction in pattern)

    @property
    def substeps(self) -> tuple[float, ...]:
        return self.method.substeps

    def linked(self, state: State) -> StepOfLinks | None:
        """The only stage, where code that loops over links can run it (`linked_stage`)."""
        stages = self.stages
        alone = len(stages) == 1 and stages[0].fraction == 1.0
        return linked(self.skeleton, stages[0].step, state) if alone and not self.stops else None

    @property
    def unknowns(self) -> int:
        """m, the number of unknowns z of the stages of a substep."""
        return sum(sum(stage.blocks) for stage in self.stages)

    def prepare_if(self, parameters: Constants, state: State, h: Scalar, first: Scalar) -> State:
        """`prepare` before the first substep of a step of h, where `first` is 1, and the state before the others, where
        it is 0."""
        renewal = jnp.where(first > 0.5, RENEWED if parameters.renewal is None else parameters.renewal, ALL_HELD)
        return self.prepare(replace(parameters, renewal=renewal), state, h)

    def substep(self, parameters: Constants, state: State, h: Scalar, z: Array) -> tuple[Array, State]:
        """(r, x⁺) of a substep of h from a prepared state: the residuals of its stages at their unknowns z, both (m,),
        and the state after it.

        Each stage starts where z brings the one before, so that r(x, z) = 0 and x⁺ determine the substep and its
        derivatives. The remainder of t is left out. h: one number.
        """
        residual, start = [], 0
        for stage in self.stages:
            own = z[start : start + sum(stage.blocks)]
            length = h if stage.fraction == 1.0 else stage.fraction * h
            residual.append(stage.residual(parameters, state, length, own))
            state = stage.advance(parameters, state, length, own, jnp.asarray(1.0))
            state = state.replace(t_rest=jnp.zeros_like(state.t_rest))
            start += len(own)
        return jnp.concatenate(residual), state

    def prepare(self, parameters: Constants, state: State, h: Scalar) -> State:
        """The state with the inputs and the internal state over the step of h, one number.

        A ledger records their change of ℋ; the rule for the internal state reads the new inputs.
        """
        return held(replace_parameters(self.skeleton, parameters.system), state, h, parameters.renewal)

    def monitors(self, parameters: Constants, record: State, h: Scalar) -> Mapping[str, Array]:
        """The values of all monitors at a record, arrays of fixed shapes by name; h: one number."""
        system = replace_parameters(self.skeleton, parameters.system)
        ((step, fraction),) = around(self.skeleton, (self.method.recorded,))
        found: dict[str, Array] = {}
        for monitor in self.observed:
            found.update(monitor(system, step, record, fraction * h, parameters.monitors))
        if self.events:
            values = [value_at_node(system, event, record) for event in self.events]
            found[EVENTS] = jnp.stack([jnp.asarray(value, dtype=float) for value in values])
        return found

    @property
    def stops(self) -> bool:
        return self.until is not None

    def stop(self, parameters: Constants, before: State, after: State) -> Array:
        """1 if `until` changes its sign or reaches zero, else 0, one number; its own value if that is not finite.

        It may start from zero.
        """
        assert self.until is not None
        system = replace_parameters(self.skeleton, parameters.system)
        here, there = (value_at_node(system, self.until, state) for state in (before, after))
        crossed = (here != 0) & (jnp.sign(here) != jnp.sign(there))
        if self.direction != "both":
            crossed &= there > here if self.direction == "rising" else there < here
        return jnp.where(jnp.abs(there) < jnp.inf, jnp.where(crossed, 1.0, 0.0), there)


@dataclass(frozen=True)
class StepStage:
    """A step on a system as a kernel's `Stage`."""

    skeleton: System
    step: Step
    fraction: float

    @property
    def tolerant(self) -> bool:
        return self.step.tolerant

    @property
    def blocks(self) -> tuple[int, ...]:
        return self.step.blocks(self.skeleton)

    @property
    def structure(self) -> Structure:
        return self.step.structure(self.skeleton)

    def carried(self, state: State) -> PyTree:
        """The values that the solution of the last step left in the state, () if none are carried over."""
        return self.step.carried(state)

    def carry(self, after: State, carried: PyTree) -> State:
        """The state with the values that the solution of its step leaves for the next one."""
        return self.step.carry(after, carried)

    def equations(self, parameters: Constants, state: State, h: Scalar) -> Callable[[Array], PyTree]:
        """The function of z that `structure` solves. h: the length of the stage, one number, as below."""
        system = self._system(parameters)
        return lambda z: self.step.evaluated(system, state, h, z)

    def solved(self, state: State, found: PyTree) -> State:
        """The state with the further results of its solution."""
        return self.step.solved(state, found)

    def _system(self, parameters: Constants) -> System:
        return replace_parameters(self.skeleton, parameters.system)

    def guess(self, parameters: Constants, state: State, h: Scalar) -> Array:
        """Where Newton's iteration begins, (unknowns,)."""
        return self.step.guess(self._system(parameters), state, h)

    def residual(self, parameters: Constants, state: State, h: Scalar, z: Array) -> Array:
        """The equations at the unknowns z, both of shape (unknowns,)."""
        return self.step.residual(self._system(parameters), state, h, z)

    def record(self, parameters: Constants, state: State, h: Scalar, z: Array) -> State:
        """The state with the unknowns z (unknowns,) of the stage that starts at it."""
        return self.step.record(self._system(parameters), state, h, z)

    def chart(self, parameters: Constants, state: State, h: Scalar, z: Array) -> Array | float:
        """How far the difference map is used into its chart, one number, with the unknowns z (unknowns,)."""
        return self.step.chart(self._system(parameters), self.record(parameters, state, h, z), h)

    def advance(self, parameters: Constants, state: State, h: Scalar, z: Array, sound: Array) -> State:
        """The next state, of unknowns z (unknowns,); a ledger, if any, records the work of forces in this stage.

        sound: one number, 0 if the equations have no solution.
        """
        system, record = self._system(parameters), self.record(parameters, state, h, z)
        if self.step.tolerant:
            return self.step.advance_if(system, record, h, sound)
        after = stepped(self.step.advance(system, record, h))
        if state.ledger is None:
            return after
        done = self.step.work(system, record, h), self.step.impulse(system, record, h, after)
        return with_tables(system, record, after.replace(ledger=entered(state.ledger, *done)))

    def certificate(
        self, parameters: Constants, before: State, h: Scalar, z: Array, after: State
    ) -> Mapping[str, Array]:
        """The balance of momentum and Newton's residual of the stage, one number each."""
        if self.step.tolerant:
            return {}
        return self.step.certificate(self._system(parameters), self.record(parameters, before, h, z), h, after)
