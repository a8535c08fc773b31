"""JAX's program of a function as plain objects, which can be pickled, and read and run without JAX.

They have the attributes of a jaxpr that `kernels.trace.jaxprs` reads. Of the parameters of equations numbers, texts,
types, members of enumerations, named tuples and jaxprs stay; any other, such as a device, becomes `PlainUnread`.
"""

from __future__ import annotations

import enum
from collections.abc import Callable

import numpy as np

from coadjoint.arrays import PyTree


class Plain:
    """An object of attributes, equal to itself alone: an equation, a variable, its shape and type."""

    def __init__(self, **attributes: PyTree):
        vars(self).update(attributes)


class PlainProgram(Plain):
    """A jaxpr with its constants."""


class PlainNumber(Plain):
    """A number in the place of a variable."""

    val: np.ndarray


class PlainRecord(Plain):
    """A named tuple, such as the dimension numbers of a gather, or, with a `name`, a member of an enumeration."""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PlainRecord) and vars(self) == vars(other)

    def __hash__(self) -> int:
        return hash(tuple(vars(self).items()))


class PlainUnread(Plain):
    """A value that no rule reads."""


class Plainer:
    """Rewrites a jaxpr; each variable, and each jaxpr within, once."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[object, PyTree]] = {}

    def program(self, jaxpr: PyTree) -> PlainProgram:
        """A jaxpr, with or without its constants."""
        return self._once(jaxpr, self._program)

    def _once(self, value: PyTree, make: Callable[[PyTree], PyTree]) -> PyTree:
        if id(value) not in self._known:
            self._known[id(value)] = value, make(value)
        return self._known[id(value)][1]

    def _program(self, jaxpr: PyTree) -> PlainProgram:
        inner = getattr(jaxpr, "jaxpr", jaxpr)
        atoms = {name: [*map(self._atom, getattr(inner, name))] for name in ("constvars", "invars", "outvars")}
        source = getattr(getattr(inner, "debug_info", None), "func_src_info", None)
        return PlainProgram(
            **atoms,
            consts=[np.asarray(value) for value in getattr(jaxpr, "consts", ())],
            eqns=[self._equation(one) for one in inner.eqns],
            debug_info=Plain(func_src_info=source),
        )

    def _equation(self, equation: PyTree) -> Plain:
        primitive = equation.primitive
        return Plain(
            primitive=Plain(name=primitive.name, multiple_results=primitive.multiple_results),
            params={name: self._value(value) for name, value in equation.params.items()},
            invars=[*map(self._atom, equation.invars)],
            outvars=[*map(self._atom, equation.outvars)],
        )

    def _atom(self, atom: PyTree) -> Plain:
        if hasattr(atom, "val"):
            aval = self._once(atom.aval, _shape_and_type)
            return PlainNumber(val=np.asarray(atom.val, aval.dtype), aval=aval)
        return self._once(atom, lambda one: Plain(aval=self._once(one.aval, _shape_and_type)))

    def _value(self, value: PyTree) -> PyTree:
        if isinstance(value, enum.Enum):
            return PlainRecord(name=value.name)
        if value is None or isinstance(value, (bool, int, float, str, bytes, np.dtype, np.generic, np.ndarray)):
            return value
        if hasattr(value, "eqns") or hasattr(value, "jaxpr"):
            return self.program(value)
        if isinstance(value, tuple) and (fields := getattr(value, "_fields", None)) is not None:
            return PlainRecord(**{name: self._value(getattr(value, name)) for name in fields})
        if isinstance(value, (tuple, list)):
            return type(value)(map(self._value, value))
        return PlainUnread(kind=type(value).__name__)


def _shape_and_type(aval: PyTree) -> Plain:
    return Plain(shape=getattr(aval, "shape", ()), dtype=getattr(aval, "dtype", None))
