"""The identity of objects of the library, as digests that are equal in every process: classes by name, with their
state.

The code of the library counts by its files (`kernels.trace.library`). A foreign function is identified by its trace
alone: it may occur only where the caller traces it and adds the trace to the digest, as `Traced`. Any other foreign
object has no identity: a class of a user, an object of another package with state.
"""

from __future__ import annotations

import enum
import functools
import hashlib
import inspect
import sys
import types
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.trace import jaxprs
from coadjoint.kernels.trace.library import PACKAGES, homes

_PLAIN = (bool, int, float, complex, str, bytes, type(None), type(Ellipsis), np.dtype)
_BY_NAME = {*PACKAGES, "builtins", "math", "operator", "functools", "itertools"}


class NoIdentity(Exception):
    """A value among them has no known identity."""


class Traced(NamedTuple):
    """A function that the caller traces, so that it may be a user's."""

    function: Callable[..., PyTree]


class Shapes(NamedTuple):
    """A PyTree of which only structure, names and shapes count."""

    tree: PyTree


class ObjectIdentity(NamedTuple):
    """digest: of the values. library_only: whether all functions in them are the library's and need no trace."""

    digest: str
    library_only: bool


def identity(*values: object) -> ObjectIdentity | None:
    """The identity of these values; None if it is unknown."""
    walk = _Walk()
    try:
        walk.value(values)
    except (NoIdentity, RecursionError):
        return None
    return ObjectIdentity(walk.hasher.hexdigest(), walk.library_only)


class _Walk:
    """Feeds values to a hash; an object that comes again counts by its number."""

    def __init__(self) -> None:
        self.hasher = hashlib.sha256()
        self.library_only = True
        self._seen: dict[int, tuple[int, PyTree]] = {}

    def word(self, *parts: object) -> None:
        self.hasher.update(b"".join(f"{len(text)}:{text}".encode() for text in map(str, parts)) + b";")

    def value(self, value: Any) -> None:
        """Any value; raises NoIdentity."""
        if type(value) in _PLAIN or isinstance(value, np.dtype):
            self.word(type(value).__name__, repr(value))
        elif isinstance(value, jaxprs.Tracer):
            raise NoIdentity
        elif type(value) is np.ndarray or isinstance(value, (np.generic, jax.Array)):
            self._array(np.asarray(value))
        elif type(value) in (tuple, list):
            self._several(type(value).__name__, value)
        elif type(value) in (set, frozenset):
            self._several("set", sorted(value, key=repr))
        elif type(value) in (dict, types.MappingProxyType):
            self._mapping(value)
        elif isinstance(value, Traced):
            self._traced(value.function)
        elif isinstance(value, Shapes):
            self._shapes(value.tree)
        elif id(value) in self._seen:
            self.word("again", self._seen[id(value)][0])
        else:
            self._seen[id(value)] = len(self._seen), value
            self._object(value)

    def _array(self, array: np.ndarray) -> None:
        if array.dtype.hasobject:
            raise NoIdentity
        self.word("array", array.dtype.str, array.shape)
        self.hasher.update(array.tobytes())

    def _several(self, kind: str, values: PyTree) -> None:
        self.word(kind, len(values))
        for one in values:
            self.value(one)

    def _mapping(self, values: Mapping[Any, Any]) -> None:
        self.word("mapping", len(values))
        for key, one in values.items():
            self.value(key)
            self.value(one)

    def _shapes(self, tree: PyTree) -> None:
        leaves = jax.tree_util.tree_leaves_with_path(tree)
        self._several("shapes", [(jax.tree_util.keystr(path), np.shape(leaf)) for path, leaf in leaves])

    def _traced(self, function: Any) -> None:
        """By name, if it is the library's; otherwise by its own code alone, and the caller has the trace."""
        own = identity(function)
        if own is not None and own.library_only:
            self.word("function", own.digest)
            return
        self.library_only = False
        try:
            parameters = inspect.signature(function).parameters.values()
        except (TypeError, ValueError):
            raise NoIdentity from None
        self._several("traced", [(one.name, int(one.kind), one.default is one.empty) for one in parameters])
        self._body(getattr(getattr(function, "__func__", function), "__code__", None))

    def _object(self, value: Any) -> None:
        if isinstance(value, types.FunctionType):
            self._function(value)
        elif isinstance(value, types.MethodType):
            self._several("method", [value.__func__, value.__self__])
        elif isinstance(value, functools.partial):
            self._several("partial", [value.func, value.args, value.keywords])
        elif isinstance(value, enum.Enum):
            self._several("member", [type(value), value.name])
        elif isinstance(value, types.ModuleType):
            self._module(value.__name__, value)
        elif named(value):
            self.word("named", value.__module__, value.__qualname__)
        elif not isinstance(value, type) and of_library_alone(value):
            self._instance(value)
        else:
            raise NoIdentity

    def _module(self, name: str, module: types.ModuleType) -> None:
        if not by_name(name.partition(".")[0]) or sys.modules.get(name) is not module:
            raise NoIdentity
        self.word("module", name)

    def _function(self, function: Any) -> None:
        if not written_here(function):
            if _of_library(function) or not named(function):
                raise NoIdentity
            self.word("named", function.__module__, function.__qualname__)
            return
        self.word("function", function.__module__, function.__qualname__)
        self._code(function.__code__)
        try:
            held = [cell.cell_contents for cell in function.__closure__ or ()]
        except ValueError:  # a cell that is still empty
            raise NoIdentity from None
        self._several("holding", [held, function.__defaults__, function.__kwdefaults__])

    def _code(self, code: types.CodeType) -> None:
        """Functions of one name, such as those without any, differ by where they are written."""
        self.word("code", code.co_name, code.co_firstlineno, *next(iter(code.co_positions()), ()))
        self._body(code)

    def _body(self, code: object) -> None:
        if not isinstance(code, types.CodeType):
            self.word("no code")
            return
        self.word("body", code.co_names, code.co_varnames, code.co_freevars, code.co_code.hex(), len(code.co_consts))
        for one in code.co_consts:
            if isinstance(one, types.CodeType):
                self._body(one)
            else:
                self.value(one)

    def _instance(self, value: object) -> None:
        """An object by its class and its attributes, except those that it has derived from others."""
        self.word("instance", type(value).__module__, type(value).__qualname__)
        if isinstance(value, tuple):
            self._several("items", tuple(value))
        self._mapping(held_by(value))


