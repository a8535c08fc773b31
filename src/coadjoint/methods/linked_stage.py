"""Steps of a chain, in parts of which each link reads its own numbers and those of its neighbours."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.groups import Power
from coadjoint.kernels.newton.coupled import Coupled
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import inverse_legendre
from coadjoint.mechanics.copies import replace_parameters, replaced
from coadjoint.mechanics.coupling import momenta_of_links_apart
from coadjoint.mechanics.forces import INPUTS, INTERNAL
from coadjoint.mechanics.internal_state import stepped
from coadjoint.mechanics.reactions import kicked, rate, site
from coadjoint.mechanics.start import legendre
from coadjoint.mechanics.state import Places, State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.work_balance import entered, with_jump, with_tables
from coadjoint.methods.link_rows import rows_by_links, shortened
from coadjoint.methods.rattle import Rattle, Reactions
from coadjoint.methods.renewal import held
from coadjoint.methods.step import Step

TURNED = 0.1
"""The most, rad and m, by which links of a random state are moved: the logarithm of a turn near π loses digits."""


@dataclass(frozen=True)
class StepOfLinks:
    """The step of a chain as `kernels.program.LinkedStage`.

    The functions are pure, of a run's constants, a state, h and the unknowns z as those of `StepStage`. `shortened` is
    the same step of fewer links, with the user's functions on shorter arrays.
    """

    skeleton: System
    step: Step
    structure: Coupled
    driving: tuple[bool, ...] = ()
    """Of which leaves of inputs and internal state, as `_driving` lists them, every link has a row."""

    further = (-1, 0, 1)
    """By how many rows more than links an array of constants may differ that belongs to them: one for each element."""

    @property
    def count(self) -> int:
        """N."""
        return self.structure.count

    @property
    def group(self) -> Power:
        """Gᴺ."""
        group = self.skeleton.group
        assert isinstance(group, Power)
        return group

    @property
    def blocks(self) -> tuple[int, ...]:
        """How many unknowns are of one kind and unit, those of multipliers last."""
        return self.step.blocks(self.skeleton)

    def shortened(self, count: int) -> Self:
        """The same of a chain of `count` links."""
        bound = tuple(replace(one, size=one.size // self.count * count) for one in self.skeleton.constraints)
        moved = shortened(self.skeleton.advected, self.count, count)
        group = Power(self.group.factor, count, self.group.coupling)
        skeleton = replaced(self.skeleton, group=group, constraints=bound, advected=moved)
        how = self.step.structure(skeleton)
        assert isinstance(how, Coupled)
        return replace(self, skeleton=skeleton, structure=how)

    def per_link(self, parameters: PyTree) -> list[bool]:
        """Of which leaves of the constants every link has a row."""
        sizes = [(self.count + more,) for more in self.further]
        return [np.shape(leaf)[:1] in sizes for leaf in jax.tree.leaves(parameters)]

    def short(self, parameters: PyTree, count: int) -> PyTree:
        """The constants of `count` links."""
        leaves, structure = jax.tree.flatten(parameters)
        rows = zip(map(np.asarray, leaves), self.per_link(parameters), strict=True)
        less = self.count - count
        return jax.tree.unflatten(structure, [leaf[: len(leaf) - less] if own else leaf for leaf, own in rows])

    def short_state(self, state: State, count: int) -> State:
        """A state with the shapes of one of `count` links."""
        group, Q, V = self.shortened(count).skeleton.places
        moving = {"n": Q.ambient(group), "nu": Q.ambient(group), "pi": Q.ambient(group), "a": V.ambient(group)}
        sizes = {**moving, "mu": group.dim, "xi": group.dim}
        return state.replace(
            g=jax.tree.map(lambda leaf: np.asarray(leaf)[:count], state.g),
            memory=self._memory(count, np.zeros),
            places=Places(group, Q, V),
            **_each_driving(state, lambda leaf, own: np.asarray(leaf)[:count] if own else leaf, self.driving),
            **{name: np.zeros(size) for name, size in sizes.items()},
        )

    def _memory(self, count: int, numbers: Callable[[int], np.ndarray]) -> PyTree:
        """The memory of a state of `count` links, with these numbers."""
        return None

    def _held(self, state: State) -> PyTree:
        """What the memory of a state holds of every link."""
        return []

    def rows(self, state: State) -> tuple[PyTree, PyTree]:
        """The numbers of a state that belong to links, as arrays (N, …), and those that belong to none.

        All leaves of the state are among them; of places in a row of numbers they are the places, NONE where a link has
        no such number.
        """
        group, Q, V = self.group, *self.skeleton.places[1:]
        moving = [Q.view(group, x) for x in (state.n, state.nu, state.pi)]
        turning = [group.view(x) for x in (state.mu, state.xi)]
        links = [state.g, moving, rows_by_links(V, group, state.a), turning, self._held(state)]
        driving = list(zip(jax.tree.leaves(_driving(state)), self.driving, strict=True))
        others = [leaf for leaf, own in driving if not own]
        return [*links, *(leaf for leaf, own in driving if own)], [state.t, state.t_rest, others, state.ledger]

    def _system(self, parameters: PyTree) -> System:
        return replace_parameters(self.skeleton, parameters.system)

    def prepare(self, parameters: PyTree, state: State, h: Scalar) -> State:
        """The state with its inputs and internal state over the step of h, and the ledger that it has."""
        bare = state.replace(ledger=None)
        renewed = held(self._system(parameters), bare, h, parameters.renewal, _with_velocities)
        return renewed.replace(ledger=state.ledger)

    def guess(self, parameters: PyTree, state: State, h: Scalar) -> Array:
        """Where Newton's iteration begins, (unknowns,). h: one number, as below."""
        return self.step.guess(self._system(parameters), state, h)

    def residual(self, parameters: PyTree, state: State, h: Scalar, z: Array) -> Array:
        """The equations at the unknowns z, both (unknowns,)."""
        return self.step.residual(self._system(parameters), state, h, z)

    def chart(self, parameters: PyTree, state: State, h: Scalar, z: Array) -> Scalar:
        """How far the difference map is used into its chart, one number, with the unknowns z (unknowns,)."""
        system = self._system(parameters)
        return jnp.asarray(self.step.chart(system, self.step.record(system, state, h, z), h), dtype=float)

    def record(self, parameters: PyTree, state: State, h: Scalar, z: Array) -> State:
        """The state with the unknowns z (unknowns,) of the step that starts at it."""
        return self.step.record(self._system(parameters), state, h, z)

    def nearby(self, state: State, random: np.random.Generator, size: float, later: float) -> State:
        """A random state with links near those of `state`, each at another place.

        size: of random numbers that are added, relative to 1 plus the number. later: the time that passes, s.
        """

        def moved(x: PyTree) -> np.ndarray:
            x = np.asarray(x)
            return x + size * (1 + np.abs(x)) * random.normal(size=x.shape)

        names = ("n", "mu", "pi", "xi", "nu")
        memory = self._memory(self.count, lambda size: random.normal(size=size))
        eta = min(size, TURNED) * random.normal(size=self.group.dim)
        g, a = evaluate(self._turned, state.g, state.a, eta)
        driving = _each_driving(state, lambda leaf, own: moved(leaf), self.driving)
        changes = {
            **driving,
            "internal_due": state.internal_due,
            "g": g,
            "a": a,
            "memory": memory,
            "t": state.t + later,
        }
        return state.replace(**{name: moved(getattr(state, name)) for name in names}, **changes)

    def _turned(self, g: PyTree, a: Array, eta: Array) -> tuple[PyTree, Array]:
        """(g E, E⁻¹a) of E = exp η."""
        group, there = self.group, self.group.exp(eta)
        return group.compose(g, there), self.skeleton.advected.act(group, group.inverse(there), a)

    def advanced(self, parameters: PyTree, state: State, h: Scalar, z: Array) -> State:
        """The state after the step with the unknowns z (unknowns,)."""
        system = self._system(parameters)
        return stepped(self.step.advance(system, self.step.record(system, state, h, z), h))

    def certificate(self, parameters: PyTree, record: State, h: Scalar, after: State) -> dict[str, Array]:
        """The balance of momentum and Newton's residual of the step from a record, one number each."""
        return self.step.certificate(self._system(parameters), record, h, _before_renewal(record, after))

    def _work(self, system: System, record: State, h: Scalar, after: State) -> Array:
        return self.step.work(system, record, h)

    @staticmethod
    def observing() -> AbstractContextManager[None]:
        """A context for monitors: loops over links refuse an ℓ in which the momenta of a link depend on others."""
        return momenta_of_links_apart()

    def accounted(self, parameters: PyTree, start: State, nodes: State, lengths: Array) -> State:
        """Records of steps of these lengths (steps,) and the node at their end, (steps + 1, …), with the ledger that
        grows along them from a start whose inputs and internal state the first one renews."""
        if start.ledger is None:
            return nodes
        system = self._system(parameters)

        def renewed(before: State, after: State) -> State:
            inputs = with_jump(system, INPUTS, before, before.replace(inputs=after.inputs))
            return with_jump(system, INTERNAL, inputs, after.replace(ledger=inputs.ledger))

        def on(ledger: Array, pair: PyTree) -> tuple[Array, Array]:
            record, after, h = pair
            ended = _before_renewal(record, after)
            done = self._work(system, record, h, ended), self.step.impulse(system, record, h, ended)
            accounted = with_tables(system, record, ended.replace(ledger=entered(ledger, *done)))
            found = renewed(accounted, after).ledger
            return found, found

        first = renewed(start, jax.tree.map(lambda rows: rows[0], nodes).replace(ledger=start.ledger)).ledger
        ahead, behind = (jax.tree.map(lambda rows, s=s: rows[s], nodes) for s in (np.s_[1:], np.s_[:-1]))
        _, later = jax.lax.scan(on, first, (behind, ahead, lengths))
        return nodes.replace(ledger=jnp.concatenate([first[None], later]))


