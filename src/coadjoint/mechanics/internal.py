"""Internal states: what actuators, filters and digital controllers remember, advanced by a rule of their own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.errors import ArgumentError, LagrangianError, shown
from coadjoint.groups.group import Array
from coadjoint.kernels.trace.evaluate import evaluate, traced
from coadjoint.mechanics.each import Each
from coadjoint.mechanics.internal_rule import declared
from coadjoint.mechanics.reading import in_words, require_float64
from coadjoint.mechanics.state import NodeMotion
from coadjoint.spaces.named import Named, named
from coadjoint.spaces.numbers import float64

if TYPE_CHECKING:
    from coadjoint.mechanics.state import State
    from coadjoint.mechanics.system import System


def starting_values(given: Any) -> Any:
    """The argument `internal` of a start: a dictionary of numbers, nested where one likes, of float64 or `Each`."""
    if given is None:
        return None
    if not isinstance(given, (Mapping, Named)) or not list(given):
        raise ArgumentError(
            f"Argument `internal` must be a dictionary of numbers and arrays, such as {{'rudder': 0.0}}, "
            f"but is {shown(given)}."
        )
    return _values(given, "internal")


def _values(value: Any, name: str) -> Any:
    if isinstance(value, (Mapping, Named)):
        parts = value.asdict() if isinstance(value, Named) else value
        return Named(**{str(key): _values(part, f"{name}.{key}") for key, part in parts.items()})
    if isinstance(value, Each):
        return value
    return float64(value, f"The start `{name}`")


def advanced(system: System, state: State, renewed: Any = None) -> State:
    """The state at a node with the internal state that is held over the step from there.

    The rule has been applied up to `internal_time`; from there to t it is applied once. So a record, which has been
    advanced already, stays as it is, and so does any other where `renewed` is given and does not hold.
    """
    if system.internal is None:
        return state
    elapsed = state.t - state.internal_time
    due = elapsed != 0 if renewed is None else (elapsed != 0) & renewed
    # A rule may divide by h: where that is zero, it is given another one, and what it says is not used.
    after = applied(system, state, jnp.where(elapsed != 0, elapsed, 1.0))
    chosen = jax.tree.map(lambda new, old: jnp.where(due, new, old), after, state.internal)
    return state.replace(internal=chosen, internal_time=jnp.where(due, state.t, state.internal_time))


def applied(system: System, state: State, h: Array) -> Named:
    """rule(motion, h [, p]) at a state, in the structure of its internal state. h: one number, s.

    Raises LagrangianError for another structure.
    """
    assert system.internal is not None
    motion = system.motion_at(state, state.inputs)
    arguments = (motion, h) if system.parameters is None else (motion, h, system.parameters)
    after = named(system.internal(*arguments))
    given, found = (
        [(jax.tree_util.keystr(path).lstrip("."), jnp.shape(leaf)) for path, leaf in leaves]
        for leaves in map(jax.tree_util.tree_leaves_with_path, (state.internal, after))
    )
    if sorted(given) != sorted(found) or not isinstance(after, Named):
        raise LagrangianError(
            f"The rule `internal` must return what it advances, {_shown(given)}, but returned {_shown(found)}."
        )
    return _ordered(after, state.internal)


def _ordered(tree: Any, like: Any) -> Any:
    """The values as float64, under names in the order of the start's."""
    if isinstance(like, Named):
        return Named(**{name: _ordered(getattr(tree, name), getattr(like, name)) for name in like})
    return jnp.asarray(tree, dtype=float)


def _shown(parts: list[tuple[str, tuple[int, ...]]]) -> str:
    shapes = [f"`{name}` {'a number' if shape == () else f'of shape {shape}'}" for name, shape in parts if name]
    return ", ".join(shapes) or "no dictionary"


def require_internal(system: System, start: State, h: Array) -> list[str]:
    """Raise unless the rule of the system advances the internal state of the start to finite float64 numbers.

    Returns the warnings of the rule.
    """
    if system.internal is None:
        return []
    if start.internal is None or start.internal_time is None:
        raise ArgumentError(
            "This system has a rule for its internal state: give its start, as in "
            "system.state(…, internal={name: value})."
        )

    def rule(state: State) -> Named:
        return applied(system, state, h)

    if traced(system.parameters, start, h):
        return []
    declaration = declared(system.internal)
    require_float64(rule, declaration.title, (start,))
    with in_words(declaration.title):
        after = jax.tree_util.tree_leaves_with_path(evaluate(rule, start))
    bad = [jax.tree_util.keystr(path).lstrip(".") for path, leaf in after if not np.all(np.isfinite(leaf))]
    if bad:
        raise LagrangianError(
            f"{declaration.title} must give finite numbers, but `{bad[0]}` is not finite after the first step: look "
            "for a division by zero."
        )
    return internal_warnings(system, h)


def internal_warnings(system: System, h: Any) -> list[str]:
    """The warnings of the rule of the system about steps of length h."""
    return declared(system.internal).warnings(h, system.parameters)


def failure(system: System, t: float, h: float) -> str | None:
    """What the rule says of the step of length h from t that has failed."""
    return declared(system.internal).failure(t, h)


def sampling(values: Mapping[str, Any], t: float = 0.0) -> dict[str, Any]:
    """The start of what `co.sampled` advances: `values`, in force from t on; the first sample is at the node after t.

        start = system.state(…, internal={"controller": co.sampling({"rudder": 0.0, "integral": 0.0}), …})

    values: numbers and arrays by name. t: s, by default 0. Returns what becomes `motion.internal.controller`, with the
    parts `value`, which forces read, `pending`, `sample` and `release` (s).
    """
    return {"value": dict(values), "pending": dict(values), "sample": t, "release": t}


def sampled(
    motion: NodeMotion,
    h: Array,
    held: Named,
    update: Callable[[Any], Mapping[str, Any]],
    *,
    period: Array,
    delay: Array = 0.0,
) -> dict[str, Any]:
    """A digital controller inside a rule: `update` at every multiple of `period`, in force `delay` later.

        controller = co.sampled(motion, h, motion.internal.controller, lambda last: {...}, period=0.2, delay=0.05)

    motion, h: those of the rule; h is one number, s. held: what `co.sampling` began. update: from the values computed
    last to the next ones. period, delay: s, 0 ≤ delay ≤ period; a sample, and a release, is at the node nearest to its
    time, so that a period need not be a multiple of dt; one shorter than dt samples at every node. Raises ArgumentError
    for a delay beyond the period.
    """
    if not traced(period, delay) and not 0 <= delay <= period:
        raise ArgumentError(
            f"co.sampled takes 0 ≤ delay ≤ period, but got delay = {shown(delay)} and period = {shown(period)}."
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


def _where(condition: Array, new: Any, old: Any) -> Any:
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), new, old)


def _like(values: Any, pending: Named) -> Any:
    values = named(values)
    if not isinstance(values, Named) or set(values) != set(pending):
        raise LagrangianError(
            f"The update of co.sampled must return {', '.join(pending)}, but returned {list(values)!r}."
            if isinstance(values, Named)
            else f"The update of co.sampled must return a dictionary, but returned {type(values).__name__}."
        )
    return _ordered(values, pending)