def held_by(value: object) -> dict[str, Any]:
    """The attributes of an object, except those that it has derived from others."""
    kind = type(value)
    held = dict(getattr(value, "__dict__", {}))
    slots, derived = _attributes(kind)
    held.update((name, getattr(value, name)) for name in slots if hasattr(value, name))
    return {name: one for name, one in held.items() if name not in derived}


@functools.lru_cache(maxsize=1024)
def _attributes(kind: type) -> tuple[tuple[str, ...], frozenset[str]]:
    """The slots of a class, and the names of its derived attributes."""
    given = [base.__dict__.get("__slots__", ()) for base in kind.__mro__]
    names = [name for slots in given for name in ((slots,) if isinstance(slots, str) else slots)]
    derived = [name for name in dir(kind) if isinstance(getattr(kind, name, None), functools.cached_property)]
    return tuple(name for name in names if name not in ("__dict__", "__weakref__")), frozenset(derived)


def _root(value: object) -> str:
    return str(getattr(value, "__module__", "")).partition(".")[0]


def _of_library(value: object) -> bool:
    return _root(value) in homes()


def by_name(root: str) -> bool:
    """Whether a package is the library, or one whose version is in its identity."""
    return root in _BY_NAME or root in homes()


def written_here(function: Any) -> bool:
    """Whether the code of a function is the library's, whatever name it goes by."""
    home = str(function.__globals__.get("__name__")).partition(".")[0]
    return home in homes() and function.__code__.co_filename.startswith(str(homes()[home]))


def of_library_alone(value: object) -> bool:
    """Whether all classes that define the behaviour of an object are the library's."""
    return all(map(_of_library, _bases(value)))


def _bases(value: object) -> list[type]:
    """The classes that define the behaviour of an object."""
    plain = (object, tuple)
    return [one for one in type(value).__mro__ if one not in plain and _root(one) not in ("abc", "typing")]


def named(value: object) -> bool:
    """Whether a function or class is the one that its name stands for in the library or in a package of its version."""
    if not by_name(_root(value)):
        return False
    found: Any = sys.modules.get(value.__module__)
    for name in str(getattr(value, "__qualname__", None)).split("."):
        found = getattr(found, name, None)
    return found is value
