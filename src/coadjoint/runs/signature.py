"""The signature of a system without its parameters, compared within a process: do members differ in numbers only?

A function counts by its code and by all that it reads: closures, defaults, and the values of its global names when the
system is made. Objects of unknown types count by identity, so that two of them differ.
"""

from __future__ import annotations

import functools
import types
from collections.abc import Hashable, Mapping
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from coadjoint.kernels.trace.jaxprs import Tracer
from coadjoint.kernels.trace.library import homes

if TYPE_CHECKING:
    from coadjoint.mechanics.system import System

_LEFT_OUT = ("parameters", "checks")

Seen = dict[int, tuple[int, Any]]
"""Objects that came before, by their addresses, with their numbers."""


def signature(system: System) -> Hashable:
    """The signature of a system; equal ones are of systems that differ in parameters only."""
    seen: Seen = {}
    names = [name for name in type(system).__dataclass_fields__ if name not in _LEFT_OUT]
    return tuple(_of(getattr(system, name), seen) for name in names)


def _of(value: object, seen: Seen) -> Hashable:
    if isinstance(value, (bool, int, float, complex, str, bytes, type(None))):
        return type(value), repr(value)
    if isinstance(value, (np.ndarray, np.generic, jax.Array)) and not isinstance(value, Tracer):
        array = np.asarray(value)
        return (array.shape, array.dtype.str, array.tobytes()) if not array.dtype.hasobject else id(value)
    if isinstance(value, (type, types.ModuleType, types.BuiltinFunctionType)) or _is_fixed(value):
        return id(value)
    if id(value) in seen:
        return "again", seen[id(value)][0]
    seen[id(value)] = len(seen), value  # which keeps the address taken
    if isinstance(value, (list, tuple)):
        return type(value), *(_of(one, seen) for one in value)
    if isinstance(value, Mapping):
        return "mapping", *((_of(key, seen), _of(one, seen)) for key, one in value.items())
    if isinstance(value, types.FunctionType):
        return _function(value, seen)
    if isinstance(value, types.MethodType):
        return "method", _of(value.__func__, seen), _of(value.__self__, seen)
    if isinstance(value, functools.partial):
        return "partial", *(_of(one, seen) for one in (value.func, value.args, value.keywords))
    if hasattr(value, "__dict__"):
        kind = type(value)
        own = {name: one for name, one in vars(value).items() if not _is_derived(kind, name)}
        return id(kind), _of(own, seen)
    return id(value)


def _is_fixed(value: object) -> bool:
    """Whether this is a function of the library that holds nothing."""
    return (
        isinstance(value, types.FunctionType)
        and not value.__closure__
        and value.__module__.partition(".")[0] in homes()
    )


def _is_derived(kind: type, name: str) -> bool:
    return isinstance(getattr(kind, name, None), functools.cached_property)


def _function(function: types.FunctionType, seen: Seen) -> Hashable:
    try:
        held = [cell.cell_contents for cell in function.__closure__ or ()]
    except ValueError:  # a cell that is empty yet
        return id(function)
    names = _names(function.__code__)
    read = {name: function.__globals__[name] for name in names if name in function.__globals__}
    modules = [one for one in read.values() if isinstance(one, types.ModuleType)]
    constants = [(name, getattr(one, name, None)) for one in modules for name in names]
    plain = [pair for pair in constants if isinstance(pair[1], (bool, int, float, np.ndarray, np.generic))]
    parts = (held, function.__defaults__, function.__kwdefaults__, read, plain)
    return function.__code__, *(_of(part, seen) for part in parts)


@functools.lru_cache(maxsize=256)
def _names(code: types.CodeType) -> tuple[str, ...]:
    """The names that a function and those within it read."""
    inner = (name for one in code.co_consts if isinstance(one, types.CodeType) for name in _names(one))
    return tuple(dict.fromkeys((*code.co_names, *inner)))
