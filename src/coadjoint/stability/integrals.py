"""Quantities that the reduced motion conserves: Casimir functions of its bracket, and integrals that the user names."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.errors import ArgumentError
from coadjoint.kernels.trace.evaluate import evaluate, tabulate
from coadjoint.mechanics.casimir_functions import kept_by
from coadjoint.mechanics.poisson import Phase, vector_field
from coadjoint.mechanics.quantities import value
from coadjoint.mechanics.state import State
from coadjoint.stability.reduced import IGNORABLE, Reduced

DRIFT = 1e-8
"""A rate of an integral up to this fraction of |dC||ẏ| counts as zero."""


@lru_cache(maxsize=16)
def casimirs(reduced: Reduced) -> dict[str, Callable]:
    """The polynomial Casimir functions of the bracket on y modulo K, as functions of a state."""
    C, near = reduced.essential, reduced.near

    def tensor(u: Array) -> Array:
        def rate(i: int) -> Array:
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
    """The given integrals, and those quantities of the system that are conserved and know nothing of K.

    Raises ArgumentError for a given one that is not.
    """
    system = reduced.system
    require_conserved(reduced, integrals)
    watched = {name: lambda s, f=function: value(system, f, s) for name, function in system.quantities}
    found = {name: f for name, f in watched.items() if _is_integral(reduced, f)}
    for i, f in enumerate(integrals, start=1):
        name = getattr(f, "__name__", "<lambda>")
        found[f"integral_{i}" if name == "<lambda>" or name in found else name] = f
    return found


def require_conserved(reduced: Reduced, integrals: Sequence[Callable]) -> None:
    """Raise ArgumentError where dC·Y or dC·K is not zero at random states for one of these functions of a state."""
    if not integrals:
        return
    zero, still = np.zeros(sum(reduced.sizes)), np.zeros(len(reduced.symmetries))

    def slopes(state: State) -> PyTree:
        def at(z: Array) -> PyTree:
            moved = reduced.with_momenta(reduced.moved(state, z))
            return jnp.stack([C(moved) for C in integrals]), reduced.phase(moved, still)[0]

        return *jax.jacfwd(at)(zero), reduced.phase(state, still)[1]

    at = tabulate(slopes, reduced.near)
    scales = reduced.scales
    for state in reduced.around:
        dC, y_z, rate = at(state)
        # In natural sizes: a coordinate may be an integral, whose slope and rate are round-off of the others alone.
        dC, y_z = dC * scales.z, y_z * scales.z / scales.y[:, None]
        directions = np.column_stack([rate, reduced.ignorable]) / scales.y[:, None]
        # δy = rate, and δy = k of those k that the chart reaches: the others do not change the orbit of a.
        z = np.linalg.lstsq(y_z, directions, rcond=None)[0]
        z = z * (np.linalg.norm(y_z @ z - directions, axis=0) <= IGNORABLE * np.linalg.norm(directions, axis=0))
        along = np.abs(dC @ z) > DRIFT * np.outer(np.linalg.norm(dC, axis=1), np.linalg.norm(z, axis=0))
        for i, does in enumerate(along):
            if np.any(does):
                name = getattr(integrals[i], "__name__", "<lambda>")
                what = "changes along the motion" if does[0] else "depends on ignorable variables"
                raise ArgumentError(
                    f"`{name}`, integral {i + 1} of those given, is not an integral of the motion: it {what}."
                )


def _is_integral(reduced: Reduced, function: Callable) -> bool:
    """Whether dC·Y = 0 and dC·K = 0 at random states."""

    def slope(state: State) -> tuple[Array, Array]:
        y, rate = reduced.phase(state)
        return jax.grad(lambda y: function(_at(state, y)))(y), rate

    scale = reduced.scales.y
    for state in reduced.around:
        dC, rate = evaluate(slope, state)
        dC, directions = dC * scale, np.column_stack([rate, reduced.ignorable]) / scale[:, None]
        terms = np.linalg.norm(dC) * np.linalg.norm(directions, axis=0)
        if not np.any(dC) or not np.all(np.abs(dC @ directions) <= IGNORABLE * terms):
            return False
    return True


def _at(state: State, y: Array) -> State:
    """The state with y = (μ, n, π, a)."""
    sizes = np.cumsum([np.shape(part)[0] for part in (state.mu, state.n, state.pi, state.a)])[:-1]
    phase = Phase(*jnp.split(y, sizes))
    return state.replace(**phase._asdict())
