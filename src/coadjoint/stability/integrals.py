"""What the reduced motion conserves: Casimir functions of its bracket, and integrals that somebody names."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.kernels.evaluate import evaluate
from coadjoint.mechanics.casimirs import kept_by
from coadjoint.mechanics.poisson import Phase, vector_field
from coadjoint.mechanics.quantities import value
from coadjoint.mechanics.state import State
from coadjoint.stability.reduced import IGNORABLE, Reduced


@lru_cache(maxsize=16)
def casimirs(reduced: Reduced) -> dict[str, Callable]:
    """The polynomial Casimir functions of the bracket on y modulo K, as functions of a state."""
    C, near = reduced.essential, reduced.near

    def tensor(u: Any) -> Any:
        def rate(i: int) -> Any:
            moving = vector_field(lambda s: jnp.concatenate([s.mu, s.n, s.pi, s.a])[i], _at(near, C.T @ u))
            return jnp.concatenate(moving)

        return C @ jnp.stack([rate(i) for i in range(C.shape[1])], axis=1) @ C.T

    zero = np.zeros(len(C))
    constant, slope = evaluate(lambda u: (tensor(u), jax.jacfwd(tensor)(u)), zero)
    fields = np.concatenate([slope.transpose(1, 0, 2), constant.T[:, :, None]], axis=-1)
    found, _ = kept_by(fields, len(C))

    def function(polynomial: Callable) -> Callable:
        return lambda s: polynomial(C @ jnp.concatenate([s.mu, s.n, s.pi, s.a]))

    return {f"casimir_{i}": function(casimir.polynomial) for i, casimir in enumerate(found, start=1)}


def conserved(reduced: Reduced, integrals: Sequence[Callable]) -> dict[str, Callable]:
    """The given integrals, and those quantities of the system that are conserved and know nothing of K."""
    system = reduced.system
    watched = {name: lambda s, f=function: value(system, f, s) for name, function in system.quantities}
    watched = {name: f for name, f in watched.items() if _is_integral(reduced, f)}
    return {**watched, **{getattr(f, "__name__", f"integral_{i}"): f for i, f in enumerate(integrals, start=1)}}


def _is_integral(reduced: Reduced, function: Callable) -> bool:
    """Whether dC·Y = 0 and dC·K = 0 at random states."""

    def slope(state: State) -> Any:
        y, rate = reduced.phase(state)
        return jax.grad(lambda y: function(_at(state, y)))(y), rate

    for state in reduced.around:
        dC, rate = evaluate(slope, state)
        terms = float(np.abs(dC) @ np.abs(rate))
        along = np.max(np.abs(dC @ reduced.ignorable), initial=0.0)
        if not np.any(dC) or not abs(dC @ rate) <= IGNORABLE * terms or along > IGNORABLE * np.max(np.abs(dC)):
            return False
    return True


def _at(state: State, y: Any) -> State:
    """The state with y = (μ, n, π, a)."""
    sizes = np.cumsum([np.shape(part)[0] for part in (state.mu, state.n, state.pi, state.a)])[:-1]
    phase = Phase(*jnp.split(y, sizes))
    return state.replace(**phase._asdict())
