"""Primitives that hold jaxprs: calls, branches, loops; loops are unrolled, their counters fold."""

from __future__ import annotations

from typing import Any

import numpy as np

from coadjoint.kernels.interpreter import Array, Interpreter, Rule, Untraceable, symbolic

MAX_TRIPS = 2_000
"""A longer unrolled loop of expressions would take minutes to compile; it goes to XLA instead."""


def _call(key: str) -> Rule:
    def rule(interpreter: Interpreter, parameters: Any, inputs: list[Array]) -> list[Array]:
        return interpreter.closed(parameters[key], inputs)

    return rule


def _cond(interpreter: Interpreter, parameters: Any, inputs: list[Array]) -> list[Array]:
    """One branch where the index is known, else all of them and a selection (every branch is pure)."""
    index, operands, branches = inputs[0], inputs[1:], parameters["branches"]
    if not symbolic(index):
        return interpreter.closed(branches[int(np.clip(index, 0, len(branches) - 1))], operands)
    outcomes = [interpreter.closed(branch, operands) for branch in branches]
    select = interpreter.expressions["select_n"]
    return [np.asarray(select({}, index, *values)) for values in zip(*outcomes, strict=True)]


def _scan(interpreter: Interpreter, parameters: Any, inputs: list[Array]) -> list[Array]:
    consts, carries = parameters["num_consts"], parameters["num_carry"]
    constants, carry, slices = inputs[:consts], inputs[consts : consts + carries], inputs[consts + carries :]
    length = parameters["length"]
    _check_trips("scan", length, inputs)
    order = range(length - 1, -1, -1) if parameters["reverse"] else range(length)
    rows: list[tuple[int, list[Array]]] = []
    for i in order:
        outputs = interpreter.closed(parameters["jaxpr"], [*constants, *carry, *(np.asarray(s[i]) for s in slices)])
        carry = outputs[:carries]
        rows.append((i, outputs[carries:]))
    rows.sort(key=lambda row: row[0])
    avals = parameters["jaxpr"].out_avals[carries:]
    return [*carry, *(_stack([row[j] for _, row in rows], aval) for j, aval in enumerate(avals))]


def _stack(rows: list[Array], aval: Any) -> Array:
    return np.stack(rows) if rows else np.zeros((0, *aval.shape), aval.dtype)


def _while(interpreter: Interpreter, parameters: Any, inputs: list[Array]) -> list[Array]:
    tests, consts = parameters["cond_nconsts"], parameters["body_nconsts"]
    of_test, of_body, carry = inputs[:tests], inputs[tests : tests + consts], inputs[tests + consts :]
    trips = 0
    while True:
        (again,) = interpreter.closed(parameters["cond_jaxpr"], [*of_test, *carry])
        if symbolic(again):
            raise Untraceable("while", "the number of its trips depends on values")
        if not again.any():
            return carry
        trips += 1
        _check_trips("while", trips, carry)
        moved = interpreter.closed(parameters["body_jaxpr"], [*of_body, *carry])
        carry = moved if again.all() else [_choose(again, new, old) for new, old in zip(moved, carry, strict=True)]


def _choose(members: Array, new: Array, old: Array) -> Array:
    """Under vmap a loop goes on until its last member is done; those that are done stay."""
    return np.where(members.reshape(members.shape + (1,) * (new.ndim - members.ndim)), new, old)


def _check_trips(name: str, trips: int, values: list[Array]) -> None:
    if trips > MAX_TRIPS and any(map(symbolic, values)):
        raise Untraceable(name, f"it has more than {MAX_TRIPS} trips")


def _platform(interpreter: Interpreter, parameters: Any, inputs: list[Array]) -> list[Array]:
    """Which branch is meant for CPUs."""
    for i, platforms in enumerate(parameters["platforms"]):
        if platforms is None or "cpu" in platforms:
            return [np.asarray(i, np.int32)]
    raise Untraceable("platform_index", "no branch is meant for CPUs")


def _linear_solve(interpreter: Interpreter, parameters: Any, inputs: list[Array]) -> list[Array]:
    """On numbers the solve that JAX carries along; on expressions our own elimination of the operator."""
    lengths, jaxprs = parameters["const_lengths"], parameters["jaxprs"]
    count = sum(lengths)
    right = inputs[count:]
    of_operator = inputs[: lengths.matvec]
    if not any(map(symbolic, [*of_operator, *right])):
        start = lengths.matvec + lengths.vecmat
        return interpreter.closed(jaxprs.solve, [*inputs[start : start + lengths.solve], *right])
    solve = interpreter.expressions["custom_linear_solve"]
    return solve(lambda x: interpreter.closed(jaxprs.matvec, [*of_operator, *x]), right)


def _custom_jvp(interpreter: Interpreter, parameters: Any, inputs: list[Array]) -> list[Array]:
    """The function itself; JAX writes determinants as exp(log|det|), which the tracer takes apart again."""
    table = interpreter.expressions if any(map(symbolic, inputs)) else interpreter.numeric
    if parameters.get("name") == "_det" and "det" in table:
        return [np.asarray(table["det"]({}, inputs[0]))]
    return interpreter.closed(parameters["call_jaxpr"], inputs)


CONTROL: dict[str, Rule] = {
    **dict.fromkeys(("jit", "pjit", "checkpoint", "remat", "remat2", "composite"), _call("jaxpr")),
    **dict.fromkeys(("closed_call", "core_call", "custom_vjp_call"), _call("call_jaxpr")),
    "custom_vjp_call_jaxpr": _call("fun_jaxpr"),
    "custom_jvp_call": _custom_jvp,
    "cond": _cond,
    "scan": _scan,
    "while": _while,
    "platform_index": _platform,
    "custom_linear_solve": _linear_solve,
}
