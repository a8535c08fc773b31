"""The meaning of primitives that hold jaxprs: calls, scans, whiles, linear solves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import jax

from coadjoint.arrays import PyTree
from coadjoint.kernels.trace.jaxprs import Atom, Equation, inner_jaxprs, opened, shape, unknown, variables


def body(equation: Equation) -> Any:
    """The jaxpr that a call, or a scan, runs: the only one that it holds."""
    found = inner_jaxprs(equation.parameters)
    if len(found) != 1:
        raise unknown(equation.name, f"{len(found)} jaxprs, of which coadjoint reads one")
    return found[0]


@dataclass(frozen=True, slots=True)
class Scan:
    """A body from constants, carried values and a row of each slice to carried values and rows of results."""

    body: PyTree
    constants: int
    carried: int
    length: int
    reverse: bool


def scan(equation: Equation) -> Scan:
    """The parts of a scan; its body takes slices, and gives results, with one axis less than the equation."""
    inside = body(equation)
    slices = _longer(equation, equation.inputs, variables(inside).inputs)
    results = _longer(equation, equation.outputs, variables(inside).outputs)
    carried = len(equation.outputs) - results
    before = len(equation.inputs) - slices - carried
    return Scan(inside, before, carried, equation.parameters["length"], equation.parameters["reverse"])


def _longer(equation: Equation, outside: Sequence[Atom], inside: Sequence[Atom]) -> int:
    """How many atoms, all of them at the end, have one axis more outside than inside."""
    if len(outside) != len(inside):
        raise unknown(equation.name, f"{len(outside)} values where its body has {len(inside)}")
    more = [len(shape(a)) - len(shape(b)) for a, b in zip(outside, inside, strict=True)]
    if more != sorted(more) or not {0, 1}.issuperset(more):
        raise unknown(equation.name, "inputs or outputs in an order that coadjoint does not know")
    return sum(more)


@dataclass(frozen=True, slots=True)
class While:
    """A test and a body, each with its constants before the carried values."""

    test: Any
    body: PyTree
    of_test: int
    of_body: int


def while_loop(equation: Equation) -> While:
    """The parts of a while: its inputs are the constants of the test, those of the body, and the carried values."""
    test, inside = equation.parameters["cond_jaxpr"], equation.parameters["body_jaxpr"]
    carried = len(equation.outputs)
    of_test, of_body = (len(variables(part).inputs) - carried for part in (test, inside))
    if of_test + of_body + carried != len(equation.inputs):
        raise unknown(equation.name, f"{len(equation.inputs)} inputs, other than its test and body take")
    return While(test, inside, of_test, of_body)


@dataclass(frozen=True, slots=True)
class LinearSolve:
    """A linear operator and a program that solves it, and how many constants come before the right sides."""

    operator: Any
    of_operator: int
    solve: Any
    of_solve: slice
    constants: int


def linear_solve(equation: Equation) -> LinearSolve:
    """The parts of a custom_linear_solve: constants of operator, transpose, solve and its transpose, then right
    sides."""
    lengths, jaxprs = equation.parameters.fields("const_lengths"), equation.parameters.fields("jaxprs")
    start = lengths.matvec + lengths.vecmat
    after = start + lengths.solve
    constants = after + lengths.transpose_solve
    return LinearSolve(jaxprs.matvec, lengths.matvec, jaxprs.solve, slice(start, after), constants)


def is_determinant(equation: Equation) -> bool:
    """Whether a call with a custom derivative is JAX's determinant, of any size and by any formula."""
    source = getattr(getattr(opened(body(equation)), "debug_info", None), "func_src_info", None) or ""
    name, _, place = source.partition(" at ")
    return name.startswith("_det") and place.startswith(_DETERMINANTS)


_DETERMINANTS = f"{jax.__path__[0]}/_src/numpy/linalg.py"
