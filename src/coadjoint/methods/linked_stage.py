"""RATTLE on a chain of joints, in parts of which each link reads its own numbers and those of its neighbours."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.groups import Power
from coadjoint.kernels.newton.coupled import Coupled
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics import inverse_legendre
from coadjoint.mechanics.copies import replace_parameters, replaced
from coadjoint.mechanics.reactions import count, kicked, rate, site
from coadjoint.mechanics.start import legendre
from coadjoint.mechanics.state import Places, State
from coadjoint.mechanics.system import System
from coadjoint.methods.rattle import Rattle, Reactions

RANDOM = 0.1
"""The size of random numbers that are added to a state, relative to 1 plus the number."""


@dataclass(frozen=True)
class RattleOfLinks:
    """The step of `Rattle` as `kernels.program.LinkedStage`: a kick with λ, Φ_h, a kick with λ′.

    The functions are pure, of a run's constants, a state, h and z = (ξ, y, λ) as those of `StepStage`. `shortened` is
    the same step of fewer links, with the user's functions on shorter arrays.
    """

    skeleton: System
    step: Rattle
    structure: Coupled

    @property
    def count(self) -> int:
        """N."""
        return self.structure.count

    @property
    def blocks(self) -> tuple[int, ...]:
        """How many unknowns are of one kind and unit, those of the multipliers last."""
        return self.step.blocks(self.skeleton)

    def shortened(self, count: int) -> RattleOfLinks:
        """The same of a chain of `count` links."""
        given = self.skeleton.group
        assert isinstance(given, Power)
        bound = tuple(replace(one, size=one.size // self.count * count) for one in self.skeleton.constraints)
        skeleton = replaced(self.skeleton, group=Power(given.factor, count, "chain"), constraints=bound)
        how = self.step.structure(skeleton)
        assert isinstance(how, Coupled)
        return RattleOfLinks(skeleton, self.step, how)

    def per_link(self, parameters: PyTree) -> list[bool]:
        """Of which leaves of the constants every link has a row."""
        return [np.shape(leaf)[:1] == (self.count,) for leaf in jax.tree.leaves(parameters)]

    def short(self, parameters: PyTree, count: int) -> PyTree:
        """The constants of `count` links."""
        leaves, structure = jax.tree.flatten(parameters)
        rows = zip(map(np.asarray, leaves), self.per_link(parameters), strict=True)
        return jax.tree.unflatten(structure, [leaf[:count] if own else leaf for leaf, own in rows])

    def short_state(self, state: State, count: int) -> State:
        """A state with the shapes of one of `count` links."""
        (group, Q, V), m = self.shortened(count).skeleton.places, self.blocks[-1] // self.count * count
        moving = {"n": Q.ambient(group), "nu": Q.ambient(group), "pi": Q.ambient(group), "a": V.ambient(group)}
        sizes = {**moving, "mu": group.dim, "xi": group.dim}
        return state.replace(
            g=jax.tree.map(lambda leaf: np.asarray(leaf)[:count], state.g),
            memory=Reactions(np.zeros(m), np.zeros(m), None),
            places=Places(group, Q, V),
            **{name: np.zeros(size) for name, size in sizes.items()},
        )

    def rows(self, state: State) -> tuple[PyTree, PyTree]:
        """The numbers of a state that belong to links, as arrays (N, …), and those that belong to none.

        All leaves of the state are among them; of places in a row of numbers they are the places.
        """
        group, Q, V = self.skeleton.places
        moving = [Q.view(group, x) for x in (state.n, state.nu, state.pi)]
        turning = [group.view(x) for x in (state.mu, state.xi)]
        held = [self._multipliers(x) for x in (state.memory.step, state.memory.end)]
        links = [state.g, moving, V.view(group, state.a), turning, held]
        return links, [state.t, state.t_rest]

    def _multipliers(self, strength: Array) -> list[Array]:
        ends = np.cumsum([0, *(one.size for one in self.skeleton.constraints)])
        parts = [strength[a:b] for a, b in pairwise(ends)]
        return [jnp.reshape(part, (self.count, -1)) if len(part) % self.count == 0 else part for part in parts]

    def _system(self, parameters: PyTree) -> System:
        return replace_parameters(self.skeleton, parameters.system)

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

    def free(self, parameters: PyTree, state: State, h: Scalar, z: Array) -> State:
        """The state after the kick with λ and Φ_h, in the layout of `state`. z: (unknowns,)."""
        system = self._system(parameters)
        record = self.step.record(system, state, h, z)
        return self.step.base.advance(system, self.step.inner(system, record, h), h).replace(memory=record.memory)

    def velocities(self, parameters: PyTree, free: State, impulse: Array) -> State:
        """A state after the kick with `impulse` (m,), and (ξ, ν) of its momenta."""
        system = self._system(parameters)
        after = kicked(system, free, impulse)
        found = inverse_legendre.velocities(system, after)
        return after.replace(xi=found.xi, nu=found.nu)

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
        return after.replace(memory=replace(free.memory, step=end, end=end))

    def certificate(self, parameters: PyTree, record: State, h: Scalar, after: State) -> dict[str, Array]:
        """The balance of momentum and Newton's residual of the step from a record, one number each."""
        return self.step.certificate(self._system(parameters), record, h, after)

    def nearby(self, state: State, random: np.random.Generator) -> State:
        """A random state with links near those of `state`, each at another place."""
        group = self.skeleton.group

        def moved(x: PyTree) -> np.ndarray:
            x = np.asarray(x)
            return x + RANDOM * (1 + np.abs(x)) * random.normal(size=x.shape)

        names = ("n", "a", "mu", "pi", "xi", "nu")
        memory = Reactions(random.normal(size=count(self.skeleton)), random.normal(size=count(self.skeleton)), None)
        eta = RANDOM * random.normal(size=group.dim)
        g = evaluate(lambda g, eta: group.compose(g, group.exp(eta)), state.g, eta)
        return state.replace(g=g, memory=memory, **{name: moved(getattr(state, name)) for name in names})


def linked(skeleton: System, step: object, state: State) -> RattleOfLinks | None:
    """The stage of a step that loops over links can run: RATTLE on a chain on flat spaces that nothing else drives."""
    group, memory = skeleton.group, state.memory
    if not isinstance(step, Rattle) or not isinstance(memory, Reactions) or not isinstance(group, Power):
        return None
    how = step.structure(skeleton)
    if not isinstance(how, Coupled) or group.coupling != "chain":
        return None
    driven = (skeleton.inputs, skeleton.internal, skeleton.hamiltonian, state.internal, state.inputs, state.ledger)
    plain = all(part is None for part in (*driven, memory.base, memory.independent))
    holonomic = all(one.holonomic and one.size % group.count == 0 for one in skeleton.constraints)
    return RattleOfLinks(skeleton, step, how) if plain and holonomic and skeleton.additional.flat else None
