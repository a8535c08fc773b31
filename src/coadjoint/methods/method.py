"""The contract of a method, and how it begins."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import reduce
from typing import Literal, NamedTuple

import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.difference_maps import Cayley, DifferenceMap
from coadjoint.errors import ArgumentError, shown
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.coupling import jacobian_solve
from coadjoint.mechanics.internal_state import advanced
from coadjoint.mechanics.start import momentum_start
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.rattle import around, kept
from coadjoint.methods.step import Step

Start = Literal["momentum", "velocity"]
Energy = Literal["bounded", "exact", "quadratic", "discrete", "changed"]


class Claims(NamedTuple):
    """The claims of a method for every smooth system; `coadjoint audit` measures each claim.

    order: that of convergence, also with forces; `order_with_internal`, at most 2, is that with actuators and sampled
    controllers. symmetric: step(−h) undoes step(h). The other claims concern unforced motion. symplectic: the two-form
    is kept. momentum: m of every isotropy direction is kept to round-off. energy: "bounded" for an error without drift,
    "exact" for Legendre's to round-off, "quadratic" for the same if ℋ is quadratic and else no claim,
    "discrete" for −∂_hΛ to round-off, "changed" if the method itself damps or drives.
    """

    order: int
    symmetric: bool
    symplectic: bool = True
    momentum: bool = True
    energy: Energy = "bounded"

    @property
    def order_with_internal(self) -> int:
        """The order with an internal state that has a rule: forces use its mean over a step instead of its course."""
        return min(self.order, 2)


_ADJOINTS: dict[type[Method], type[Method]] = {}
"""Methods and their adjoints, in both directions."""


@dataclass(frozen=True)
class Method(ABC):
    """A one-step method over a group difference map.

    A method must give two members, which are abstract: `order` and `stages`.

    difference_map: τ, by default `co.Cayley()`. start: "momentum" (the default) takes (μ₀, π₀) from the continuous
    Legendre transform, which order ≥ 2 needs; "velocity" takes ξ₀, ν₀ as the first discrete velocities, as the paper
    does. A record of another run keeps its momenta.
    """

    difference_map: DifferenceMap = field(default_factory=Cayley)
    start: Start = "momentum"

    def __init_subclass__(cls, adjoint_of: type[Method] | None = None, **more: object):
        """adjoint_of: the method whose adjoint Φ*_h = Φ₋ₕ⁻¹ this class is; each is then the adjoint of the other."""
        super().__init_subclass__(**more)
        if adjoint_of is not None:
            _ADJOINTS.update({cls: adjoint_of, adjoint_of: cls})

    def __post_init__(self):
        fits = isinstance(self.difference_map, DifferenceMap)
        checks.expect(fits, self.difference_map, "difference_map", "a difference map such as co.Cayley()")
        fits = isinstance(self.start, str) and self.start in ("momentum", "velocity")
        checks.expect(fits, self.start, "start", '"momentum" or "velocity"')

    def _start_from_momenta(self) -> None:
        """Raise ArgumentError for a method without one velocity of a step unless it starts from momenta."""
        checks.leave_out(self.start != "momentum", 'start="velocity"', f"{type(self).__name__} starts from momenta")

    @property
    @abstractmethod
    def order(self) -> int:
        """The order of convergence."""

    @property
    def symmetric(self) -> bool:
        """Whether step(−h) undoes step(h), as compositions of even order require."""
        return False

    @property
    def claims(self) -> Claims:
        """The quantities it keeps: a variational method with fixed steps keeps all, and energy within a band."""
        return Claims(self.order, self.symmetric)

    @property
    def variable(self) -> bool:
        """Whether the sizes of steps vary, so that nodes are not at integer multiples of dt."""
        return False

    def holds(self, records: State) -> Array:
        """The records whose steps the claim on energy covers, (rows,): all, unless the method overrides this."""
        return np.ones(np.shape(records.t), bool)

    def over_fixed_steps(self, records: State, h: Scalar) -> tuple[State, Array]:
        """Records with a leading axis as starts of steps of any size, and the sizes (rows,) of those they began."""
        return records, np.full(np.shape(records.t), h)

    @property
    @abstractmethod
    def stages(self) -> tuple[tuple[Step, float], ...]:
        """The implicit stages of a step with their fractions of h."""

    @property
    def remedies(self) -> tuple[str, str]:
        """The remedies for a step that Newton could not solve, and for one that left the chart."""
        return "take a smaller dt", "take a smaller dt, or co.Exponential()"

    @property
    def adjoint(self) -> Method:
        """Φ*_h = Φ₋ₕ⁻¹, the method itself where it is symmetric; raises ArgumentError if unknown."""
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
        """The method as text, for certificates and figures."""
        return f"{type(self).__name__}({shown(self.difference_map)})"

    def begin(self, system: System, state: State, h: Scalar) -> State:
        """The state with the momenta and memory that the method starts from."""
        steps = [step for step, _ in around(system, self.stages)]
        for step in steps:
            step.require_fit(system)
        if state.g is None and any(step.carries_g for step in steps):
            raise ArgumentError(
                "The start has no g, because a run with co.IsospectralMidpoint() made it: start from system.state(…), "
                "or go on with co.IsospectralMidpoint() without carry_g=True."
            )
        checks.leave_out(
            system.constraints and self.start == "velocity", 'start="velocity"', "Constraints hold velocities of nodes"
        )
        velocities = self.start == "velocity" and state.from_velocities
        begun = velocity_start(system, state, *self.recorded, h) if velocities else momentum_start(system, state)
        return reduce(lambda state, step: step.remember(system, state), steps, begun.replace(memory=kept(state)))

    def begin_by_xla(self, system: System, begun: State) -> State:
        """The state from `begin` with the values that steps by XLA carry over in addition to those of native code."""
        steps = [step for step, _ in around(system, self.stages)]
        return reduce(lambda state, step: step.remember_by_xla(system, state), steps, begun)


def velocity_start(system: System, state: State, step: Step, fraction: float, h: Scalar) -> State:
    """The state with the momenta of `momenta_of_step`, as a start of the method."""

    def momenta(state: State, parameters: PyTree, h: Scalar) -> tuple[Array, Array]:
        return momenta_of_step(replace_parameters(system, parameters), state, step, fraction, h)

    mu, pi = evaluate(momenta, state, system.parameters, h)
    return state.replace(mu=mu, pi=pi, from_velocities=False)


def momenta_of_step(system: System, state: State, step: Step, fraction: float, h: Scalar) -> tuple[Array, Array]:
    """(μ₀, π₀), (dim G,) and (ambient,), for which the first step has exactly ξ₀ and ν₀ as unknowns.

    The residual is affine in (μ, π). h: one number, s.
    """
    group, Q, _ = system.places
    over = advanced(system, state.replace(mu=None), h)
    state = state.with_course(over.internal, over.internal_mean, over.internal_end, over.internal_due)
    z = step.guess(system, state, fraction * h)

    def mismatch(p: Array) -> Array:
        pi = Q.tangent(group, state.n, p[group.dim :])
        return step.residual(system, state.replace(mu=p[: group.dim], pi=pi), fraction * h, z)

    p: Array = jnp.concatenate([state.mu, Q.coordinates(group, state.n, state.pi)])
    p = p - jacobian_solve(system.places, mismatch, p, mismatch(p))
    return p[: group.dim], Q.tangent(group, state.n, p[group.dim :])
