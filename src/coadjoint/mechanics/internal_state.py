"""The internal state over a step: at its beginning, its mean, and at its end."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.kernels.trace.evaluate import evaluate, traced
from coadjoint.mechanics import inverse_legendre
from coadjoint.mechanics.internal import ordered
from coadjoint.mechanics.internal_rule import declared
from coadjoint.mechanics.state import State
from coadjoint.mechanics.trace_checks import in_words, require_float64
from coadjoint.spaces.named import Named, named

if TYPE_CHECKING:
    from coadjoint.mechanics.system import System


class Course(NamedTuple):
    """The course of a part of an internal state over a step, for the rule that returns it.

        x, late = motion.internal.fin, jnp.exp(-h / p.lag)  # τ ẋ = u − x with u held: x(s) = u + (x − u) exp(−s/τ)
        return {"fin": co.mechanics.Course(u + (x - u) * late, u + (x - u) * (1 - late) * p.lag / h)}

    Each is a number, an array or a dictionary in the structure of that part.

    end: at the end of the step. mean: (1/h) ∫ x ds over the step, which forces, ℓ, ℋ and Λ read; by default halfway
    between begin and end, which is the mean to O(h²). begin: at the node where the step starts; by default the value
    before the node, another one where it jumps.
    """

    end: Any
    mean: PyTree = None
    begin: Any = None


def jumped(value: object) -> Course:
    """The course of a value that jumps at the node where the step starts and is held to its end, such as a command.

    value: a number, an array or a dictionary, in the structure of that part of the internal state.
    """
    return Course(value, value, value)


def at_node(system: System, state: State) -> State:
    """The state with the velocities (ξ, ν) of its momenta, ∂_ξℓ = μ and ∂_νℓ = π, for functions of a node.

    The velocities of a state between two steps belong to the step that ended there, and are half a step old. They stay
    if the system has neither ℓ nor ℋ, if the momenta are not known, or if no velocities are found.
    """
    if not system.continuous or state.mu is None or state.g is None:
        return state
    xi, nu, residual = inverse_legendre.velocities(system, state)
    found = jnp.isfinite(jnp.sum(xi) + jnp.sum(nu))
    if residual is not None:
        found &= residual <= inverse_legendre.SOLVED
    return state.replace(xi=jnp.where(found, xi, state.xi), nu=jnp.where(found, nu, state.nu))


AtNode = Callable[["System", State], State]


def advanced(system: System, state: State, h: Scalar, renewed: object = None, at: AtNode = at_node) -> State:
    """The state at a node with the course of its internal state over the step of h from there.

    The rule is applied once where it is due: at the start of a run and after every step. A record, to which it has been
    applied already, stays unchanged, and so does any other state where `renewed` is given and does not hold. h: one
    number, s. at: gives a state the velocities that the rule reads.
    """
    if system.internal is None:
        return state
    due = state.internal_due != 0
    due = due if renewed is None else due & renewed
    found = applied(system, at(system, state), h)
    before = state.internal, state.internal_mean, state.internal_end
    begin, mean, end = (
        jax.tree.map(lambda new, old: jnp.where(due, new, old), *pair)
        for pair in zip((found.begin, found.mean, found.end), before, strict=True)
    )
    left = jnp.where(due, 0.0, state.internal_due)
    return state.with_course(begin, mean, end, left)


def stepped(state: State) -> State:
    """A state after a step: its internal state is that of the end, and its rule is due."""
    if state.internal_mean is None:
        return state
    return state.with_course(state.internal_end, state.internal_mean, state.internal_end, jnp.ones_like(state.t))


def part_of(record: State, fraction: float) -> State:
    """The record as the start of fraction·h: its internal state goes straight from the beginning to the end."""
    return _along(record, 0.0, fraction)


def later_in(record: State, fraction: float) -> State:
    """The record with the internal state that is there after fraction·h, for a step of h from there."""
    return _along(record, fraction, 1.0)


def _along(record: State, first: float, length: float) -> State:
    if record.internal_mean is None:
        return record
    change = jax.tree.map(lambda begin, end: end - begin, record.internal, record.internal_end)

    def moved(tree: PyTree, part: float) -> PyTree:
        return jax.tree.map(lambda x, slope: x + part * slope, tree, change)

    return record.with_course(
        moved(record.internal, first),
        moved(record.internal_mean, first + 0.5 * (length - 1.0)),
        moved(record.internal_end, first + length - 1.0),
        record.internal_due,
    )


def applied(system: System, state: State, h: Scalar) -> Course:
    """rule(motion, h [, p]) at a state, each part in the structure of its internal state. h: one number, s.

    Raises LagrangianError for another structure.
    """
    assert system.internal is not None
    motion = system.motion_at(state, state.inputs, h)
    arguments = (motion, h) if system.parameters is None else (motion, h, system.parameters)
    after, before = named(system.internal(*arguments)), state.internal
    end = _fitting(_end(after), before)
    begin = _fitting(_begin(after, before), before)
    return Course(end, _fitting(_mean(after, begin, end), before), begin)


HELD = frozenset({"value", "pending", "sample", "release"})
"""The parts of a state that `co.mechanics.sampled` advances, which jump at nodes."""


def _jumps(tree: PyTree) -> bool:
    return isinstance(tree, Named) and set(tree) >= HELD


def _end(tree: PyTree) -> PyTree:
    if isinstance(tree, Course):
        return named(tree.end)
    return Named(**{name: _end(getattr(tree, name)) for name in tree}) if isinstance(tree, Named) else tree


def _begin(tree: PyTree, before: PyTree) -> PyTree:
    if isinstance(tree, Course):
        return before if tree.begin is None else named(tree.begin)
    if isinstance(tree, Named) and not _jumps(tree):
        return Named(**{name: _begin(getattr(tree, name), getattr(before, name)) for name in tree})
    return tree if _jumps(tree) else before


def _mean(tree: PyTree, begin: object, end: PyTree) -> PyTree:
    if isinstance(tree, Course) and tree.mean is not None:
        return named(tree.mean)
    if isinstance(tree, Named) and not _jumps(tree):
        return Named(**{name: _mean(getattr(tree, name), getattr(begin, name), getattr(end, name)) for name in tree})
    return end if _jumps(tree) else jax.tree.map(lambda x, y: 0.5 * (x + y), begin, end)


def _fitting(tree: PyTree, like: object) -> PyTree:
    """The values in the structure of the start's; raises LagrangianError for another one."""
    given, found = (
        [(jax.tree_util.keystr(path).lstrip("."), jnp.shape(leaf)) for path, leaf in leaves]
        for leaves in map(jax.tree_util.tree_leaves_with_path, (like, tree))
    )
    if sorted(given) != sorted(found) or not isinstance(tree, Named):
        raise LagrangianError(
            f"The rule `internal` must return the state that it advances, {_shown(given)}, but returned "
            f"{_shown(found)}."
        )
    return ordered(tree, like)


