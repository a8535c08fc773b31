"""Functions written with JAX as CasADi functions, with named arguments and sparse derivatives."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.checks import float64
from coadjoint.control.expressions import casadi_expressions
from coadjoint.control.library import casadi
from coadjoint.errors import ArgumentError, LagrangianError
from coadjoint.kernels.trace.tracer import Tracer, flat
from coadjoint.kernels.untraceable import Untraceable
from coadjoint.mechanics.trace_checks import in_words
from coadjoint.spaces.named import Named


def casadi_function(
    function: Callable[..., object], arguments: Mapping[str, object], name: str = "function", result: str = "value"
) -> Any:
    """`function` as a `casadi.Function` of arguments with these names: y = f(x₁, x₂, …).

        energy = co.control.casadi_function(lambda xi: 0.5 * xi @ xi, {"xi": np.zeros(3)})
        energy(xi=[1, 2, 3])["value"], energy.factory("slope", ["xi"], ["grad:value:xi"])

    function: pure, of arrays, written with jax.numpy; it returns one number, a vector or a matrix.
    arguments: name → an array of the shape of the argument, up to two axes; its numbers do not matter.
    name, result: what the function and its result are called in CasADi, by default "function" and "value".

    Raises ArgumentError for other arguments and where CasADi is not installed, LagrangianError for a function that
    JAX cannot trace, or that needs an operation that CasADi does not have, by the name of the operation.
    """
    checks.function(function, "function", "a function of arrays")
    ca, tracer = casadi(), Tracer()
    checks.mapping(arguments, "arguments", 'name → example, such as {"xi": np.zeros(3)}')
    known: dict[Any, Any] = {}
    symbols, columns = [], []
    for key, example in arguments.items():
        array = float64(example, f"Argument `arguments` under `{key}`")
        if array.ndim > 2:
            raise ArgumentError(f"Argument `arguments` under `{key}` must have at most two axes, but has {array.ndim}.")
        tree = tracer.symbols(f"{key} ", array)
        column = ca.SX.sym(key, *matrix_shape(array.shape))
        known.update(zip(flat(tree), entries(column, array.shape), strict=True))
        symbols.append(tree)
        columns.append(column)
    value = traced(tracer, "The function", function, *symbols)
    if isinstance(value, (Mapping, tuple, list, Named)):
        raise LagrangianError(
            "The function must return one number, a vector or a matrix, but returns several results: make a function "
            "of CasADi for each, or join them with jnp.concatenate."
        )
    outputs = matrix(ca, casadi_expressions(flat(value), known), np.shape(value))
    return ca.Function(name, columns, [outputs], list(arguments), [result])


def of_columns(tracer: Tracer, what: str, function: Callable[..., object], trees: Mapping[str, PyTree]) -> Any:
    """function(*trees) as a function of CasADi, of a column of numbers for each tree, to all numbers of its result.

    It takes a few µs. tracer: an unused one. what: the function in error messages.
    """
    ca, symbols = casadi(), [tracer.symbols(f"{name} ", tree) for name, tree in trees.items()]
    columns = [ca.SX.sym(name, len(flat(tree))) for name, tree in zip(trees, symbols, strict=True)]
    pairs = zip(columns, symbols, strict=True)
    known = {node: column[i] for column, tree in pairs for i, node in enumerate(flat(tree))}
    found = flat(traced(tracer, what, function, *symbols))
    return ca.Function("of_columns", columns, [ca.densify(ca.vertcat(*casadi_expressions(found, known)))])


def traced(tracer: Tracer, what: str, function: Callable[..., object], *arguments: object) -> Any:
    """function(*arguments) as expressions; raises LagrangianError if it has no such form."""
    return reader(tracer, what, function, *arguments)(*arguments)


def reader(tracer: Tracer, what: str, function: Callable[..., object], *like: object) -> Callable[..., Any]:
    """`traced` of any arguments of these shapes, which JAX traces once."""
    with _named(what):
        read = tracer.reader(function, *like)

    def of(*arguments: object) -> Any:
        with _named(what):
            return read(*arguments)

    return of


@contextmanager
def _named(what: str) -> Generator[None]:
    try:
        with in_words(what):
            yield
    except LagrangianError as error:
        if isinstance(error.__cause__, Untraceable):
            primitive = error.__cause__.primitive
            raise LagrangianError(
                f"{what} needs the operation `{primitive}`, which has no scalar expressions: write it without."
            ) from error
        raise


def matrix_shape(shape: tuple[int, ...]) -> tuple[int, int]:
    """Rows and columns of an array as CasADi's matrix; vectors are columns."""
    return (*shape, 1, 1)[:2]  # type: ignore[return-value]


def entries(column: Any, shape: tuple[int, ...]) -> list[PyTree]:
    """The scalars of CasADi's matrix in NumPy's order."""
    rows, width = matrix_shape(shape)
    return [column[i, j] for i in range(rows) for j in range(width)]


def matrix(ca: Any, scalars: list[object], shape: tuple[int, ...]) -> Any:
    """CasADi's matrix of scalars in NumPy's order."""
    if len(shape) > 2:
        raise LagrangianError(f"The function must return at most two axes for CasADi, but returns {len(shape)}.")
    rows, width = matrix_shape(shape)
    made = ca.SX(rows, width)
    for k, scalar in enumerate(scalars):
        made[k // width, k % width] = scalar
    return ca.sparsify(made)
