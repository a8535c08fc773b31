"""The parameters of a system: named float64 arrays, the leaves that one differentiates, varies and replaces."""

from __future__ import annotations

from collections.abc import Mapping

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.checks import float64
from coadjoint.errors import ArgumentError
from coadjoint.mechanics.members import Each
from coadjoint.paths import paths, respelled
from coadjoint.spaces.named import Named, require_names


@jax.tree_util.register_pytree_with_keys_class
class Parameters(Named):
    """Named parameters, kept as float64 and read as attributes: `p.mass`, `p.rudder.area`.

        p = co.Parameters(mass=123.8, inertia=np.diag([5.46, 5.29, 5.72]), rudder=dict(area=0.02))
        p.replace(mass=130.0, rudder=dict(area=0.03))  # the other numbers of the rudder stay

    **values: each a number, an array of any shape, a nested dictionary of these, or `co.each` of them. Units are those
    of the Lagrangian that reads them; models and vehicles use SI. They are a PyTree: JAX differentiates by them. Where
    a name is a text, as in `changing=("rudder.area",)` or on the command line, it is the path with points.

    Raises ArgumentError for float32, complex numbers, text and values that are not finite.
    """

    __slots__ = ()

    def __init__(self, **values: object):
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
        if isinstance(value, (Mapping, Named)) and not isinstance(value, Parameters):
            inner = _checked(value.asdict() if isinstance(value, Named) else value, f"{prefix}{name}.")
            value = Parameters.tree_unflatten(tuple(inner), inner.values())
        elif not isinstance(value, (Each, Parameters)):
            value = float64(value, f"Parameter `{prefix}{name}`")
            if isinstance(value, np.ndarray):
                value.flags.writeable = False  # a copy: a change of it in place would change a system
        found[name] = value
    return found


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
            raise ArgumentError(f"`{path}` is one array of numbers, but is to be replaced by a dictionary.")
        given = value.asdict() if isinstance(value, Named) else value
        found[name] = _merged(inner, given, f"{path}.") if several else given
    return found


def _unknown(name: str, old: Parameters, prefix: str) -> str:
    """The error for an unknown name: how to replace the number that it means, or the names that exist."""
    known = paths(old)
    meant = name if name in known else respelled(name.replace(".", "_"), known)
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
