"""Pickling of objects that hold functions, by the names of these; a function without a name raises an error."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import cached_property as derived
from functools import partial
from types import FunctionType
from typing import Any, ClassVar, Self

from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError

BY_VALUE = ("cloudpickle", "dill", "copy")
"""Modules that pickle functions by value."""


class Portable:
    """An object whose functions are looked up by name where it is unpickled; derived data are computed again.

    Raises ArgumentError for a lambda and for a function within another one, unless the pickler takes these by value.
    """

    def __getstate__(self) -> object:
        found = object.__getstate__(self)
        if isinstance(found, dict):
            kind = type(self)
            found = {name: one for name, one in found.items() if not isinstance(getattr(kind, name, None), derived)}
        require_portable(found, f"A {type(self).__name__}")
        return found


class Remade:
    """An object that holds machine code: it is pickled as the arguments that it was made from, and rebuilt from them.

    STANDING: the attributes of its current state, which are pickled with it.
    """

    STANDING: ClassVar[tuple[str, ...]] = ()

    def __new__(cls, *given: object, **named: object) -> Self:
        made = super().__new__(cls)
        made.__dict__["_made_from"] = given, named
        return made

    def __reduce__(self) -> tuple[object, ...]:
        given = self.__dict__["_made_from"]
        require_portable(given, f"A {type(self).__name__}")
        return _made, (type(self), *given), {name: self.__dict__[name] for name in self.STANDING}


def _made(kind: type[Remade], given: tuple[object, ...], named: Mapping[str, object]) -> Remade:
    return kind(*given, **named)


def require_portable(held: PyTree, what: str) -> None:
    """Raise ArgumentError where a function among values has no name in its module, unless it is taken by value."""
    if not _by_value():
        _require_named(held, what)


def _require_named(value: object, what: str) -> None:
    if isinstance(value, Mapping):
        for one in value.values():
            _require_named(one, what)
    elif isinstance(value, (tuple, list)):
        for one in value:
            _require_named(one, what)
    elif isinstance(value, partial):
        _require_named((value.func, value.args, value.keywords), what)
    elif isinstance(value, FunctionType) and _unnamed(value):
        code = value.__code__
        raise ArgumentError(
            f"{what} holds {value.__qualname__} of {code.co_filename}, line {code.co_firstlineno}, which cannot be "
            "pickled: write it as a function of a module, or use cloudpickle."
        )


def _unnamed(function: FunctionType) -> bool:
    found: Any = sys.modules.get(function.__module__)
    for name in function.__qualname__.split("."):
        found = getattr(found, name, None)
    return found is None or getattr(found, "__code__", function.__code__) is not function.__code__


def _by_value() -> bool:
    """Whether the current pickler takes functions by value, or belongs to copy.deepcopy."""
    frame = sys._getframe(1)
    while (frame := frame.f_back) is not None:
        name = str(frame.f_globals.get("__name__", ""))
        if name.partition(".")[0] in BY_VALUE or ".cloudpickle" in name:
            return True
    return False
