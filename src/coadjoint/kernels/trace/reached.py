"""The values that functions reach, compared to see that they compute what they computed before, without a trace.

A function reaches its code, its closure, its defaults, the globals that its code names, and all that these hold. Two
equal tuples of these mean the same trace. A function that reaches anything else, such as a module, a class or an object
of a user, a clock or a file, has no such tuple, and is traced each time.
"""

from __future__ import annotations

import dis
import enum
import functools
import types
from collections.abc import Iterator
from typing import Any

import jax
import numpy as np

from coadjoint.kernels.trace import jaxprs
from coadjoint.kernels.trace.identity import by_name, held_by, named, of_library_alone, written_here

MOST = 5000
"""The most values that are compared; beyond that a trace is no dearer."""

_EXACT = (int, bool, str, bytes, type(None), type(Ellipsis))
_OUTSIDE = {"open", "input", "globals", "locals", "vars", "eval", "exec", "compile", "id", "dir", "fromfile", "random"}
"""Names by which code reaches files, clocks, random numbers or variables that it does not name."""
_READERS = ("load", "read", "genfrom", "memmap", "__")
"""How further such names begin."""


class _Unknown(Exception):
    """A value among them cannot be compared."""


def reached(*values: object) -> tuple[object, ...] | None:
    """All that these values reach, as a tuple that is equal and hashes alike where they do the same; None if unknown.

    It holds the functions of users among them, so that none of these gives its place to another one.
    """
    walk = _Walk()
    try:
        walk.value(values)
    except (_Unknown, RecursionError):
        return None
    return tuple(walk.facts)


def numbers_of(leaves: list[Any]) -> tuple[object, ...]:
    """Types, shapes and bytes of numbers and arrays, as a tuple."""
    arrays = [np.asarray(leaf) for leaf in leaves]
    return tuple(part for array in arrays for part in (array.dtype.str, array.shape, array.tobytes()))


class _Walk:
    """Collects facts; an object that comes again counts by its number."""

    def __init__(self) -> None:
        self.facts: list[object] = []
        self._seen: dict[int, tuple[int, object]] = {}

    def value(self, value: Any) -> None:
        """Any value; raises _Unknown."""
        kind, facts = type(value), self.facts
        if len(facts) > MOST:
            raise _Unknown
        if kind in _EXACT:
            facts += kind, value
        elif kind in (float, complex):
            facts += kind, repr(value)
        elif kind is np.ndarray or isinstance(value, (np.generic, jax.Array)):
            self._array(value)
        elif kind in (tuple, list, set, frozenset):
            self._several(kind, value)
        elif kind in (dict, types.MappingProxyType):
            self._several(kind, (part for pair in value.items() for part in pair))
        elif id(value) in self._seen:
            facts += "again", self._seen[id(value)][0]
        else:
            self._seen[id(value)] = len(self._seen), value
            self._object(value)

    def _array(self, array: Any) -> None:
        if isinstance(array, jaxprs.Tracer) or array.dtype.hasobject:
            raise _Unknown
        array = np.asarray(array)
        self.facts += array.dtype.str, array.shape, array.tobytes()

    def _several(self, kind: type, values: Any) -> None:
        self.facts.append(kind)
        for one in values:
            self.value(one)
        self.facts.append(None)

    def _object(self, value: Any) -> None:
        if isinstance(value, types.FunctionType):
            self._function(value)
        elif isinstance(value, types.MethodType):
            self._several(types.MethodType, (value.__func__, value.__self__))
        elif type(value) is functools.partial:
            self._several(functools.partial, (value.func, value.args, value.keywords))
        elif isinstance(value, types.ModuleType):
            if not by_name(value.__name__.partition(".")[0]):
                raise _Unknown
            self.facts.append(value)
        elif named(value) or (isinstance(value, enum.Enum) and named(type(value))):
            self.facts.append(value)
        elif not isinstance(value, type) and of_library_alone(value):
            self.facts.append(type(value))
            self._several(dict, held_by(value).items())
            if isinstance(value, tuple):
                self._several(tuple, tuple(value))
        else:
            raise _Unknown

    def _function(self, function: Any) -> None:
        """The library's and its packages' functions that no closure changes count by themselves."""
        self.facts += function, function.__code__
        own = written_here(function)
        if not own and named(function):
            return
        try:
            held = [cell.cell_contents for cell in function.__closure__ or ()]
        except ValueError:  # a cell that is still empty
            raise _Unknown from None
        for one in (*held, function.__defaults__, function.__kwdefaults__):
            self.value(one)
        if own:
            return
        self.value(function.__dict__)
        for name in _globals(function.__code__):
            self._named_global(function, name)

    def _named_global(self, function: Any, name: str) -> None:
        if name in function.__globals__:
            self.value(function.__globals__[name])
            return
        try:
            self.value(function.__builtins__[name])
        except KeyError:
            raise _Unknown from None


def _globals(code: types.CodeType) -> tuple[str, ...]:
    """The globals that code names; raises _Unknown if it may reach others."""
    found = _globals_of(code)
    if found is None:
        raise _Unknown
    return found


@functools.lru_cache(maxsize=1024)
def _globals_of(code: types.CodeType) -> tuple[str, ...] | None:
    found: dict[str, None] = {}
    for one in _codes(code):
        if any(name in _OUTSIDE or name.startswith(_READERS) for name in one.co_names):
            return None
        for step in dis.get_instructions(one):
            if step.opname in ("IMPORT_NAME", "STORE_GLOBAL", "DELETE_GLOBAL"):
                return None
            if "GLOBAL" in step.opname or step.opname == "LOAD_NAME":
                found[str(step.argval)] = None
    return tuple(found)


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    """Code, and that of the functions written in it."""
    yield code
    for one in code.co_consts:
        if isinstance(one, types.CodeType):
            yield from _codes(one)