@dataclass(frozen=True)
class RattleOfLinks(StepOfLinks):
    """The step of `Rattle` of a chain: a kick with λ, Φ_h, a kick with λ′; z = (ξ, y, λ)."""

    step: Rattle
    further = (0,)

    def _memory(self, count: int, numbers: Callable[[int], np.ndarray]) -> Reactions:
        m = self.blocks[-1] // self.count * count
        return Reactions(numbers(m), numbers(m), None)

    def _held(self, state: State) -> PyTree:
        ends = np.cumsum([0, *(one.size for one in self.skeleton.constraints)])

        def by_links(strength: Array) -> list[Array]:
            parts = [strength[a:b] for a, b in pairwise(ends)]
            return [jnp.reshape(part, (self.count, -1)) if len(part) % self.count == 0 else part for part in parts]

        return [by_links(x) for x in (state.memory.step, state.memory.end)]

    def _work(self, system: System, record: State, h: Scalar, after: State) -> Array:
        return self.step.work_to(system, record, h, after)

    def free(self, parameters: PyTree, state: State, h: Scalar, z: Array) -> State:
        """The state after the kick with λ and Φ_h, in the layout of `state`. z: (unknowns,)."""
        system = self._system(parameters)
        record = self.step.record(system, state, h, z)
        return self.step.base.advance(system, self.step.inner(system, record, h), h).replace(memory=record.memory)

    def velocities(self, parameters: PyTree, free: State, impulse: Array) -> State:
        """A state after the kick with `impulse` (m,), and (ξ, ν) of its momenta."""
        system = self._system(parameters)
        return _with_velocities(system, kicked(system, free, impulse))

    def momenta(self, parameters: PyTree, state: State, moving: State) -> State:
        """A state with the momenta that the (ξ, ν) of another one have there."""
        s = state
        mu, pi = legendre(self._system(parameters), moving.xi, s.n, moving.nu, s.a, s.t, s.inputs, s.internal)
        return state.replace(mu=mu, pi=pi)

    def rate(self, parameters: PyTree, state: State) -> Array:
        """φ̇ of the (ξ, ν) of a state, (m,)."""
        return rate(self._system(parameters), site(state), state.xi, state.nu)

    def ended(self, parameters: PyTree, free: State, h: Scalar, impulse: Array) -> State:
        """The state after the kick with `impulse` = ½hλ′ (m,)."""
        after, end = kicked(self._system(parameters), free, impulse), 2 * impulse / h
        return stepped(after.replace(memory=replace(free.memory, step=end, end=end)))


