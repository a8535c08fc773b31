"""Runs a jaxpr on NumPy arrays: of numbers where all inputs are known, of scalar expressions elsewhere.

An array with dtype `object` holds expressions; every other array holds numbers. An equation whose inputs are all
numbers is computed by NumPy immediately, so constant folding, loop counters and indices need no special care.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.trace import jaxprs
from coadjoint.kernels.trace.jaxprs import Atom, Equation
from coadjoint.kernels.untraceable import Untraceable

Array = np.ndarray
Rule = Callable[..., PyTree]
Rules = Mapping[str, Rule]


def symbolic(array: Array) -> bool:
    """Whether an array holds expressions."""
    return array.dtype == object


class Interpreter:
    """Walks equations: `numeric` are the rules on numbers, `expressions` those on arrays with expressions.

    A rule takes the equation's parameters and its inputs and returns the output, or a list of outputs. A
    rule of `control` takes the interpreter, the equation and its inputs: its equations hold jaxprs.
    """

    def __init__(self, numeric: Rules, control: Rules, expressions: Rules | None = None) -> None:
        self.numeric = numeric
        self.control = control
        self.expressions = expressions if expressions is not None else {}
        self.looping, self.depth = False, 0
        """Whether a loop stays one where the number of its trips depends on values (`while_loops`), and in how many."""

    def run(self, jaxpr: object, inputs: Sequence[Array]) -> list[Array]:
        """The outputs of a jaxpr."""
        variables = jaxprs.variables(jaxpr)
        values: dict[Atom, Array] = dict(zip(variables.inputs, inputs, strict=True))
        values.update(zip(variables.constants, map(np.asarray, jaxprs.constants(jaxpr)), strict=True))
        for equation in jaxprs.equations(jaxpr):
            outputs = self._apply(equation, [_value(v, values) for v in equation.inputs])
            values.update(zip(equation.outputs, outputs, strict=True))
        return [_value(v, values) for v in variables.outputs]

    def _apply(self, equation: Equation, arguments: list[Array]) -> list[Array]:
        name = equation.name
        rule = self.control.get(name)
        if rule is not None:
            equation.require_known()
            return rule(self, equation, arguments)
        if any(map(symbolic, arguments)):
            _check_types(equation)
            whole = name == "div" and jaxprs.dtype(equation.outputs[0]).kind in "iu"
            rule = self.expressions.get("div_whole" if whole else name)
        else:
            rule = self.numeric.get(name)
        if rule is None:
            raise Untraceable(name)
        equation.require_known()
        result = rule(equation.parameters, *arguments)
        if not equation.several:
            result = [result]
        return [typed(r, jaxprs.dtype(v)) for r, v in zip(result, equation.outputs, strict=True)]


ON_INTEGERS = frozenset(("add", "sub", "mul", "neg", "min", "max", "abs", "sign", "integer_pow", "clamp", "select_n"))
ON_INTEGERS |= {"lt", "le", "gt", "ge", "eq", "ne", "convert_element_type", "reduce_sum", "reduce_max", "reduce_min"}
ON_INTEGERS |= {"broadcast_in_dim", "reshape", "squeeze", "slice", "concatenate", "transpose", "copy", "gather"}
ON_INTEGERS |= {"reduce_prod", "argmax", "argmin", "dynamic_slice", "square", "stack", "div", "rem", "and", "or"}
"""Primitives that mean the same for integers as for float64 numbers with integer values."""


def _check_types(equation: Equation) -> None:
    """Refuses integers that depend on values, where float64 arithmetic would differ, and complex numbers."""
    for variable in (*equation.inputs, *equation.outputs):
        kind = jaxprs.dtype(variable).kind
        if kind == "c":
            raise Untraceable(equation.name, "on complex numbers")
        if kind in "iu" and equation.name not in ON_INTEGERS and variable in equation.inputs[:1]:
            raise Untraceable(equation.name, "on integers that depend on values")


def _value(atom: Atom, values: Mapping[Atom, Array]) -> Array:
    number = jaxprs.number(atom)
    return values[atom] if number is None else number


def typed(result: PyTree, dtype: Any) -> Array:
    """`result` as an array of the type that JAX announced; a bare expression becomes an array of one."""
    array = np.asarray(result)
    return array if array.dtype == object or array.dtype == dtype else array.astype(dtype)
