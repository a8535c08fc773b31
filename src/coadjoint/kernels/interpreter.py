"""Runs a jaxpr on NumPy arrays: of numbers where everything is known, of scalar expressions where it is not.

An array with dtype `object` holds expressions; every other array holds numbers. An equation whose inputs are
all numbers is computed by NumPy at once, so constant folding, loop counters and indices need no special care.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np
from jax.extend import core

Array = np.ndarray
Rule = Callable[..., Any]
Rules = Mapping[str, Rule]


class Untraceable(Exception):
    """A function uses something outside the tracer's language; `primitive` names it."""

    def __init__(self, primitive: str, reason: str = "") -> None:
        self.primitive = primitive
        super().__init__(f"The primitive `{primitive}` cannot be traced{': ' + reason if reason else ''}.")


class TooLarge(Untraceable):
    """A program is longer than is worth compiling."""

    def __init__(self, operations: int) -> None:
        self.primitive = "the whole step"
        Exception.__init__(self, f"The step comes to more than {operations:,} scalar operations.")


def symbolic(array: Array) -> bool:
    """Whether an array holds expressions."""
    return array.dtype == object


def jaxpr_of(function: Callable, *args: Any) -> tuple[core.ClosedJaxpr, Any]:
    """The jaxpr of a pure function of PyTrees of arrays, and the structure of its result.

    Floats of any width count as float64; the user's JAX configuration stays as it is.
    """
    shapes = jax.tree_util.tree_map(_shape, args)
    with jax.enable_x64(True):
        closed, result = jax.make_jaxpr(function, return_shape=True)(*shapes)
    return closed, jax.tree_util.tree_structure(result)


def _shape(leaf: Any) -> jax.ShapeDtypeStruct:
    dtype = np.dtype(getattr(leaf, "dtype", type(leaf)))
    return jax.ShapeDtypeStruct(np.shape(leaf), np.float64 if dtype.kind in "fO" else dtype)


class Interpreter:
    """Walks equations: `numeric` are the rules on numbers, `expressions` those on arrays with expressions.

    A rule takes the equation's parameters and its inputs and returns the output, or a list of outputs. A
    rule of `control` takes the interpreter first: it holds jaxprs of its own.
    """

    def __init__(self, numeric: Rules, control: Rules, expressions: Rules | None = None) -> None:
        self.numeric = numeric
        self.control = control
        self.expressions = expressions if expressions is not None else {}

    def closed(self, closed: Any, inputs: Sequence[Array]) -> list[Array]:
        """The outputs of a closed jaxpr, or of an open one without constants."""
        if isinstance(closed, core.ClosedJaxpr):
            return self.open(closed.jaxpr, [np.asarray(c) for c in closed.consts], inputs)
        return self.open(closed, [], inputs)

    def open(self, jaxpr: Any, constants: Sequence[Array], inputs: Sequence[Array]) -> list[Array]:
        """The outputs of a jaxpr whose constants are given."""
        values: dict[Any, Array] = dict(zip(jaxpr.constvars, constants, strict=True))
        values.update(zip(jaxpr.invars, inputs, strict=True))
        for equation in jaxpr.eqns:
            outputs = self._apply(equation, [_value(v, values) for v in equation.invars])
            values.update(zip(equation.outvars, outputs, strict=True))
        return [_value(v, values) for v in jaxpr.outvars]

    def _apply(self, equation: Any, arguments: list[Array]) -> list[Array]:
        name = equation.primitive.name
        rule = self.control.get(name)
        if rule is not None:
            return rule(self, equation.params, arguments)
        if any(map(symbolic, arguments)):
            _check_types(equation)
            whole = name == "div" and equation.outvars[0].aval.dtype.kind in "iu"
            rule = self.expressions.get("div_whole" if whole else name)
        else:
            rule = self.numeric.get(name)
        if rule is None:
            raise Untraceable(name)
        result = rule(equation.params, *arguments)
        if not equation.primitive.multiple_results:
            result = [result]
        return [_typed(r, v.aval.dtype) for r, v in zip(result, equation.outvars, strict=True)]


WHOLE = frozenset(("add", "sub", "mul", "neg", "min", "max", "abs", "sign", "integer_pow", "clamp", "select_n"))
WHOLE |= {"lt", "le", "gt", "ge", "eq", "ne", "convert_element_type", "reduce_sum", "reduce_max", "reduce_min"}
WHOLE |= {"broadcast_in_dim", "reshape", "squeeze", "slice", "concatenate", "transpose", "copy", "gather"}
WHOLE |= {"reduce_prod", "argmax", "argmin", "dynamic_slice", "square", "stack", "div", "rem", "and", "or"}
"""Primitives that mean the same for integers as for whole float64 numbers."""


def _check_types(equation: Any) -> None:
    """Refuses integers that depend on values, where float64 arithmetic would differ, and complex numbers."""
    name = equation.primitive.name
    for variable in (*equation.invars, *equation.outvars):
        kind = variable.aval.dtype.kind
        if kind == "c":
            raise Untraceable(name, "on complex numbers")
        if kind in "iu" and name not in WHOLE and variable in equation.invars[:1]:
            raise Untraceable(name, "on integers that depend on values")


def _value(variable: Any, values: Mapping[Any, Array]) -> Array:
    if isinstance(variable, core.Literal):
        return np.asarray(variable.val, dtype=variable.aval.dtype)  # pyright: ignore[reportAttributeAccessIssue]
    return values[variable]


def _typed(result: Any, dtype: Any) -> Array:
    """`result` as an array of the type that JAX announced; a bare expression becomes an array of one."""
    array = np.asarray(result)
    return array if array.dtype == object or array.dtype == dtype else array.astype(dtype)