def _with_velocities(system: System, state: State) -> State:
    """A state with the velocities of its momenta."""
    found = inverse_legendre.velocities(system, state)
    return state.replace(xi=found.xi, nu=found.nu)


DRIVING = ("inputs", "internal", "internal_mean", "internal_end", "internal_due")


def _driving(state: State) -> list[PyTree]:
    return [getattr(state, name) for name in DRIVING]


def _each_driving(
    state: State, function: Callable[[Array, bool], PyTree], flags: tuple[bool, ...]
) -> dict[str, PyTree]:
    """function(leaf, flag) of what drives a state, by the names of its parts."""
    leaves, structure = jax.tree.flatten(_driving(state))
    found = [function(leaf, own) for leaf, own in zip(leaves, flags, strict=True)]
    return dict(zip(DRIVING, jax.tree.unflatten(structure, found), strict=True))


def _before_renewal(record: State, after: State) -> State:
    """The node at the end of the step from a record, with the inputs and the internal state that the step ends with."""
    held = stepped(record)
    return after.with_course(held.internal, held.internal_mean, held.internal_end, held.internal_due).replace(
        inputs=record.inputs
    )


def linked(skeleton: System, step: Step, state: State) -> StepOfLinks | None:
    """The stage of a step that loops over links can run, on flat spaces: of a chain, or RATTLE on a chain of joints."""
    group, memory, how = skeleton.group, state.memory, step.structure(skeleton)
    if not isinstance(how, Coupled) or not isinstance(group, Power) or group.coupling not in ("chain", ()):
        return None
    if skeleton.hamiltonian is not None or not skeleton.additional.flat:
        return None
    driving = tuple(np.shape(leaf)[:1] == (group.count,) for leaf in jax.tree.leaves(_driving(state)))
    if isinstance(step, Rattle):
        plain = isinstance(memory, Reactions) and memory.base is None and memory.rows is None
        holonomic = all(one.holonomic and one.size % group.count == 0 for one in skeleton.constraints)
        return RattleOfLinks(skeleton, step, how, driving) if plain and holonomic else None
    same = sum(how.sizes) * group.count == sum(step.blocks(skeleton))
    return StepOfLinks(skeleton, step, how, driving) if same and memory is None else None
