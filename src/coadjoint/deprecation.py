"""Names and arguments that work as before for at least one minor version, and say what to write instead."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from coadjoint.errors import ArgumentError, warn

P = ParamSpec("P")
R = TypeVar("R")


def announce(name: str, instead: str, until: str, stacklevel: int = 1) -> None:
    """Warn that `name` goes in version `until`, and name what to write instead; the warning is that of the caller."""
    warn(f"`{name}` is deprecated and goes in {until}; write `{instead}`.", stacklevel + 1, DeprecationWarning)


def deprecated(instead: str, until: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorate a function that goes in version `until`: it works as before, and each call warns.

        @deprecated("co.simulate", until="0.4")
        def integrate(system, start): ...

    instead: what to write. The warning is a DeprecationWarning of the line that calls.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        @functools.wraps(function)
        def call(*arguments: P.args, **named: P.kwargs) -> R:
            announce(f"{function.__module__.partition('.')[0]}.{function.__qualname__}", instead, until, 2)
            return function(*arguments, **named)

        return call

    return decorate


def renamed(until: str, **now: str) -> Callable[[Callable[..., R]], Callable[..., R]]:
    """Decorate a function whose arguments have new names: the earlier ones are taken until version `until`.

        @renamed(until="0.4", step="dt")
        def simulate(system, *, dt): ...

    now: the new name of an argument by its earlier one. Each earlier name warns, as `deprecated` does; both names
    together raise ArgumentError. The signature shows the new names alone.
    """

    def decorate(function: Callable[..., R]) -> Callable[..., R]:
        known = inspect.signature(function).parameters
        if strange := [name for name in now.values() if name not in known]:
            raise ArgumentError(
                f"`{function.__qualname__}` has no argument `{strange[0]}` to which another is renamed."
            )

        @functools.wraps(function)
        def call(*arguments: object, **named: object) -> R:
            for earlier in [name for name in named if name in now]:
                announce(f"{function.__qualname__}({earlier}=…)", f"{now[earlier]}=…", until, 2)
                if now[earlier] in named:
                    raise ArgumentError(f"Arguments `{earlier}` and `{now[earlier]}` are one: leave out `{earlier}`.")
                named[now[earlier]] = named.pop(earlier)
            return function(*arguments, **named)

        return call

    return decorate
