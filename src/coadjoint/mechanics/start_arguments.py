"""The arguments of a start, checked: element, points and velocities as flat float64 arrays, of one or many members."""

from __future__ import annotations

from contextlib import suppress
from typing import Any, NamedTuple, cast

import jax
import numpy as np

from coadjoint import checks
from coadjoint.arrays import Array, Coordinates, PyTree, Scalar
from coadjoint.checks import float64, numeric, one_of_each
from coadjoint.errors import ArgumentError, shown
from coadjoint.groups import DirectProduct, LieGroup, Power
from coadjoint.groups.group import Element
from coadjoint.kernels.run.disk_cache import evaluated
from coadjoint.kernels.trace.evaluate import evaluate, traced
from coadjoint.mechanics.members import Each, count_members, member_of
from coadjoint.mechanics.reduced_functions import ReducedFunctions
from coadjoint.spaces import Space
from coadjoint.spaces.space import checked_vector

ON_GROUP = 1e-9
"""How far outside its group an element may be by round-off."""

TANGENT = 1e-9
"""How far a velocity may leave its tangent space by round-off, relative to its size where that is over 1."""


class Checked(NamedTuple):
    """The arguments of `System.state`, checked: element and flat float64 arrays.

    q, qdot: (ambient,). xi: (dim G,). a0: (dim V*,). t: one number, s. Of members all have a leading axis.
    """

    g: Element
    q: Array
    qdot: Array
    xi: Array
    a0: Array
    t: Array


def checked(
    system: ReducedFunctions,
    element: Element,
    q: Coordinates | None,
    qdot: Coordinates | None,
    xi: Coordinates | None,
    a0: Coordinates | None,
    t: Scalar,
    by_momenta: bool = False,
) -> Checked:
    if by_momenta:
        size = system.additional.ambient(system.group)
        if qdot is not None and size == 0 and np.shape(cast(Array, qdot)) != (0,):
            raise ArgumentError("This system has no additional dynamics: leave out `pi`.")
        rate = np.zeros(size) if qdot is None else checked_vector(qdot, size, "pi")
        place = _pair(system, q, None)[0]
    else:
        place, rate = _pair(system, q, qdot)
    turning = np.zeros(system.group.dim) if xi is None else _of_links(system.group, xi, "mu" if by_momenta else "xi")
    time = checks.array(t, "t", ())
    return Checked(element, place, rate, turning, _advected(system, a0), time)


def _of_links(group: LieGroup, xi: object, name: str) -> Array:
    """ξ or μ, (dim G,); of links also (N, dim G) by rows. Raises ArgumentError for other shapes."""
    if not isinstance(group, Power) or not (traced(xi) or isinstance(xi, (list, np.ndarray))):
        return checked_vector(xi, group.dim, name)
    given: Any = xi
    rows = (group.count, group.factor.dim)
    with suppress(ValueError):
        given = xi if traced(xi) else np.asarray(xi)
    if np.shape(given) == rows:
        return checked_vector(given.reshape(-1), group.dim, name)
    if np.ndim(given) > 1:
        raise ArgumentError(
            f"Argument `{name}` of {rows[0]} links must have shape {rows}, a row a link, or ({group.dim},), but has "
            f"shape {np.shape(given)}{one_of_each(np.shape(given), rows, name)}."
        )
    return checked_vector(xi, group.dim, name)


def checked_members(
    system: ReducedFunctions, arguments: tuple[object, ...], count: int, by_momenta: bool = False
) -> Checked:
    """All members, stacked; the group elements are checked together, because that is what takes time."""
    group = system.group
    if isinstance(arguments[-1], Each):
        raise ArgumentError("Argument `t` must be the same for all members: an ensemble has one time axis.")
    g, *others = arguments
    first = checked_element(group, member_of(g, 0))
    if isinstance(g, Each):
        elements = jax.tree.map(lambda leaf, values: np.asarray(values), first, g.values)
        outside = np.asarray(evaluate(jax.vmap(group.outside), elements))
        worst = int(np.argmax(outside))
        _require_inside(group, jax.tree.map(lambda leaf: leaf[worst], elements))
    else:
        elements = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (count, *leaf.shape)), first)

    def row(index: int) -> Checked:
        return checked(system, first, *member_of(others, index), by_momenta=by_momenta)

    if stack := _as_given(system, others, count, row(0), row(count - 1)):
        return Checked(elements, *stack)
    rows = [row(index) for index in range(count)]
    return Checked(elements, *(np.stack([getattr(one, name) for one in rows]) for name in Checked._fields[1:]))


