"""States of actuators at the start of each segment, and their derivatives by the estimated parameters.

A state that only the inputs drive, such as an actuator with a lag or a rate, is known over the complete log: its rule

    x_{k+1} = Φ(x_k, u_k, h_k; p),  ∂x_{k+1}/∂p = ∂Φ/∂x ∂x_k/∂p + ∂Φ/∂p,  x_0 given,  ∂x_0/∂p = 0,

is integrated from the first sample with its derivatives, and a segment begins with x and ∂x/∂p at its time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.identification.sampling import StepsBetween
from coadjoint.kernels.packing import flattened, layout, rows
from coadjoint.kernels.run.function import NativeRecursion
from coadjoint.kernels.trace.jaxprs import used_by_each
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.internal_state import applied
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System

T = TypeVar("T")

KEPT = 16
"""The numbers of recursions and of dependences kept in memory."""

_recursions: dict[Any, NativeRecursion] = {}
_dependences: dict[Any, list[tuple[list[bool], list[bool], bool]]] = {}


class ActuatorsAtStarts(NamedTuple):
    """x at the start of each segment, (segments, n), and ∂x/∂p by the active parameters, (segments, n, active)."""

    values: np.ndarray
    slopes: np.ndarray


@dataclass(frozen=True)
class Actuators:
    """The leaves of the internal state that no motion moves, over all segments.

    `key`: the dependences of the code of the rule. `template`: a state. `active`: the parameters that change, by their
    places among the numbers of all. `held`: the internal states of the segments, as far as the log holds them, and
    `logged`: for each of their leaves whether a segment after a gap begins with it.
    """

    key: Any
    system: System
    template: State
    active: tuple[int, ...]
    steps: StepsBetween
    held: PyTree
    logged: tuple[bool, ...]
    after_gap: np.ndarray

    @cached_property
    def _uses(self) -> list[tuple[list[bool], list[bool], bool]]:
        """The dependences of each leaf after a step: leaves before it, parameters, and whether on the motion."""
        return _kept(_dependences, self.key, self._dependence)

    def _dependence(self) -> list[tuple[list[bool], list[bool], bool]]:
        end = jax.tree.leaves(self.template.internal), jax.tree.leaves(self.system.parameters)
        rest = self.template.replace(internal=None, inputs=None, t=None)

        def after(internal, p, inputs, t, h, rest):
            state = rest.replace(internal=internal, inputs=inputs, t=t)
            return applied(replace_parameters(self.system, p), state, h).end

        one = np.float64(1.0)
        arguments = self.template.internal, self.system.parameters, self.template.inputs, one, one, rest
        ends = np.cumsum([len(leaves) for leaves in end])
        motion = ends[1] + len(jax.tree.leaves(arguments[2:5]))
        found = used_by_each(after, *arguments)
        return [(uses[: ends[0]], uses[ends[0] : ends[1]], any(uses[motion:])) for uses in found]

    @cached_property
    def leaves(self) -> tuple[int, ...]:
        """The leaves of the internal state that depend on themselves, the inputs and the time alone."""
        alone = {i for i, (_, _, moved) in enumerate(self._uses) if not moved}
        while led := {i for i in alone if any(k not in alone for k, used in enumerate(self._uses[i][0]) if used)}:
            alone -= led
        return tuple(sorted(alone))

    @cached_property
    def places(self) -> np.ndarray:
        """The places of their numbers among those of the internal state."""
        return _places(self.template.internal, self.leaves)

    @cached_property
    def moving(self) -> tuple[int, ...]:
        """The active parameters that they depend on."""
        used = [k for k in range(len(jax.tree.leaves(self.system.parameters)))
                if any(self._uses[i][1][k] for i in self.leaves)]  # fmt: skip
        return tuple(sorted(set(self.active) & set(_places(self.system.parameters, used).tolist())))

    @cached_property
    def _recursion(self) -> NativeRecursion:
        def made() -> NativeRecursion:
            x, inputs = np.zeros(len(self.places) * (1 + len(self.moving))), np.zeros(2 + self.steps.inputs.shape[1])
            return NativeRecursion(self._step, x, inputs, np.zeros(layout(self.system.parameters).size))

        return _kept(_recursions, (self.key, self.moving, self.leaves), made)

    def _step(self, carried: PyTree, row: PyTree, numbers: PyTree) -> PyTree:
        """(x, ∂x/∂p), one parameter after the other, a step later; row: t, h, and the inputs."""
        n, m = len(self.places), len(self.moving)
        x, by = carried[:n], carried[n:].reshape(m, n)
        inputs = layout(self.template.inputs).views(row[2:])
        shape = layout(self.template.internal)
        begun = flattened(self.template.internal)

        def after(x: Array, moving: PyTree) -> PyTree:
            p = numbers
            internal = begun
            for k, place in enumerate(self.moving):
                p = p.at[place].set(moving[k])
            for k, place in enumerate(self.places.tolist()):
                internal = internal.at[place].set(x[k])
            here = replace_parameters(self.system, layout(self.system.parameters).views(p))
            state = self.template.replace(t=row[0], inputs=inputs, internal=shape.views(internal))
            end = jax.tree.leaves(applied(here, state, row[1]).end)
            return flattened([end[i] for i in self.leaves])

        moving = jnp.stack([numbers[place] for place in self.moving]) if m else jnp.zeros(0)
        found = [after(x, moving)]
        for k in range(m):
            along = by[k], jnp.asarray(np.eye(m)[k])
            found.append(jax.jvp(after, (x, moving), along)[1])
        return jnp.concatenate(found)

    def at_starts(self, numbers: np.ndarray) -> ActuatorsAtStarts:
        """Their states with these numbers of all parameters."""
        n, m, runs = len(self.places), len(self.moving), len(self.steps.begins)
        begun = rows(self.held)[:, self.places]
        logged = np.isin(self.places, _places(self.template.internal, np.flatnonzero(self.logged)))
        found = np.zeros((runs, n * (1 + m)))
        found[0, :n] = begun[0]
        carried, first = found[0].copy(), 0
        driven = np.column_stack([self.steps.times, self.steps.lengths, self.steps.inputs])
        for again in [*np.flatnonzero(self.after_gap), runs - 1]:
            to = self.steps.begins[first : again + 1]
            path = self._recursion(carried, driven[to[0] : to[-1]], numbers)
            found[first + 1 : again + 1] = path[to[1:] - to[0]]
            if self.after_gap[again]:
                found[again].reshape(1 + m, n)[:, logged] = 0.0
                found[again, :n][logged] = begun[again][logged]
            carried, first = found[again].copy(), again
        slopes = np.zeros((runs, n, len(self.active)))
        slopes[:, :, [self.active.index(place) for place in self.moving]] = (
            found[:, n:].reshape(runs, m, n).swapaxes(1, 2)
        )
        return ActuatorsAtStarts(found[:, :n], slopes)


def _places(tree: PyTree, leaves: Iterable[int]) -> np.ndarray:
    """The places of the numbers of some leaves among those of all."""
    ends = np.cumsum([0, *(np.size(leaf) for leaf in jax.tree.leaves(tree))]).tolist()
    return np.array([place for i in leaves for place in range(ends[i], ends[i + 1])], int)


def _kept(known: dict[Any, T], key: object, make: Callable[[], T]) -> T:
    """The cached value of a key, made if missing; beyond KEPT entries the oldest is dropped."""
    if key not in known:
        known[key] = make()
        while len(known) > KEPT:
            known.pop(next(iter(known)))
    return known[key]
