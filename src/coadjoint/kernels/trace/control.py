"""Primitives that hold jaxprs: calls, branches, loops; loops are unrolled, their counters fold, but for `keep_loop`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from coadjoint.kernels.trace import jaxprs, structured, while_loops
from coadjoint.kernels.trace.interpreter import Array, Interpreter, Rule, symbolic
from coadjoint.kernels.trace.jaxprs import Atom, Equation
from coadjoint.kernels.trace.parameters import CALLS
from coadjoint.kernels.untraceable import Untraceable

MAX_TRIPS = 2_000
"""A longer unrolled loop of expressions would take minutes to compile; it goes to XLA instead."""

PLAIN: dict[str, Callable] = {}
"""Name → the function in JAX of machine code that XLA's programs call by this name."""


def _call(interpreter: Interpreter, equation: Equation, inputs: list[Array]) -> list[Array]:
    if any(map(symbolic, inputs)) and while_loops.is_sloped(equation):
        return [np.asarray(interpreter.expressions["sloped"]({}, *inputs))]
    inside, before = structured.body(equation), interpreter.looping
    interpreter.looping |= while_loops.is_kept(equation)
    try:
        return interpreter.run(inside, inputs)
    finally:
        interpreter.looping = before


def _cond(interpreter: Interpreter, equation: Equation, inputs: list[Array]) -> list[Array]:
    """One branch where the index is known, else all of them and a selection (every branch is pure)."""
    index, operands, branches = inputs[0], inputs[1:], equation.parameters["branches"]
    if not symbolic(index):
        return interpreter.run(branches[int(np.clip(index, 0, len(branches) - 1))], operands)
    outcomes = [interpreter.run(branch, operands) for branch in branches]
    select = interpreter.expressions["select_n"]
    return [np.asarray(select({}, index, *values)) for values in zip(*outcomes, strict=True)]


def _scan(interpreter: Interpreter, equation: Equation, inputs: list[Array]) -> list[Array]:
    loop = structured.scan(equation)
    end = loop.constants + loop.carried
    constants, carry, slices = inputs[: loop.constants], inputs[loop.constants : end], inputs[end:]
    _check_trips("scan", loop.length, inputs)
    order = range(loop.length - 1, -1, -1) if loop.reverse else range(loop.length)
    rows: list[tuple[int, list[Array]]] = []
    for i in order:
        outputs = interpreter.run(loop.body, [*constants, *carry, *(np.asarray(s[i]) for s in slices)])
        carry = outputs[: loop.carried]
        rows.append((i, outputs[loop.carried :]))
    rows.sort(key=lambda row: row[0])
    results = equation.outputs[loop.carried :]
    return [*carry, *(_stack(interpreter, [row[j] for _, row in rows], v) for j, v in enumerate(results))]


def _stack(interpreter: Interpreter, rows: list[Array], variable: Atom) -> Array:
    if not rows:
        return np.zeros(jaxprs.shape(variable), jaxprs.dtype(variable))
    return interpreter.expressions["stack"]({"axis": 0}, *rows) if any(map(symbolic, rows)) else np.stack(rows)


def _while(interpreter: Interpreter, equation: Equation, inputs: list[Array]) -> list[Array]:
    loop = structured.while_loop(equation)
    end = loop.of_test + loop.of_body
    of_test, of_body, carry = inputs[: loop.of_test], inputs[loop.of_test : end], inputs[end:]
    trips = 0
    while True:
        (again,) = interpreter.run(loop.test, [*of_test, *carry])
        if symbolic(again) and interpreter.looping and again.size == 1:
            return while_loops.kept(interpreter, loop, of_test, of_body, carry)
        if symbolic(again):
            raise Untraceable("while", "the number of its trips depends on values")
        if not again.any():
            return carry
        trips += 1
        _check_trips("while", trips, carry)
        moved = interpreter.run(loop.body, [*of_body, *carry])
        carry = moved if again.all() else [_choose(again, new, old) for new, old in zip(moved, carry, strict=True)]


def _choose(members: Array, new: Array, old: Array) -> Array:
    """Under vmap a loop continues until its last member is done; those that are done stay."""
    return np.where(members.reshape(members.shape + (1,) * (new.ndim - members.ndim)), new, old)


def _check_trips(name: str, trips: int, values: list[Array]) -> None:
    if trips > MAX_TRIPS and any(map(symbolic, values)):
        raise Untraceable(name, f"it has more than {MAX_TRIPS} trips")


def _platform(interpreter: Interpreter, equation: Equation, inputs: list[Array]) -> list[Array]:
    """Which branch is meant for CPUs."""
    for i, platforms in enumerate(equation.parameters["platforms"]):
        if platforms is None or "cpu" in platforms:
            return [np.asarray(i, np.int32)]
    raise Untraceable("platform_index", "no branch is meant for CPUs")


def _linear_solve(interpreter: Interpreter, equation: Equation, inputs: list[Array]) -> list[Array]:
    """On numbers the solve that JAX carries along; on expressions our own elimination of the operator."""
    system = structured.linear_solve(equation)
    of_operator, right = inputs[: system.of_operator], inputs[system.constants :]
    if not any(map(symbolic, [*of_operator, *right])):
        return interpreter.run(system.solve, [*inputs[system.of_solve], *right])
    solve = interpreter.expressions["custom_linear_solve"]
    return solve(lambda x: interpreter.run(system.operator, [*of_operator, *x]), right)


def _custom_jvp(interpreter: Interpreter, equation: Equation, inputs: list[Array]) -> list[Array]:
    """The function itself; a determinant, which JAX writes in many ways, is known as one."""
    table = interpreter.expressions if any(map(symbolic, inputs)) else interpreter.numeric
    if "det" in table and structured.is_determinant(equation):
        return [np.asarray(table["det"]({}, inputs[0]))]
    return _call(interpreter, equation, inputs)


def _machine_code(interpreter: Interpreter, equation: Equation, inputs: list[Array]) -> list[Array]:
    """A function that XLA's programs call by its name, as the same function in JAX."""
    plain = PLAIN.get(equation.parameters["target_name"])
    if plain is None:
        raise Untraceable(equation.name)
    return interpreter.run(jaxprs.jaxpr_of(plain, *inputs)[0], inputs)


CONTROL: dict[str, Rule] = {
    **dict.fromkeys(CALLS, _call),
    "custom_jvp_call": _custom_jvp,
    "cond": _cond,
    "scan": _scan,
    "while": _while,
    "platform_index": _platform,
    "ffi_call": _machine_code,
    "custom_linear_solve": _linear_solve,
}
