"""How the user's functions must be called."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import lru_cache

from coadjoint.arrays import PyTree
from coadjoint.errors import LagrangianError, shown


def parameters_of(function: Callable[..., object]) -> Mapping[str, inspect.Parameter]:
    """The parameters of a function, which are read once."""
    try:
        return _parameters_of(function)
    except TypeError:  # an object of a user that cannot be hashed
        return inspect.signature(function).parameters


@lru_cache(maxsize=256)
def _parameters_of(function: Callable[..., object]) -> Mapping[str, inspect.Parameter]:
    return inspect.signature(function).parameters


def keyword_only(known: Mapping[str, inspect.Parameter], key: str) -> bool:
    """Whether a function of these parameters takes `key` by keyword only."""
    return key in known and known[key].kind is inspect.Parameter.KEYWORD_ONLY


GIVEN = frozenset(("xi", "mu", "n", "nu", "pi", "a", "p", "t", "inputs", "internal", "state", "motion"))
"""The arguments that functions may take: an argument of such a name is not a constant, whatever its default."""


COMES_WITH = {"n": "additional", "nu": "additional", "pi": "additional", "a": "advected", "p": "parameters"}
"""Which argument of a system gives its functions an argument."""


def require_signature(function: Callable[..., PyTree], what: str, expected: list[str]) -> None:
    """Raise LagrangianError unless the function can be called with the expected positional arguments.

    Further arguments with defaults, as of closures `def l(xi, k=k)`, are the constants that they stand for.
    """
    try:
        signature = inspect.signature(function)
    except Exception as error:
        raise LagrangianError(f"{what} must be a Python function, but is {shown(function)}.") from error
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    places = [p for p in signature.parameters.values() if p.kind in kinds]
    constant = {p.name for p in places[len(expected) :] if p.default is not p.empty and p.name not in GIVEN}
    takes = [p.name for p in places if p.name not in constant]
    extra = [
        p.name
        for p in signature.parameters.values()
        if p.kind is inspect.Parameter.KEYWORD_ONLY
        and p.name not in ("t", "inputs", "internal")
        and p.default is p.empty
    ]
    moved = [name for name, place in zip(takes, expected, strict=False) if name in expected and name != place]
    if moved:
        raise LagrangianError(
            f"{what} must take ({', '.join(expected)}) in this order, but takes ({', '.join(takes)}): "
            "arguments are passed by position."
        )
    named = [p.name for p in places[len(expected) :] if p.default is not p.empty and p.name in GIVEN]
    if named and takes == [*expected, *named]:
        name, comes_with = named[0], COMES_WITH.get(named[0])
        remedy = (
            f"comes with `{comes_with}`, so that it is no constant: rename it, or give the system `{comes_with}`"
            if comes_with
            else f"is given by keyword only: put it behind a star, as in ({', '.join(expected)}, *, {name})"
        )
        raise LagrangianError(
            f"{what} of this system must take ({', '.join(expected)}): the argument "
            f"`{name}={shown(signature.parameters[name].default)}` {remedy}."
        )
    open_ended = any(p.kind is inspect.Parameter.VAR_POSITIONAL for p in signature.parameters.values())
    if extra or (len(takes) != len(expected) and not open_ended):
        raise LagrangianError(
            f"{what} of this system must take ({', '.join(expected)}), but takes ({', '.join(takes + extra)}): "
            + ("p comes" if "motion" in expected else "n and nu, or pi, come with `additional`, a with `advected`, p")
            + " with `parameters`."
        )
