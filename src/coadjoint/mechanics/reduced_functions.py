"""Calls of the user's functions ℓ, ℋ and Λ, with the arguments that they take by position and by keyword."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import LagrangianError
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element
from coadjoint.mechanics import legendre
from coadjoint.mechanics.forces import Forces
from coadjoint.mechanics.inputs import Inputs
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.signatures import keyword_only, parameters_of
from coadjoint.mechanics.state import Motion, NodeMotion, Places, State
from coadjoint.spaces import Space, Trivial

TRIVIAL = Trivial(0)
"""The space of additional dynamics, or of advected parameters, of a system that has none."""


class ReducedFunctions:
    """ℓ(ξ, n, ν, a), ℋ(μ, n, π, a) and Λ(ξ or F, n, s, a; h) of a system, its forces, its parameters and its inputs."""

    group: LieGroup
    additional: Space
    advected: Space
    lagrangian: Callable[..., PyTree] | None
    hamiltonian: Callable[..., PyTree] | None
    discrete_lagrangian: Callable[..., PyTree] | None
    group_lagrangian: Callable[..., PyTree] | None
    forces: Forces | None
    internal: Callable[..., PyTree] | None
    name: str
    verify: bool
    parameters: Parameters | None
    inputs: Inputs | None
    constraints: tuple[PyTree, ...]

    @property
    def places(self) -> Places:
        """G, Q and V*."""
        return Places(self.group, self.additional, self.advected)

    @property
    def unknowns(self) -> int:
        """dim G + dim Q, the number of equations of a step."""
        return self.group.dim + self.additional.dim(self.group)

    @property
    def continuous(self) -> bool:
        """Whether the continuous equations are known: by ℓ or by ℋ."""
        return self.lagrangian is not None or self.hamiltonian is not None

    def reduced_lagrangian(
        self,
        xi: Array,
        n: Array,
        nu: Array,
        a: Array,
        t: Scalar = 0.0,
        inputs: PyTree = None,
        internal: PyTree = None,
        near: tuple[Array, Array] | None = None,
    ) -> Array:
        """ℓ(ξ, n, ν, a), one number, with this system's parameters; of a Hamiltonian its Legendre transform (P8).

        xi: (dim G,). n, nu: (ambient,). a: (dim V*,). t: s. inputs, internal: those held over the step. near: (μ, π),
        from which the Legendre transform is solved; by default from zero. Raises LagrangianError for a system without ℓ
        and ℋ.
        """
        if self.hamiltonian is not None:
            place = legendre.Place(self, jnp.concatenate([xi, nu]), n, a, t, inputs, internal)
            return legendre.lagrangian(place, None if near is None else jnp.concatenate(near))
        if self.lagrangian is None:
            raise LagrangianError(
                "This system has a discrete Lagrangian only; use the method co.Variational(difference_map), or "
                "co.methods.GroupVariational(difference_map) where it is in group form."
            )
        arguments = self._views(self.group.view(xi), (n, nu), a)
        return self.lagrangian(*arguments, **self.keywords(self.lagrangian, t, inputs, internal))

    def reduced_hamiltonian(
        self, mu: Array, n: Array, pi: Array, a: Array, t: Scalar = 0.0, inputs: PyTree = None, internal: PyTree = None
    ) -> Array:
        """ℋ(μ, π, n, a), one number, with this system's parameters; raises LagrangianError for a system without ℋ.

        mu: (dim G,). n, pi: (ambient,). a: (dim V*,). t: s. inputs, internal: those held over the step.
        """
        function = self._given("hamiltonian", "Hamiltonian")
        return function(*self._views(self.group.view(mu), (n, pi), a), **self.keywords(function, t, inputs, internal))

    def reduced_discrete_lagrangian(
        self,
        xi: Array,
        n: Array,
        s: Array,
        a: Array,
        h: Scalar,
        t: Scalar = 0.0,
        inputs: PyTree = None,
        internal: PyTree = None,
    ) -> Array:
        """Λ(ξ, n, s, a; h), one number, with this system's parameters; raises LagrangianError for a system without it.

        xi: (dim G,). n, s: (ambient,). a: (dim V*,). h, t: s. inputs, internal: those held over the step.
        """
        function = self._given("discrete_lagrangian", "discrete Lagrangian in algebra form")
        arguments = self._views(self.group.view(xi), (n, s), a)
        return function(*arguments, h, **self.keywords(function, t, inputs, internal))

    def reduced_group_lagrangian(
        self,
        F: Element,
        n: Array,
        s: Array,
        a: Array,
        h: Scalar,
        t: Scalar = 0.0,
        inputs: PyTree = None,
        internal: PyTree = None,
    ) -> Array:
        """Λ(F, n, s, a; h), one number, with this system's parameters; raises LagrangianError for a system without it.

        F: an element of G. n, s: (ambient,). a: (dim V*,). h, t: s. inputs, internal: those held over the step.
        """
        function = self._given("group_lagrangian", "discrete Lagrangian in group form")
        arguments = self._views(F, (n, s), a)
        return function(*arguments, h, **self.keywords(function, t, inputs, internal))

    def _given(self, name: str, what: str) -> Callable[..., Array]:
        """A function of this system; raises LagrangianError where it has none."""
        if (function := getattr(self, name)) is None:
            raise LagrangianError(f"This system has no {what}; pass `{name}` to co.System.")
        return function

    def _views(self, first: PyTree, pair: tuple[Array, Array], a: Array) -> list[PyTree]:
        """xi or F [, n, nu] [, a] [, p]: what this system's functions take."""
        arguments = [first]
        if self.additional != TRIVIAL:
            arguments += [self.additional.view(self.group, x) for x in pair]
        if self.advected != TRIVIAL:
            arguments.append(self.advected.view(self.group, a))
        return arguments if self.parameters is None else [*arguments, self.parameters]

    @property
    def depends_on_time(self) -> bool:
        """Whether ℓ, ℋ or Λ depends on time, by itself or through signals, so that −∂_tℓ changes the energy."""
        return self.takes("t") or (self.inputs is not None and self.takes("inputs"))

    def takes(self, key: str) -> bool:
        """Whether ℓ, ℋ or Λ takes the keyword `t`, `inputs` or `internal`."""
        functions = (self.lagrangian, self.hamiltonian, self.discrete_lagrangian, self.group_lagrangian)
        return any(f is not None and keyword_only(parameters_of(f), key) for f in functions)

    def keywords(self, function: Callable[..., object], t: Scalar, held: PyTree, internal: PyTree) -> dict[str, PyTree]:
        """What a function of this system takes by keyword: `t`, `inputs`, `internal`."""
        known = parameters_of(function)
        values = {"t": lambda: t, "inputs": lambda: self.inputs_at(t, held), "internal": lambda: internal}
        return {key: value() for key, value in values.items() if keyword_only(known, key)}

    def inputs_at(self, t: Scalar, held: PyTree) -> PyTree:
        """The inputs that ℓ and forces read at time t of a step over which `held` is held."""
        return held if self.inputs is None else self.inputs.at(t, held)

    def motion(
        self,
        xi: Array,
        n: Array,
        nu: Array,
        a: Array,
        t: Scalar,
        inputs: PyTree = None,
        internal: PyTree = None,
        momenta: tuple[Array, Array] | None = None,
    ) -> Motion:
        """The motion that forces and inputs read. xi: (dim G,). n, nu: (ambient,). a: (dim V*,).

        momenta: (μ, π) there, (dim G,) and (ambient,); by the Legendre transform of (ξ, ν) if None.
        """
        group, Q = self.group, self.additional

        place, velocity = (Q.view(group, x) for x in (n, nu))
        advected, held = self.advected.view(group, a), self.inputs_at(t, inputs)
        read = partial(self._viewed_momenta, momenta, (xi, n, nu, a, t, inputs, internal))
        return Motion(group.view(xi), place, velocity, advected, t, held, internal, read)

    def _viewed_momenta(self, known: tuple[Array, Array] | None, at: tuple[Any, ...]) -> tuple[PyTree, PyTree]:
        """(μ, π) as a motion shows them; at: the arguments of `momenta`."""
        if known is None and not self.continuous:
            raise LagrangianError(
                "A force or an input reads μ or π, but this system has only a discrete Lagrangian: give co.System "
                "`lagrangian` as well, or write it in ξ and ν."
            )
        mu, pi = self.momenta(*at) if known is None else known
        return self.group.view(mu), self.additional.view(self.group, pi)

    def momenta(
        self,
        xi: Array,
        n: Array,
        nu: Array,
        a: Array,
        t: Scalar,
        inputs: PyTree = None,
        internal: PyTree = None,
        near: tuple[Array, Array] | None = None,
    ) -> tuple[Array, Array]:
        """μ = ∂_ξℓ, (dim G,), and π = ∂_νℓ on T*Q, (ambient,), of a system with ℓ or ℋ; arguments as of `motion`.

        near: (μ, π) from which the Legendre transform of ℋ is solved, as in `reduced_lagrangian`.
        """
        mu, pi = jax.grad(self.reduced_lagrangian, argnums=(0, 2))(xi, n, nu, a, t, inputs, internal, near)
        return mu, self.additional.project(self.group, n, pi)

    def motion_at(self, state: State, inputs: PyTree = None, h: Array | float = 0.0) -> NodeMotion:
        """The motion at a node, of which inputs and internal states over the step of h from there may be functions.

        h: one number, s. A state of the reduced theory, whose g is None, has a motion without g and q: what reads them
        is not reduced.
        """
        s = state
        momenta = None if s.mu is None else (s.mu, s.pi)
        motion = self.motion(s.xi, s.n, s.nu, s.a, s.t, inputs, s.internal, momenta)
        if s.g is None:
            return motion  # pyright: ignore[reportReturnType]
        q = self.additional.view(self.group, self.additional.act(self.group, s.g, s.n))
        ahead = self.inputs_at(s.t + 0.5 * h, inputs)
        return NodeMotion(*motion[:-1], g=s.g, q=q, ahead=ahead, momenta=motion.momenta)

    def body_forces(self, motion: Motion) -> list[tuple[Array, Array]]:
        """(T, f) of every force of `forces`, in their order, (dim G,) and (ambient,) each."""
        if self.forces is None:
            return []
        arguments = (motion,) if self.parameters is None else (motion, self.parameters)
        return self.forces.each(self.places, *arguments)

    def body_force(self, motion: Motion) -> tuple[Array, Array]:
        """(T, f), (dim G,) and (ambient,): the sum of all forces; zero where the system has none."""
        return added(self, self.body_forces(motion))


def added(system: ReducedFunctions, forces: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    """The sum of forces (T, f), (dim G,) and (ambient,); zero of none."""
    if not forces:
        return jnp.zeros(system.group.dim), jnp.zeros(system.additional.ambient(system.group))
    torque, force = forces[0]
    for more in forces[1:]:
        torque, force = torque + more[0], force + more[1]
    return torque, force
