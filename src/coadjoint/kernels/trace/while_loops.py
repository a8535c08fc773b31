"""Loops that stay loops in machine code, where the number of their trips depends on values, and their derivatives."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from coadjoint.arrays import Array, PyTree
from coadjoint.kernels.expressions.expression import Expr, Loop
from coadjoint.kernels.trace import structured
from coadjoint.kernels.trace.interpreter import Interpreter, symbolic
from coadjoint.kernels.trace.jaxprs import Equation
from coadjoint.kernels.untraceable import Untraceable


def keep_loop(test: Callable[[PyTree], Array], body: Callable[[PyTree], PyTree], start: PyTree) -> PyTree:
    """x with x ← body(x) while test(x), from `start`, as `jax.lax.while_loop`: a loop in machine code, too.

    Its result has no derivatives there; `with_slope` gives them. The carried arrays are of numbers.
    """

    def coadjoint_keep_loop(state: PyTree) -> PyTree:
        return jax.lax.while_loop(test, body, state)

    return jax.jit(coadjoint_keep_loop)(jax.lax.stop_gradient(start))


def with_slope(value: Array, slope: Array) -> Array:
    """`value`, with the derivatives of `slope`, an expression that has the same value; their shapes agree."""

    def coadjoint_with_slope(value: Array, slope: Array) -> Array:
        return jax.lax.stop_gradient(value) + (slope - jax.lax.stop_gradient(slope))

    return jax.jit(coadjoint_with_slope)(value, slope)


def is_kept(equation: Equation) -> bool:
    """Whether a call is that of `keep_loop`."""
    return equation.parameters.get("name") == "coadjoint_keep_loop"


def is_sloped(equation: Equation) -> bool:
    """Whether a call is that of `with_slope`, and not of a derivative of it."""
    named = equation.parameters.get("name") == "coadjoint_with_slope"
    return named and (len(equation.inputs), len(equation.outputs)) == (2, 1)


def kept(
    interpreter: Interpreter, loop: structured.While, of_test: list[Any], of_body: list[Any], carry: list[Any]
) -> list[np.ndarray]:
    """The carried arrays at the end of a loop of expressions, which carries its constants, too."""
    rules, moved = interpreter.expressions, [*of_test, *of_body]
    lifted = [rules["lift"]({}, x) for x in (*filter(symbolic, moved), *carry)]
    if any(node.is_truth for x in lifted for node in x.reshape(-1)):
        raise Untraceable("while", "it carries truth values, and the number of its trips depends on values")
    count = iter(range(sum(x.size for x in lifted)))
    depth = interpreter.depth
    inside = [_named(x, lambda: rules["symbol"]({}, f"carried {depth}.{next(count)}")) for x in lifted]
    begun = iter(inside)
    constants = [next(begun) if symbolic(x) else x for x in moved]
    state = list(begun)
    interpreter.depth += 1
    (test,) = interpreter.run(loop.test, [*constants[: len(of_test)], *state])
    following = interpreter.run(loop.body, [*constants[len(of_test) :], *state])
    interpreter.depth -= 1
    unchanged = inside[: len(inside) - len(state)]
    after = [rules["lift"]({}, x) for x in (*unchanged, *following)]
    found = rules["loop"](Loop(_flat(inside), test.reshape(-1)[0], _flat(after)), _flat(lifted))
    ends, outcomes = np.cumsum([x.size for x in lifted])[:-1], np.array(found, dtype=object)
    arrays = [part.reshape(x.shape) for part, x in zip(np.split(outcomes, ends), lifted, strict=True)]
    return arrays[len(unchanged) :]


def _named(like: np.ndarray, symbol: Callable[[], Expr]) -> np.ndarray:
    found = np.empty(like.shape, dtype=object)
    for index in np.ndindex(like.shape):
        found[index] = symbol()
    return found


def _flat(arrays: list[np.ndarray]) -> tuple[Expr, ...]:
    return tuple(node for x in arrays for node in x.reshape(-1))