def _shown(parts: list[tuple[str, tuple[int, ...]]]) -> str:
    shapes = [f"`{name}` {'a number' if shape == () else f'of shape {shape}'}" for name, shape in parts if name]
    return ", ".join(shapes) or "no dictionary"


def require_internal(system: System, start: State, h: Scalar) -> list[str]:
    """Raise unless the rule of the system advances the internal state of the start to finite float64 numbers.

    Returns the warnings of the rule.
    """
    if system.internal is None:
        return []
    if start.internal is None or start.internal_due is None:
        raise ArgumentError(
            "This system has a rule for its internal state: give its start, as in "
            "system.state(…, internal={name: value})."
        )

    def rule(state: State) -> tuple[Named, ...]:
        return tuple(applied(system, state, h))

    if traced(system.parameters, start, h):
        return []
    declaration = declared(system.internal)
    require_float64(rule, declaration.title, (start,))
    with in_words(declaration.title):
        parts = map(jax.tree_util.tree_leaves_with_path, evaluate(rule, start))
    bad = [
        jax.tree_util.keystr(path).lstrip(".") for part in parts for path, leaf in part if not np.all(np.isfinite(leaf))
    ]
    if bad:
        raise LagrangianError(
            f"{declaration.title} must give finite numbers, but `{bad[0]}` is not finite after the first step: look "
            "for a division by zero."
        )
    return internal_warnings(system, h)


def internal_warnings(system: System, h: Array | float) -> list[str]:
    """The warnings of the rule of the system about steps of length h, one number, s."""
    return declared(system.internal).warnings(h, system.parameters)


def driven_warnings(system: System, begin: float, end: float) -> list[str]:
    """The warnings of the rule of the system about the inputs of a run from `begin` to `end`, s."""
    if system.inputs is None:
        return []
    return declared(system.internal).driven(system.inputs, begin, end, system.parameters)


def failure(system: System, t: Scalar, h: Scalar) -> str | None:
    """The explanation of the rule for a failed step of length h from t."""
    return declared(system.internal).failure(t, h)
