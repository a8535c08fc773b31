"""Tracing of a user's function by JAX, twice, with every error inside it as one sentence.

A compiled function is a snapshot of one trace. So it must be pure: its result may depend on its arguments and on
constants, but not on random numbers, clocks or values that it changes itself. Functions of the library are pure, and
are not traced for this check.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.checks import is_short
from coadjoint.errors import CoadjointError, LagrangianError, error_line
from coadjoint.kernels.trace import jaxprs
from coadjoint.kernels.trace.digest import digest
from coadjoint.mechanics.state import State
from coadjoint.spaces.named import Named

IMPURE = (
    "{} must be pure, but two readings of it differ: it takes random numbers, a clock or values that it changes; pass "
    "such things by co.Parameters, `t`, `inputs` or `internal`."
)
_KEPT = (
    "{} keeps a value of an earlier call, which has ended: let it compute everything from its arguments, or make "
    "tables "
    "with NumPy."
)
_known: ContextVar[bool] = ContextVar("known", default=False)


@contextmanager
def functions_known(known: bool) -> Generator[None]:
    """Inside this context, if `known`, all functions are the library's own, unchanged: pure, and in float64."""
    token = _known.set(known)
    try:
        yield
    finally:
        _known.reset(token)


@contextmanager
def in_words(what: str, arguments: tuple[object, ...] = ()) -> Generator[None]:
    """Turn every error inside a user's function, or by JAX about it, into a LagrangianError of one sentence."""
    try:
        yield
    except CoadjointError:
        raise
    except Exception as error:
        raise LagrangianError(_sentence(what, error, arguments)) from error


def _sentence(what: str, error: Exception, arguments: tuple[object, ...]) -> str:
    kind, said = type(error).__name__, error_line(error)
    if isinstance(error, jax.errors.UnexpectedTracerError):
        return _KEPT.format(what)
    if "RuntimeError" in kind and type(error).__module__.startswith("jax"):
        return f"{what} calls a Python function that raised an error: let it return numbers wherever the motion goes."
    if type(error).__module__.startswith("jax"):
        return (
            f"{what} cannot be differentiated by JAX ({kind}): write it with jax.numpy, without `if` on values, "
            "float() or NumPy functions of its arguments."
        )
    if "Tracer has no attribute" in said and any(isinstance(given, State) for given in arguments):
        name = said.split()[-1]
        return (
            f"{what} asks an array for `{name}`, which it does not have: what a dictionary of spaces has named is "
            f"read by `state.named`, as in state.named.a.{name}."
        )
    if kind == "TypeError" and "shape" in said:
        said += "; one value for each member of an ensemble is co.each(values)"
    return f"{what} raised {said}."


def trace(function: Callable[..., object], what: str, arguments: tuple[object, ...]) -> Any:
    """The jaxpr of a user's function; raises LagrangianError."""
    return _read(function, what, arguments)[0]


def _read(function: Callable[..., object], what: str, arguments: tuple[object, ...]) -> tuple[PyTree, PyTree]:
    """The jaxpr, and the result with shapes in the place of arrays, of a function that JAX has not traced before."""
    with in_words(what, arguments), jax.enable_x64(True):
        return jax.make_jaxpr(lambda *given: function(*given), return_shape=True)(*arguments)


def require_scalar(function: Callable[..., object], what: str, arguments: tuple[object, ...]) -> Any:
    """Raise LagrangianError unless the function is pure, returns one float64 number and holds no float32.

    Returns its jaxpr; None of functions that are known, and not read.
    """
    if _known.get():
        return None
    jaxpr, result = _read(function, what, arguments)
    if not hasattr(result, "shape") or result.shape != ():
        raise LagrangianError(f"{what} must return one number, but returns {_shown(result)}; use @ or jnp.sum.")
    if not jax.numpy.issubdtype(result.dtype, np.floating):
        raise LagrangianError(f"{what} must return a float64 number, but returns {result.dtype}.")
    _require_float64(function, what, arguments, jaxpr)
    return jaxpr


def _shown(result: Any) -> str:
    """The result of a function, in words."""
    if hasattr(result, "shape"):
        return str(result.shape)
    if result is None:
        return "nothing"
    kinds = {dict: "a dictionary", Named: "a dictionary", list: "a list", tuple: "a tuple"}
    return kinds.get(type(result), f"a {type(result).__name__}")


def require_float64(function: Callable[..., object], what: str, arguments: tuple[object, ...]) -> None:
    """Raise LagrangianError where the function is not pure, or holds or returns float32 numbers."""
    if _known.get():
        return
    _require_float64(function, what, arguments, trace(function, what, arguments))


def _require_float64(function: Callable[..., object], what: str, arguments: tuple[object, ...], jaxpr: object) -> None:
    shorts = any(is_short(output.dtype) for output in jaxprs.results(jaxpr))
    again = None if shorts or _holds_float32(jaxprs.lowered(jaxpr)) else _again(function, what, arguments)
    if again is None:
        raise LagrangianError(
            f"{what} holds float32 numbers, which have lost digits already (5.46 becomes 5.460000038): make its "
            "constants with NumPy or put them into co.Parameters, and leave out float32."
        )
    _require_same(what, jaxpr, again)


def _again(function: Callable[..., object], what: str, arguments: tuple[object, ...]) -> Any:
    """A second reading; None where float32 constants are promoted before JAX writes them down.

    Then the jaxpr does not show them, and a reading under strict promotion fails.
    """
    try:
        with jax.numpy_dtype_promotion("strict"):
            return trace(function, what, arguments)
    except LagrangianError as error:
        said = error_line(error.__cause__ or error)
        if "float32" in said or "float16" in said:
            return None
    return trace(function, what, arguments)


def _require_same(what: str, first: object, second: object) -> None:
    """Raise LagrangianError where two readings of one function differ, or the second holds a value of the first."""
    try:
        read = digest(jaxprs.lowered(first))
    except LagrangianError:  # Parameters that are being differentiated: what runs then is read with them as arguments.
        return
    try:
        same = digest(jaxprs.lowered(second)) == read
    except LagrangianError as error:
        raise LagrangianError(_KEPT.format(what)) from error
    if not same:
        raise LagrangianError(IMPURE.format(what))


def _holds_float32(jaxpr: object) -> bool:
    for equation in jaxprs.equations(jaxpr):
        types = [jaxprs.dtype(atom) for atom in (*equation.inputs, *equation.outputs)]
        if any(dtype is not None and is_short(dtype) for dtype in types):
            return True
        if any(map(_holds_float32, jaxprs.inner_jaxprs(equation.parameters))):
            return True
    return False
