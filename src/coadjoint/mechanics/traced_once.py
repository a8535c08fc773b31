"""Functions that JAX traces once for all uses in a program."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import jax

P = ParamSpec("P")
R = TypeVar("R")

Traced = dict[Callable[..., Any], Callable[..., Any]]
"""Functions, and the traces that JAX keeps of them."""

_traced: ContextVar[Traced | None] = ContextVar("traced", default=None)


@contextmanager
def tracing_once(known: Traced | None = None) -> Generator[None]:
    """Inside, functions that are marked `traced_once` are traced once for each kind of arguments.

    known: collects the traces, and shares them with other blocks that are given the same dictionary. The functions of a
    system must not change meanwhile.
    """
    token = _traced.set({} if known is None else known)
    try:
        yield
    finally:
        _traced.reset(token)


def traced_once(function: Callable[P, R]) -> Callable[P, R]:
    """A pure function of PyTrees of arrays that is traced once for each kind of arguments inside `tracing_once`."""

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        traced = _traced.get()
        if traced is None:
            return function(*args, **kwargs)
        if function not in traced:
            traced[function] = jax.jit(lambda *given, **named: function(*given, **named))
        return traced[function](*args, **kwargs)

    return call
