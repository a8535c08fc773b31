"""The parameters of a system: named float64 arrays, the leaves that one differentiates, varies and replaces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError, shown
from coadjoint.mechanics.members import Each
from coadjoint.paths import paths, respelled
from coadjoint.spaces.named import Named, require_names


@jax.tree_util.register_pytree_with_keys_class
class Parameters(Named):
    """Named parameters, kept as float64 and read as attributes: `p.mass`, `p.rudder.area`.

        p = co.Parameters(mass=123.8, inertia=np.diag([5.46, 5.29, 5.72]), rudder=dict(area=0.02))
        p.replace(mass=130.0, rudder=dict(area=0.03))  # the other numbers of the rudder stay

    *unnamed: none, all have names. **values: each a number, an array of any shape, a nested dictionary of these, or
    `co.each` of them, or a PyTree of them, such as a list of layers of a network: a list of numbers, or of arrays of
    one shape, is an array, any other list a tuple. Units are those of the Lagrangian that reads them; models and
    vehicles use SI. They are a PyTree: JAX differentiates by them. Where a name is a text, as in
    `changing=("rudder.area",)` or on the command line, it is the path with points, and `net[0].weight` within a list.

    Raises ArgumentError for float32, complex numbers, text and values that are not finite.
    """

    __slots__ = ()

    def __init__(self, *unnamed: object, **values: object):
        if unnamed:
            raise ArgumentError(f"Parameters have names: write co.Parameters(name={shown(unnamed[0])}).")
        super().__init__(**_checked(values))

    def replace(self, **values: object) -> Parameters:
        """A copy with some values replaced; a dictionary replaces the values that it names and keeps the others.

        Raises ArgumentError for a name that is not there, and for one number in the place of several.
        """
        return Parameters(**_merged(self, values))


def _checked(values: Mapping[str, object], prefix: str = "") -> dict[str, PyTree]:
    """The values as float64, and dictionaries of them as parameters; raises ArgumentError, naming the path."""
    require_names(values)
    found: dict[str, PyTree] = {}
    for name, value in values.items():
        found[name] = _value(value, f"{prefix}{name}")
    return found


def _value(value: object, path: str) -> PyTree:
    """One value as it is kept: parameters, a tuple, another node of a PyTree, or an array of float64."""
    if isinstance(value, (Each, Parameters)):
        return value
    if isinstance(value, (Mapping, Named)):
        inner = _checked(value.asdict() if isinstance(value, Named) else value, f"{path}.")
        return Parameters.tree_unflatten(tuple(inner), inner.values())
    if isinstance(value, (list, tuple)) and (hasattr(value, "_fields") or not _one_array(value)):
        parts = [_value(part, f"{path}[{index}]") for index, part in enumerate(value)]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    if value is not None and not jax.tree_util.all_leaves([value]) and not isinstance(value, (list, tuple)):
        return jax.tree_util.tree_map_with_path(
            lambda keys, leaf: _value(leaf, path + jax.tree_util.keystr(keys)), value
        )
    made = float64(value, f"Parameter `{path}`")
    if isinstance(made, np.ndarray):
        made.flags.writeable = False  # a copy: a change of it in place would change a system
    return made


def _one_array(values: Sequence[object]) -> bool:
    """Whether a list is an array: of numbers, of lists of them however deep, or of arrays of one shape."""
    if any(isinstance(part, (Mapping, Named, Each)) or hasattr(part, "_fields") for part in values):
        return False
    if any(isinstance(part, (list, tuple)) for part in values):
        return not any(np.ndim(leaf) for leaf in jax.tree.leaves(values)) and jax.tree_util.all_leaves(
            jax.tree.leaves(values)
        )
    return len({np.shape(part) for part in values}) <= 1  # pyright: ignore[reportCallIssue, reportArgumentType]


def _merged(old: Parameters, values: Mapping[str, PyTree], prefix: str = "") -> dict[str, PyTree]:
    """The values of `old`, those that are given in their places."""
    require_names(values)
    found = old.asdict()
    for name, value in values.items():
        path = f"{prefix}{name}"
        if name not in found:
            raise ArgumentError(_unknown(name, old, prefix))
        inner, several = found[name], isinstance(value, (Mapping, Named))
        if isinstance(inner, Parameters) and not several:
            raise ArgumentError(f"`{path}` is several numbers, {', '.join(inner)}: replace it by a dictionary of some.")
        if several and not isinstance(inner, Parameters):
            kind = "one array of numbers" if jax.tree_util.all_leaves([inner]) else "a list"
            raise ArgumentError(f"`{path}` is {kind}, but is to be replaced by a dictionary.")
        if not isinstance(inner, (Parameters, Each)) and not jax.tree_util.all_leaves([inner]):
            value = _in_order(inner, _value(value, path))
            if jax.tree.structure(value) != jax.tree.structure(inner):
                raise ArgumentError(
                    f"`{path}` is a list or another PyTree of {len(jax.tree.leaves(inner))} arrays: replace it by one "
                    "of the same structure."
                )
        given = value.asdict() if isinstance(value, Named) else value
        found[name] = _merged(inner, given, f"{path}.") if isinstance(inner, Parameters) else given
    return found


def _in_order(old: PyTree, new: PyTree) -> PyTree:
    """`new` with the names of its parameters in the order of `old`, because JAX sorts the keys of dictionaries."""
    if isinstance(old, Parameters) and isinstance(new, Parameters) and set(old) == set(new):
        return Parameters(**{name: _in_order(getattr(old, name), getattr(new, name)) for name in old})
    if type(old) is tuple and type(new) is tuple and len(old) == len(new):
        return tuple(_in_order(one, other) for one, other in zip(old, new, strict=True))
    return new


def _unknown(name: str, old: Parameters, prefix: str) -> str:
    """The error for an unknown name: how to replace the number that it means, or the names that exist."""
    known = paths(old)
    meant = name if name in known else respelled(name.replace(".", "_"), known)
    head = meant.split(".")[0].split("[")[0]
    if head != meant and not isinstance(old.asdict().get(head), Parameters) and not prefix:
        return f"`{meant}` is within `{head}`, a list or another PyTree: replace {head} itself."
    if "." in meant:
        head, *rest = f"{prefix}{meant}".split(".")
        given = "…"
        for key in reversed(rest):
            given = f"{{'{key}': {given}}}"
        if meant == name:
            return f"`{prefix}{name}` is a number within `{head}`: replace it by {head}={given}."
        return f"There is no `{prefix}{name}` to replace: it is `{prefix}{meant}`, replaced by {head}={given}."
    inside, place = old, prefix
    for key in name.split(".")[:-1]:
        if key not in inside or not isinstance(inside.asdict()[key], Parameters):
            break
        inside, place = inside.asdict()[key], f"{place}{key}."
    where = f"in `{place[:-1]}` there is" if place else "there is"
    return f"There is no `{prefix}{name}` to replace; {where}: {', '.join(inside) or 'nothing'}."
