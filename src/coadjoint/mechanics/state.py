"""The state of a system at a node, and what the user's functions see of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import jax
import numpy as np

from coadjoint.groups import LieGroup
from coadjoint.groups.group import Array, Element
from coadjoint.kernels.evaluate import evaluate
from coadjoint.spaces import Space


class Places(NamedTuple):
    """Where a system lives: G, Q and V*."""

    group: LieGroup
    additional: Space
    advected: Space


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class State:
    """t, g, n = g⁻¹q, a = g⁻¹a₀, μ, π at a node, and (ξ, ν) of the step that starts there.

    In a state that a run goes on from, ξ and ν are the last unknowns, Newton's next guess; in a record they are the
    unknowns of the step that starts at it. `inputs` are held over the step, `internal` belongs to actuators, filters
    and noise, `memory` to the method. `internal_time` is up to when the system's rule has advanced `internal`, None
    where there is no rule.
    `ledger` is what forces have put in since the start (`mechanics.ledger`), None where nobody asks.
    `t_rest` is what rounding has cut off t (Kahan's summation), so that t stays right to the last digit for ever.
    `from_velocities` marks a start given by its velocities: the run that starts there takes μ, π from (ξ, ν) with its
    own parameters. A record goes on with its own momenta.
    """

    t: Array
    g: Element
    n: Array
    a: Array
    mu: Array
    pi: Array
    xi: Array
    nu: Array
    inputs: Any = None
    internal: Any = None
    memory: Any = None
    internal_time: Any = None
    ledger: Any = None
    t_rest: Array = 0.0
    places: Places = field(metadata={"static": True}, kw_only=True)
    from_velocities: bool = field(metadata={"static": True}, kw_only=True, default=False)

    def replace(self, **changes: Any) -> State:
        """A copy with some fields replaced."""
        return replace(self, **changes)

    def later(self, h: Array, **changes: Any) -> State:
        """A copy at t + h with some fields replaced."""
        step = h + self.t_rest
        t = self.t + step
        return replace(self, t=t, t_rest=step - (t - self.t), **changes)

    def each(self, function: Callable[[State], Any]) -> Any:
        """function of a single state, mapped over the leading axes of records; NumPy unless traced."""
        for _ in range(np.ndim(self.t)):
            function = jax.vmap(function)
        return evaluate(function, self)

    @property
    def q(self) -> Array:
        """The additional configuration q = g·n in the space frame."""
        return self.each(lambda s: s.places.additional.act(s.places.group, s.g, s.n))

    @property
    def qdot(self) -> Array:
        """The velocity q̇ = g·ν in the space frame."""
        return self.each(lambda s: s.places.additional.push(s.places.group, s.g, s.n, s.nu))

    @property
    def named(self) -> Parts:
        """n, ν, π, a, q, q̇ as ℓ sees them: `state.named.a.down` where the system has advected=dict(down=…)."""

        def parts(s: State) -> Parts:
            group, Q, V = s.places
            n, nu, pi, q, qdot = (Q.view(group, x) for x in (s.n, s.nu, s.pi, s.q, s.qdot))
            return Parts(n, nu, pi, V.view(group, s.a), q, qdot)

        return self.each(parts)


class Parts(NamedTuple):
    """Points, velocities, momenta and advected parameters by the names that a dictionary of spaces gave them."""

    n: Any
    nu: Any
    pi: Any
    a: Any
    q: Any
    qdot: Any


class Motion(NamedTuple):
    """What forces and inputs may depend on: body velocities, n, advected parameters, time, inputs, internal state."""

    xi: Array
    n: Any
    nu: Any
    a: Any
    t: Array
    inputs: Any
    internal: Any


class Force(NamedTuple):
    """A body torque T ∈ 𝔤* and a body force f ∈ T*Q: virtual work ⟨T, g⁻¹δg⟩ + ⟨f, g⁻¹δq⟩; None stands for zero."""

    torque: Any = None
    force: Any = None