def _as_given(
    system: ReducedFunctions, others: list[object], count: int, first: Checked, last: Checked
) -> list[np.ndarray]:
    """All arguments but g, stacked as `co.each` has them; empty where one has to look at every member.

    co.each holds finite numbers of one shape, of which flat spaces with an affine action ask no more.
    """
    if not all(space.flat and space.affine for space in (system.additional, system.advected)):
        return []
    found: list[np.ndarray] = []
    for given, low, high in zip(others, first[1:], last[1:], strict=True):
        if count_members(given) is None:
            found.append(np.repeat(np.asarray(low)[None], count, axis=0))
            continue
        values = np.asarray(given.values) if isinstance(given, Each) else np.zeros(0)
        same = values.shape == (count, *np.shape(low)) and np.array_equal(values[[0, -1]], [low, high])
        if not same or not np.all(np.isfinite(values)):
            return []
        found.append(values)
    return found


def checked_element(group: LieGroup, g: Element) -> Element:
    """g as an element of the group with float64 leaves; raises ArgumentError for wrong shapes and for g outside G."""
    identity = evaluate(group.identity)
    if g is None:
        return identity
    leaves, structure = jax.tree.flatten(identity)
    if isinstance(g, list) and len(leaves) == 1:
        g = float64(g, "Argument `g`")
    given: list[PyTree] = []
    shapes = None
    with suppress(Exception):
        # A named tuple, as of U(n), may be given as a plain one.
        given = list(g) if type(g) is tuple and len(g) == len(leaves) else structure.flatten_up_to(g)
        shapes = [np.shape(leaf) for leaf in given]
    expected = [leaf.shape for leaf in leaves]
    if shapes != expected:
        if not all(map(numeric, given)):
            raise ArgumentError(f"Argument `g` must hold the numbers of an element of {group!r}, but is {shown(g)}.")
        names = group.leaf_names if len(expected) > 1 else ("of shape",)
        arrays = ", ".join(f"{name} {shape}" for name, shape in zip(names, expected, strict=False))
        has = "another structure" if shapes is None else f"shape {', '.join(map(str, shapes))}"
        remedy = one_of_each(shapes[0], expected[0], "g") if shapes and len(shapes) == len(expected) == 1 else ""
        raise ArgumentError(f"Argument `g` must be an element of {group!r}, arrays {arrays}, but has {has}{remedy}.")
    element = jax.tree.unflatten(structure, [float64(leaf, "Argument `g`") for leaf in given])
    if not traced(element):
        _require_inside(group, element)
    return element


def _require_inside(group: LieGroup, element: Element) -> None:
    if float(evaluated("outside", lambda g: [group.outside(g)], element)[0]) <= ON_GROUP:
        return
    given, of = group, ""
    while isinstance(group, DirectProduct):
        parts = zip(group.factors, element, strict=True)
        group, element = next(pair for pair in parts if float(evaluate(pair[0].outside, pair[1])) > ON_GROUP)
        of = f" in its factor {group!r}"
    off = float(evaluate(group.defect if group.constrained else group.outside, element))
    why = "the determinant is −1" if off <= ON_GROUP else f"the defining equations fail by {off:.2g}"
    raise ArgumentError(f"Argument `g` must lie in {given!r}, but{of} {why}; for a rotation, make it by co.attitude.")


def _pair(system: ReducedFunctions, q: Coordinates | None, qdot: Coordinates | None) -> tuple[PyTree, PyTree]:
    group, Q = system.group, system.additional
    size = Q.ambient(group)
    if size == 0:
        checks.leave_out(q is not None or qdot is not None, "`q` and `qdot`", "This system has no additional dynamics")
        return np.zeros(0), np.zeros(0)
    if q is None:
        raise ArgumentError(
            f"This system has additional dynamics: give `q`, shape ({size},), and `qdot` unless at rest."
        )
    point = Q.point(group, q, "q")
    if qdot is None:
        return point, np.zeros(size)
    velocity = Q.velocity(group, qdot, "qdot")
    require_tangent(Q, group, point, velocity)
    return point, velocity


def require_tangent(
    Q: Space, group: LieGroup, point: Array, velocity: Array, name: str = "qdot", place: str = "q"
) -> None:
    """Raise ArgumentError where q̇ leaves T_qQ, both (ambient,): E_q E_qᵀ q̇ = q̇ for the orthonormal frame E_q."""
    if Q.flat or traced(point, velocity):
        return
    within = evaluate(lambda x, v: Q.tangent(group, x, Q.coordinates(group, x, v)), point, velocity)
    leaves = float(np.max(np.abs(velocity - within)))
    if leaves > TANGENT * max(1.0, float(np.max(np.abs(velocity)))):
        raise ArgumentError(
            f"Argument `{name}` must be tangent to the space at `{place}`, but leaves it by {leaves:.3g}: take away "
            "its part along the normal."
        )


def _advected(system: ReducedFunctions, a0: Coordinates | None) -> Array:
    group, V = system.group, system.advected
    if V.ambient(group) == 0:
        checks.leave_out(a0 is not None, "`a0`", "This system has no advected parameters")
        return np.zeros(0)
    if a0 is None and not V.at_start:
        raise ArgumentError(f"This system has advected parameters: give `a0`, {V.ambient(group)} numbers in all.")
    return V.point(group, a0, "a0")
