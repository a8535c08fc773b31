"""Discrete Lagrangians on G × Q before reduction, and the discrete Euler–Lagrange equations (P36), (B7), (B8)."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass
from typing import NamedTuple, Self

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError, LagrangianError, must_give
from coadjoint.groups.derivative import left_derivative
from coadjoint.groups.group import Element, LieGroup
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.signatures import keyword_only, require_signature
from coadjoint.mechanics.state import Places
from coadjoint.mechanics.system import System
from coadjoint.spaces import Space, Trivial
from coadjoint.theory.algorithm import Algorithm
from coadjoint.theory.euler_poincare import Link, impulse, instant_after
from coadjoint.theory.instant import ALWAYS, Instant, given, require_instants

KEYWORDS = ("t", "inputs", "internal")
"""What Lagrangians may take by keyword."""


class Configuration(NamedTuple):
    """(g, q): an element and a point of Q in the space frame, (0,) where there is no Q; or sequences of these."""

    g: Element
    q: Array


def has_points(space: Space) -> bool:
    """Whether the system has this space at all."""
    return bool(space != Trivial(0))


class LagrangianInSpace:
    """A Lagrangian in the space frame, before reduction: a function, and the system of its value at g = e.

    group: G. function: see the subclass. additional, advected, parameters, forces, internal: as those of co.System.
    """

    _kind: str
    """The argument of co.System that the reduced function is."""
    _what: str
    """What the function is, in words."""
    _last: tuple[str, ...] = ()
    """What the function takes after the parameters."""

    def __init__(
        self,
        group: LieGroup,
        function: Callable[..., PyTree],
        *,
        additional: Space | Mapping[str, Space] | None = None,
        advected: Space | Mapping[str, Space] | None = None,
        parameters: Parameters | Mapping[str, PyTree] | None = None,
        forces: PyTree = None,
        internal: Callable[..., PyTree] | None = None,
    ):
        self.function = function
        reduced: dict[str, PyTree] = {self._kind: WithKeywords(self._at_identity, keywords_of(function))}
        self.reduced = System(
            group,
            **reduced,
            additional=additional,
            advected=advected,
            parameters=parameters,
            forces=forces,
            internal=internal,
            name=getattr(function, "__name__", "system"),
        )
        rest = ["a0"] if has_points(self.places.advected) else []
        rest += [] if self.reduced.parameters is None else ["p"]
        taken = self._taken(has_points(self.places.additional))
        require_signature(function, self._what, [*taken, *rest, *self._last])

    @classmethod
    def of(cls, system: System, function: Callable[..., object]) -> Self:
        """With the spaces, parameters, forces, inputs and internal state of a system, and what its functions take."""
        _, Q, V = system.places
        return cls(
            system.group,
            WithKeywords(function, tuple(filter(system.takes, KEYWORDS))),
            additional=Q if has_points(Q) else None,
            advected=V if has_points(V) else None,
            parameters=system.parameters,
            forces=system.forces,
            internal=system.internal,
        ).driven(system.inputs)

    def _at_identity(self, *arguments: PyTree, **keywords: PyTree) -> Array:
        """The reduced function."""
        must_give(self, "_at_identity")

    def _taken(self, dynamic: bool) -> list[str]:
        """What the function takes first, with additional dynamics or without."""
        must_give(self, "_taken")

    def driven(self, inputs: PyTree) -> Self:
        """A copy driven by the `inputs` of a run, as co.simulate takes them."""
        made = copy(self)
        made.reduced = self.reduced.driven(inputs)
        return made

    @property
    def places(self) -> Places:
        """G, Q and V*."""
        return self.reduced.places

    def _value(self, places: list[PyTree], a0: Array, at: Instant, *last: Scalar) -> Array:
        """The function of places, velocities or both, of a₀ and of the parameters, at an instant."""
        group, _, V = self.places
        require_parameter(self.places, a0)
        rest = [V.view(group, a0)] if has_points(V) else []
        rest += [] if self.reduced.parameters is None else [self.reduced.parameters]
        return self.function(*places, *rest, *last, **self.reduced.keywords(self.function, *given(self.reduced, at)))


class UnreducedLagrangian(LagrangianInSpace):
    """L(g_k, q_k, g_{k+1}, q_{k+1}, a₀; h) on (G × Q)² × V* (P36); on S × S with S = G Ⓢ V it is (B7), Q = V.

    `function` takes g [, q], g_next [, q_next] [, a0] [, p], h in this order and returns a number: q with
    `additional`, a0 with `advected`, p with `parameters`; it may take keyword-only `t`, `inputs` and `internal`.
    `forces`, `internal`: as those of co.System, functions of the body's motion. Raises LagrangianError for other
    arguments.
    """

    _kind, _what, _last = "group_lagrangian", "The unreduced discrete Lagrangian", ("h",)

    def _taken(self, dynamic: bool) -> list[str]:
        return ["g", "q", "g_next", "q_next"] if dynamic else ["g", "g_next"]

    def __call__(
        self, first: Configuration, second: Configuration, a0: Array, h: Scalar, at: Instant = ALWAYS
    ) -> Array:
        """L at two configurations, one number, of a step of length h that starts at an instant. a0: (dim V*,)."""
        group, Q, _ = self.places
        pair = [[c.g, Q.view(group, c.q)] if has_points(Q) else [c.g] for c in (first, second)]
        return self._value([*pair[0], *pair[1]], a0, at, h)

    def _at_identity(self, F: Element, *rest: PyTree, **keywords: PyTree) -> Array:
        """Λ(F, n, s, a; h) = L(e, n, F, s, a; h) (P37)."""
        e = self.places.group.identity()
        if not has_points(self.places.additional):
            return self.function(e, F, *rest, **keywords)
        n, s, *others = rest
        return self.function(e, n, F, s, *others, **keywords)


def keywords_of(function: PyTree) -> tuple[str, ...]:
    """Which of t, inputs and internal a function takes by keyword; raises LagrangianError unless it is a function."""
    checks.function(function, "The unreduced discrete Lagrangian", "a Python function", error=LagrangianError)
    known = inspect.signature(function).parameters
    return tuple(key for key in KEYWORDS if keyword_only(known, key))


@dataclass(frozen=True)
class WithKeywords:
    """A function of any positional arguments that takes these keywords, and says so to who asks for its signature."""

    function: Callable[..., PyTree]
    keywords: tuple[str, ...]

    def __call__(self, *arguments: PyTree, **given: PyTree) -> PyTree:
        return self.function(*arguments, **given)

    @property
    def __signature__(self) -> inspect.Signature:
        rest = inspect.Parameter("rest", inspect.Parameter.VAR_POSITIONAL)
        named = [inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY) for key in self.keywords]
        return inspect.Signature([rest, *named])


def configuration(L: UnreducedLagrangian, g: Element, q: object = None) -> Configuration:
    """(g, q) with q (dim,), or by names on several spaces; without Q leave q out."""
    group, Q, _ = L.places
    if q is None:
        if has_points(Q):
            raise LagrangianError("This discrete Lagrangian has additional dynamics: give `q`.")
        return Configuration(g, np.zeros(0))
    return Configuration(g, Q.point(group, q, "q"))


def parameter_of(places: Places, a0: PyTree) -> Array:
    """a₀ as an array (dim V*,), (0,) without advected parameters; raises ArgumentError where it is missing."""
    require_parameter(places, a0)
    return np.zeros(0) if a0 is None else places.advected.point(places.group, a0, "a0")


def require_parameter(places: Places, a0: PyTree) -> None:
    """Raise ArgumentError where a₀ is missing."""
    if a0 is None and has_points(places.advected):
        raise ArgumentError("This system has advected parameters: give `a0`, in the space frame.")


def link_of(places: Places, first: Configuration, second: Configuration, a0: Array, at: Instant = ALWAYS) -> Link:
    """F = g⁻¹g⁺, n = g⁻¹q, s = g⁻¹q⁺, a = g⁻¹a₀ of two configurations (P38), (P39); traceable by JAX.

    a0: (dim V*,), (0,) where there are no advected parameters.
    """
    group, Q, V = places
    back = group.inverse(first.g)
    n, s, a = Q.act(group, back, first.q), Q.act(group, back, second.q), V.act(group, back, a0)
    return Link(group.compose(back, second.g), n, s, a, at)


def action(L: UnreducedLagrangian, path: Configuration, a0: Array, h: Scalar, at: Instant = ALWAYS) -> Array:
    """A = Σ L(g_k, q_k, g_{k+1}, q_{k+1}, a₀; h) of a sequence, one number (B7); traceable by JAX.

    a0: (dim V*,). h: s. at: the instants of the steps, with a leading axis, where L depends on them.
    """
    first, second = (jax.tree.map(lambda leaf, cut=cut: leaf[cut], path) for cut in (slice(None, -1), slice(1, None)))
    require_instants(at, len(path.q) - 1)
    return jnp.sum(jax.vmap(lambda x, y, at: L(x, y, a0, h, at))(first, second, at))


def discrete_euler_lagrange(
    L: UnreducedLagrangian,
    before: Configuration,
    here: Configuration,
    after: Configuration,
    a0: Array,
    h: Scalar,
    at: tuple[Instant, Instant] = (ALWAYS, ALWAYS),
    work: tuple[Array, Array] | None = None,
) -> tuple[Array, Array]:
    """(D₃L_{k−1} + D₁L_k + T⁻_k, D₄L_{k−1} + D₂L_k + g_k·φ⁻_k) (B8), zero where Lagrange–d'Alembert's principle holds.

    The first is left-trivialised, ⟨·, η⟩ for δg_k = g_kη, shape (dim,); the second a covector at q_k, projected onto
    T*Q. `at`: the instants of steps k − 1 and k. `work`: (T⁻, φ⁻) of step k, by default (hT, hf) of the forces of L.
    Traceable by JAX.
    """
    group, Q, _ = L.places

    def two(g: Element, q: Array):
        middle = Configuration(g, q)
        return L(before, middle, a0, h, at[0]) + L(middle, after, a0, h, at[1])

    torque, force = work or impulse(L.reduced, link_of(L.places, here, after, a0, at[1]), h)
    on_group = left_derivative(group, lambda g: two(g, here.q), here.g) + torque
    on_space = jax.grad(two, argnums=1)(here.g, here.q) + Q.pull(group, group.inverse(here.g), here.q, force)
    return on_group, Q.project(group, here.q, on_space)


@dataclass(frozen=True)
class DiscreteEulerLagrange(Algorithm):
    """The algorithm ((g_{k−1}, q_{k−1}), (g_k, q_k)) ↦ ((g_k, q_k), (g_{k+1}, q_{k+1})) (B16) at fixed a₀."""

    L: UnreducedLagrangian

    @property
    def group(self) -> LieGroup:  # type: ignore[override]
        return self.L.places.group

    @property
    def space(self) -> Space:  # type: ignore[override]
        return self.L.places.additional

    def last(self, pair, h: Scalar):
        before, here, *_ = pair
        Q, group = self.space, self.group
        velocity = Q.tangent(group, here.q, Q.coordinates(group, here.q, (here.q - before.q) / h))
        return group.compose(group.inverse(before.g), here.g), here.q, velocity

    def conditions(self, pair, h: Scalar, F: Element, s: Array):
        before, here, a0, at = pair
        here, after, _, now = self.following(pair, h, F, s)
        return discrete_euler_lagrange(self.L, before, here, after, a0, h, (at, now))

    def following(self, pair, h: Scalar, F: Element, s: Array):
        before, here, a0, at = pair
        now = instant_after(self.L.reduced, link_of(self.L.places, before, here, a0, at), h)
        return here, Configuration(self.group.compose(here.g, F), s), a0, now


def discrete_euler_lagrange_algorithm(
    L: UnreducedLagrangian,
    first: Configuration,
    second: Configuration,
    a0: PyTree,
    h: Scalar,
    steps: int,
    at: Instant = ALWAYS,
) -> Configuration:
    """The sequence of `steps` + 1 configurations that starts with two and solves (B8) at every inner node.

    `a0` (dim V*,) or None without advected parameters. `at`: the instant of the first step, for an L with time, forces,
    inputs or an internal state. Raises StepError where Newton does not solve a step, ArgumentError where `at` lacks.
    """
    a0 = parameter_of(L.places, a0)
    before, here, *_ = DiscreteEulerLagrange(L).run((first, second, a0, at), h, checks.whole(steps, "steps") - 1)
    return jax.tree.map(lambda rows, ends: np.concatenate([rows[:1], ends]), before, here)
