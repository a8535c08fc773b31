"""A jaxpr on numbers as a straight-line program of NumPy operations, for a function that is called many times.

The operations and their results are bitwise those of the interpreter. Calls are inlined, constants are computed once,
common subexpressions are shared, and unused operations are dropped.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.trace import jaxprs, structured
from coadjoint.kernels.trace.interpreter import Array, Interpreter, typed
from coadjoint.kernels.trace.jaxprs import Equation
from coadjoint.kernels.trace.parameters import CALLS
from coadjoint.kernels.untraceable import Untraceable

WRITTEN_OUT = frozenset(CALLS) - {"custom_jvp_call"}
"""Calls that always run their one jaxpr."""


class _Operation(NamedTuple):
    """values[outputs] = function(*values[inputs]) of these types; several: whether the function returns a list."""

    function: Callable[..., PyTree]
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]
    dtypes: tuple[object, ...]
    several: bool


class Straight:
    """The operations of a jaxpr; raises Untraceable for a primitive without a rule."""

    def __init__(self, interpreter: Interpreter, jaxpr: object):
        self._interpreter = interpreter
        self._values: list[Array | None] = []
        self._operations: list[_Operation] = []
        self._numbers: dict[tuple, int] = {}
        self._seen: dict[tuple, tuple[int, ...]] = {}
        self._inputs = [self._place() for _ in jaxprs.variables(jaxpr).inputs]
        self._outputs = self._write(jaxpr, self._inputs)
        self._drop_unused()

    def __call__(self, inputs: Sequence[Array]) -> list[Array]:
        """The outputs of the jaxpr."""
        values: list[PyTree] = self._values.copy()
        for place, value in zip(self._inputs, inputs, strict=True):
            values[place] = value
        for function, places, outputs, dtypes, several in self._operations:
            _store(values, function(*[values[i] for i in places]), outputs, dtypes, several)
        return [values[i] for i in self._outputs]

    def given(self, first: Sequence[Array]) -> Straight:
        """The rest of the program where its first inputs are known: that of the others."""
        rest = copy(self)
        rest._values, rest._operations, rest._inputs = self._values.copy(), [], self._inputs[len(first) :]
        for place, value in zip(self._inputs, first, strict=False):
            rest._values[place] = value
        for operation in self._operations:
            function, places, outputs, dtypes, several = operation
            known = [rest._values[i] for i in places]
            if any(value is None for value in known):
                rest._operations.append(operation)
            else:
                _store(rest._values, function(*known), outputs, dtypes, several)
        return rest

    def _place(self, value: Array | None = None) -> int:
        self._values.append(value)
        return len(self._values) - 1

    def _number(self, value: Array) -> int:
        key = value.dtype.str, value.shape, value.tobytes()
        if key not in self._numbers:
            self._numbers[key] = self._place(value)
        return self._numbers[key]

    def _write(self, jaxpr: object, inputs: Sequence[int]) -> list[int]:
        """Inline a jaxpr on these places; returns the places of its outputs."""
        variables = jaxprs.variables(jaxpr)
        places: dict[Any, int] = dict(zip(variables.inputs, inputs, strict=True))
        constants = map(np.asarray, jaxprs.constants(jaxpr))
        places.update(zip(variables.constants, map(self._number, constants), strict=True))

        def place(atom: object) -> int:
            number = jaxprs.number(atom)
            return places[atom] if number is None else self._number(number)

        for equation in jaxprs.equations(jaxpr):
            given = tuple(map(place, equation.inputs))
            if equation.name in WRITTEN_OUT or self._has_plain_body(equation):
                equation.require_known()
                outputs = self._write(structured.body(equation), given)
            elif equation.name == "custom_linear_solve":
                equation.require_known()
                system = structured.linear_solve(equation)
                outputs = self._write(system.solve, [*given[system.of_solve], *given[system.constants :]])
            else:
                outputs = self._operation(equation, given)
            places.update(zip(equation.outputs, outputs, strict=True))
        return [place(atom) for atom in variables.outputs]

    def _has_plain_body(self, equation: Equation) -> bool:
        """Whether this is a function with its own derivative, other than a determinant with its own rule."""
        if equation.name != "custom_jvp_call":
            return False
        return not ("det" in self._interpreter.numeric and structured.is_determinant(equation))

    def _operation(self, equation: Equation, given: tuple[int, ...]) -> Sequence[int]:
        (function, several), key = self._function(equation), _key(equation, given)
        if key is not None and key in self._seen:
            return self._seen[key]
        dtypes = tuple(map(jaxprs.dtype, equation.outputs))
        outputs = tuple(self._place() for _ in dtypes)
        known = [self._values[i] for i in given]
        if all(value is not None for value in known):
            _store(self._values, function(*known), outputs, dtypes, several)
        else:
            self._operations.append(_Operation(function, given, outputs, dtypes, several))
        if key is not None:
            self._seen[key] = outputs
        return outputs

    def _function(self, equation: Equation) -> tuple[Callable[..., PyTree], bool]:
        """The rule of an equation as a function of its inputs, and whether it returns a list of outputs."""
        equation.require_known()
        interpreter, rule = self._interpreter, self._interpreter.control.get(equation.name)
        if rule is not None:
            return (lambda *inputs: rule(interpreter, equation, list(inputs))), True
        rule, parameters = interpreter.numeric.get(equation.name), equation.parameters
        if rule is None:
            raise Untraceable(equation.name)
        return partial(rule, parameters), equation.several

    def _drop_unused(self) -> None:
        needed, kept = set(self._outputs), []
        for operation in reversed(self._operations):
            if needed.intersection(operation.outputs):
                kept.append(operation)
                needed.update(operation.inputs)
        self._operations = kept[::-1]


def _store(
    values: list[PyTree], results: PyTree, outputs: Sequence[int], dtypes: Sequence[object], several: bool
) -> None:
    if not several:
        fits = type(results) is np.ndarray and results.dtype == dtypes[0]
        values[outputs[0]] = results if fits else typed(results, dtypes[0])
        return
    for output, result, dtype in zip(outputs, results, dtypes, strict=True):
        values[output] = typed(result, dtype)


def _key(equation: Equation, given: tuple[int, ...]) -> tuple | None:
    """The key of an operation, to find it again; None where it has parameters that cannot be compared."""
    if jaxprs.inner_jaxprs(equation.parameters):
        return None
    key = equation.name, given, tuple(sorted(equation.parameters.items()))
    try:
        hash(key)
    except TypeError:
        return None
    return key
