"""The state of a system at a node, and the parts of it that the user's functions read."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import jax
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.groups import LieGroup
from coadjoint.groups.group import Element
from coadjoint.kernels.trace.evaluate import Mapped, evaluate
from coadjoint.mechanics.members import Each
from coadjoint.overview import NumberRow, Overview, WithOverview, value_text
from coadjoint.spaces import Space


class Places(NamedTuple):
    """Where a system lives: G, Q and V*."""

    group: LieGroup
    additional: Space
    advected: Space


class Origin:
    """The system whose run a record is of, None of other states; any two count as equal, so that states go together.

    unknowns: (ξ, ν), (dim G,) and (ambient,), of the step that starts at a record whose own ξ and ν are those of the
    node: Newton's next guess.
    """

    __slots__ = ("system", "unknowns")

    def __init__(self, system: Any = None, unknowns: tuple[Array, Array] | None = None):
        self.system, self.unknowns = system, unknowns

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Origin)

    def __hash__(self) -> int:
        return hash(Origin)

    def __repr__(self) -> str:
        return f"Origin({'' if self.system is None else self.system.name})"


@jax.tree_util.register_dataclass
@dataclass(frozen=True, repr=False)
class State(WithOverview):
    """t, g, n = g⁻¹q, a = g⁻¹a₀, μ, π and (ξ, ν) at a node; made by `system.state(…)`.

    t: s. g: an element of G. n, nu, pi: ambient coordinates of Q, (ambient,). a: those of V*. mu, xi: (dim G,). Records
    have a leading axis of nodes in every leaf. `q`, `qdot` and `named` are derived.

    ξ and ν are those of the momenta, ∂_ξℓ = μ and ∂_νℓ = π, in every state that a run, a trajectory or a stepper gives.
    In `records` they are the unknowns of the step that starts at the node. A run that continues from a state begins
    Newton's iteration with the last unknowns, which `origin` keeps.
    inputs: held over the step. internal: the state and memory of actuators, filters and noise at t. memory: that of the
    method.
    internal_mean, internal_end: of a record, the mean of `internal` over the step that starts at it, which forces and ℓ
    read, and its value at the end. internal_due: 1 where the system's rule is still to be applied at t, as in a start
    and after a step, 0 in a record. All are None where there is no rule.
    ledger: energy and momentum from forces since the start (`mechanics.work_balance`); None without monitors.
    t_rest: the rounding error of t (Kahan's summation), so that the error of t does not grow with the steps.
    places: G, Q and V*.
    from_velocities: whether this is a start given by its velocities. The run that starts there takes μ, π from (ξ, ν)
    with its own parameters; a record continues with its own momenta.
    origin: the system whose run a record is of.
    """

    t: Array
    g: Element
    n: Array
    a: Array
    mu: Array
    pi: Array
    xi: Array
    nu: Array
    inputs: PyTree = None
    internal: PyTree = None
    memory: PyTree = None
    internal_mean: PyTree = None
    internal_end: PyTree = None
    internal_due: Any = None
    ledger: Any = None
    t_rest: Scalar = 0.0
    places: Places = field(metadata={"static": True}, kw_only=True)
    from_velocities: bool = field(metadata={"static": True}, kw_only=True, default=False)
    origin: Origin = field(metadata={"static": True}, kw_only=True, default=Origin(), repr=False)

    def _overview(self) -> Overview:
        many = np.shape(self.t)
        title = f"{'States, ' + ' × '.join(map(str, many)) + ',' if many else 'State'} on {self.places.group!r}"
        origin = self.origin.system
        shown = {name: getattr(self, name) for name in ("g", "n", "a", "mu", "pi", "xi", "nu")}
        numbers = {name: value for name, value in shown.items() if value is not None and _full(value)}
        facts = {"t": f"{value_text(self.t)} s", "of": "" if origin is None else origin.name}
        return Overview(title, facts, tuple(NumberRow(*item) for item in numbers.items()), "part")

    def replace(self, **changes: object) -> State:
        """A copy with some fields replaced; another internal state is held over the step of a record."""
        for name, value in changes.items():
            if isinstance(value, Each):
                raise ArgumentError(
                    f"Argument `{name}` must be of one member: give co.each to system.state(…) instead."
                )
        if "internal" in changes and self.internal_mean is not None:
            changes = {"internal_mean": changes["internal"], "internal_end": changes["internal"], **changes}
        return replace(self, **changes)

    def __getstate__(self) -> dict[str, object]:
        return vars(replace(self))

    def with_course(self, internal: PyTree, mean: PyTree, end: PyTree, due: PyTree) -> State:
        """A copy with another internal state at t, over the step and at its end, and whether its rule is due."""
        return replace(self, internal=internal, internal_mean=mean, internal_end=end, internal_due=due)

    def holding(self, internal: PyTree) -> State:
        """A copy that has this internal state, unchanged, at t and over the step."""
        return self.with_course(internal, None, None, None)

    @property
    def at_place(self) -> State:
        """The part that ℓ and ℋ read at the node itself, with momenta and velocities: a copy without g and the rest."""
        alone = {"g": None, "memory": None, "ledger": None, "t_rest": None, "from_velocities": False}
        return replace(self.holding(self.internal), **alone, origin=Origin())

    @property
    def over_step(self) -> PyTree:
        """The internal state that forces, ℓ, ℋ and Λ read over the step from here."""
        return self.internal if self.internal_mean is None else self.internal_mean

    def __getattr__(self, name: str) -> Any:
        if name in ("xi", "nu") and "_read" in vars(self):
            vars(self).update(zip(("xi", "nu"), vars(self)["_read"][1](), strict=True))
            return vars(self)[name]
        if name in ("q", "qdot", "named"):
            # Python calls this where the property itself raised an AttributeError: raise that one.
            return getattr(type(self), name).fget(self)
        there = "t", "g", "q", "qdot", "n", "nu", "xi", "a", "mu", "pi", "inputs", "internal", "named"
        raise _lacking("A state", name, there)

    def later(self, h: Scalar, **changes: object) -> State:
        """A copy at t + h with some fields replaced. h: one number, s."""
        step = h + self.t_rest
        t = self.t + step
        return replace(self, t=t, t_rest=step - (t - self.t), **changes)

    def each(self, function: Callable[[State], object]) -> PyTree:
        """function of a single state, mapped over the leading axes of records; NumPy unless traced."""
        for _ in range(np.ndim(self.t)):
            function = Mapped(function)
        return evaluate(function, self)

    @property
    def q(self) -> Array:
        """The additional configuration q = g·n in the space frame, (ambient,), with the leading axes of the state."""
        return self.each(lambda s: s.places.additional.act(s.places.group, s.g, s.n))

    @property
    def qdot(self) -> Array:
        """The velocity q̇ = g·ν in the space frame, (ambient,), with the leading axes of the state."""
        return self.each(lambda s: s.places.additional.push(s.places.group, s.g, s.n, s.nu))

    @property
    def named(self) -> Parts:
        """n, ν, π, a, q, q̇ as ℓ reads them: `state.named.a.down` where the system has advected=dict(down=…)."""

        def parts(s: State) -> Parts:
            group, Q, V = s.places
            n, nu, pi, q, qdot = (Q.view(group, x) for x in (s.n, s.nu, s.pi, s.q, s.qdot))
            return Parts(n, nu, pi, V.view(group, s.a), q, qdot)

        return self.each(parts)


def with_velocities(state: State, velocities: Callable[[], tuple[Array, Array]]) -> State:
    """A copy with the (ξ, ν) that `velocities` gives when they are read first; `of_step` of it is this state."""
    made = replace(state, origin=Origin(state.origin.system, (state.xi, state.nu)))
    vars(made).update(_read=(state, velocities))
    del vars(made)["xi"], vars(made)["nu"]
    return made


def of_step(state: State) -> State | None:
    """The state of which `with_velocities` made this one, with the unknowns of a step as ξ and ν; else None."""
    return vars(state)["_read"][0] if "_read" in vars(state) else None


def _full(value: PyTree) -> bool:
    """Whether an array has numbers; True of other values, such as elements of products of groups."""
    return 0 not in np.shape(value) if hasattr(value, "shape") else True


class Parts(NamedTuple):
    """Points, velocities, momenta and advected parameters by the names that a dictionary of spaces gave them."""

    n: PyTree
    nu: PyTree
    pi: PyTree
    a: PyTree
    q: PyTree
    qdot: PyTree


class Motion(NamedTuple):
    """The motion that forces and inputs may depend on, in the body frame.

    xi: ξ = g⁻¹ġ, (dim G,). n, nu: g⁻¹q and ν = g⁻¹q̇, (ambient,), or by the names of the spaces, `motion.n.name`.
    a: advected parameters, as n. t: s. inputs: those of the run, `motion.inputs.name`. internal: the mean of the
    internal state over the step. mu, pi: the momenta μ = ∂_ξℓ, (dim G,), and π = ∂_νℓ, as n, at the same place; from a
    singular ℋ those of the step. momenta: () ↦ (μ, π), which gives both. Units are those of the Lagrangian.
    """

    xi: Array
    n: PyTree
    nu: PyTree
    a: PyTree
    t: Scalar
    inputs: PyTree
    internal: PyTree
    momenta: Callable[[], tuple[PyTree, PyTree]] | None = None
    """() ↦ (μ, π), for `mu` and `pi`, which few forces read."""

    @property
    def mu(self) -> PyTree:
        return _momenta_of(self)[0]

    @property
    def pi(self) -> PyTree:
        return _momenta_of(self)[1]

    def __getattr__(self, name: str) -> Any:
        raise _lacking("The motion that forces read", name, (*self._fields[:-1], "mu", "pi"))


class NodeMotion(NamedTuple):
    """The motion at the node where a step starts, for functions that are evaluated once a step: `Motion`, g and q.

        def rule(motion: co.mechanics.NodeMotion, h, p):  # advances an internal state, once a step

    xi, n, nu, a, t, inputs, momenta, mu, pi: as in `Motion`, at the node; ξ and ν are those of (μ, π), where ℓ or ℋ is
    given. internal: the internal state at the node. g: as in `State`. q: q = g·n in the space frame, (ambient,), or by
    names as n. ahead: the inputs in the middle of the step that starts there, which an actuator follows over it. Forces
    act within steps and have the body frame only.
    """

    xi: Array
    n: PyTree
    nu: PyTree
    a: PyTree
    t: Scalar
    inputs: PyTree
    internal: PyTree
    g: PyTree
    q: PyTree
    ahead: Any = None
    momenta: Callable[[], tuple[PyTree, PyTree]] | None = None

    mu, pi = Motion.mu, Motion.pi

    def __getattr__(self, name: str) -> Any:
        raise _lacking("The motion", name, (*self._fields[:-1], "mu", "pi"))


def _momenta_of(motion: Motion | NodeMotion) -> tuple[PyTree, PyTree]:
    if motion.momenta is None:
        raise LagrangianError("This motion has velocities alone: what it is for has no momenta μ and π.")
    return motion.momenta()


def _lacking(what: str, name: str, there: Iterable[str]) -> AttributeError:
    """The error for a missing attribute, with those that exist."""
    if name.startswith("__"):
        return AttributeError(name)
    return AttributeError(f"{what} has no `{name}`: it has {', '.join(there)}.")


class Force(NamedTuple):
    """A torque T ∈ 𝔤* and a force f ∈ T*Q in the body frame: virtual work ⟨T, g⁻¹δg⟩ + ⟨f, g⁻¹δq⟩.

        forces=lambda motion, p: co.Force(torque=-p.damping * motion.xi)

    torque: (dim G,). force: (ambient,), or a dictionary by the names of the spaces. Each is by default None, zero.
    """

    torque: Any = None
    force: Any = None
