"""Internal states: the memory of actuators, filters and digital controllers, advanced by a rule."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp

from coadjoint import checks
from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError, LagrangianError, shown
from coadjoint.kernels.trace.evaluate import traced
from coadjoint.mechanics.members import Each
from coadjoint.mechanics.state import NodeMotion
from coadjoint.spaces.named import Named, named


def starting_values(given: object) -> PyTree:
    """The argument `internal` of a start: a dictionary of numbers, possibly nested, of float64 or `Each`."""
    if given is None:
        return None
    fits = isinstance(given, (Mapping, Named)) and list(given)
    checks.expect(fits, given, "internal", "a dictionary of numbers and arrays, such as {'rudder': 0.0}")
    return _values(given, "internal")


def _values(value: object, name: str) -> PyTree:
    if isinstance(value, (Mapping, Named)):
        parts = value.asdict() if isinstance(value, Named) else value
        return Named(**{str(key): _values(part, f"{name}.{key}") for key, part in parts.items()})
    if isinstance(value, Each):
        return value
    return float64(value, f"The start `{name}`")


def sampling(values: Mapping[str, object], t: Scalar = 0.0) -> dict[str, PyTree]:
    """The start of a state that `co.mechanics.sampled` advances: `values`, in force from t on; the first sample is at t
    itself.

        start = system.state(…, internal={"controller": co.mechanics.sampling({"rudder": 0.0, "integral": 0.0}), …})

    values: numbers and arrays by name. t: s, by default 0. Returns a dictionary that becomes
    `motion.internal.controller`, with the parts `value`, which forces read, `pending`, `sample` and `release` (s).
    """
    return {"value": dict(values), "pending": dict(values), "sample": t, "release": t}


def sampled(
    motion: NodeMotion,
    h: Scalar,
    held: Named,
    update: Callable[[Any], Mapping[str, PyTree]],
    *,
    period: Scalar,
    delay: Scalar = 0.0,
) -> dict[str, PyTree]:
    """A digital controller inside a rule: `update` at every multiple of `period`, in force `delay` later.

        controller = co.mechanics.sampled(motion, h, motion.internal.controller, lambda last: {...}, period=0.2,
                                          delay=0.05)

    motion, h: those of the rule; h is one number, s. held: the state that `co.mechanics.sampling` began. update: from
    the values computed last to the next ones. Its result jumps at the node: `controller["value"]` is in force over the
    step from there, for the actuators that follow it. period, delay: s, 0 ≤ delay ≤ period; a sample, and a release, is
    at the node nearest to its time, so that a period need not be a multiple of dt; one shorter than dt samples at every
    node. Raises ArgumentError for a delay beyond the period.
    """
    if not traced(period, delay) and not 0 <= delay <= period:
        raise ArgumentError(
            f"co.mechanics.sampled takes 0 ≤ delay ≤ period, but got delay = {shown(delay)} and period = "
            f"{shown(period)}."
        )
    now, pending, value = motion.t + 0.5 * h, named(held.pending), named(held.value)
    released = now >= held.release
    value = _where(released, pending, value)
    due = now >= held.sample
    following = held.sample + period * (jnp.floor((now - held.sample) / period) + 1)
    pending = _where(due, _like(update(pending), pending), pending)
    release = jnp.where(due, following - period + delay, held.release)
    value = _where(due & (now >= release), pending, value)
    return {
        "value": value,
        "pending": pending,
        "sample": jnp.where(due, following, held.sample),
        "release": release,
    }


def ordered(tree: PyTree, like: object) -> PyTree:
    """The values as float64, under names in the order of the start's."""
    if isinstance(like, Named):
        return Named(**{name: ordered(getattr(tree, name), getattr(like, name)) for name in like})
    return jnp.asarray(tree, dtype=float)


def _where(condition: Array, new: object, old: object) -> PyTree:
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), new, old)


def _like(values: object, pending: Named) -> PyTree:
    values = named(values)
    if not isinstance(values, Named) or set(values) != set(pending):
        raise LagrangianError(
            f"The update of co.mechanics.sampled must return {', '.join(pending)}, but returned {list(values)!r}."
            if isinstance(values, Named)
            else f"The update of co.mechanics.sampled must return a dictionary, but returned {type(values).__name__}."
        )
    return ordered(values, pending)
