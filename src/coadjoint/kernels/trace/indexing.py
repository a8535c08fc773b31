"""Indices that depend on values: a load from constants, or a selection among all places where they may point."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from coadjoint.kernels.expressions.expression import Expr, reachable
from coadjoint.kernels.expressions.graph import Graph
from coadjoint.kernels.expressions.operations import Table
from coadjoint.kernels.trace.interpreter import Array, Rule, symbolic
from coadjoint.kernels.trace.jaxprs import EquationParameters
from coadjoint.kernels.trace.movement import MOVEMENT, arranged, scatters
from coadjoint.kernels.untraceable import Untraceable

Window = Callable[[Sequence[Expr], Sequence[int]], Array]
"""From starts and sizes along every axis to the elements of a window."""

MAX_SELECTIONS = 20_000
"""More would cost more than the step that reads them; the program goes to XLA instead."""


def indexing_rules(graph: Graph, lift: Callable[[Array], Array]) -> dict[str, Rule]:
    """Slices, gathers and their transpose whose starts are expressions; with numbers they are data movement."""

    tables = _Tables()

    def windows(x: Array) -> Window:
        """Windows of an array: of truth values, which are not loaded, as of expressions."""
        if x.dtype.kind in "fiu":
            return partial(_loaded, graph, tables.of(x), x.shape)
        return partial(window, graph, lift(x))

    def dynamic_slice(p: EquationParameters, x: Array, *starts: Array) -> Array:
        if not any(map(symbolic, starts)):
            return MOVEMENT["dynamic_slice"](p, lift(x), *starts)
        return windows(x)([_entry(graph, start) for start in starts], p["slice_sizes"])

    def gather(p: EquationParameters, operand: Array, indices: Array) -> Array:
        if not symbolic(indices):
            return MOVEMENT["gather"](p, lift(operand), indices)
        _require_few("gather", operand.size if symbolic(operand) else math.prod(p["slice_sizes"]), indices.shape[:-1])
        return _gather(graph, p, operand.shape, windows(operand), indices)

    added = scatters(graph.add, graph.sub, graph.mul, *(partial(graph.apply, name) for name in ("min", "max")))[
        "scatter-add"
    ]

    def scatter_add(p: EquationParameters, operand: Array, indices: Array, updates: Array) -> Array:
        if not symbolic(indices):
            return added(p, lift(operand), indices, lift(updates))
        return _scatter_add(graph, p, lift(operand), indices, lift(updates))

    return {"dynamic_slice": dynamic_slice, "gather": gather, "scatter-add": scatter_add}


def _entry(graph: Graph, index: Array) -> Expr:
    """An index as an expression."""
    value = index[()]
    return value if isinstance(value, Expr) else graph.constant(float(value))


def window(graph: Graph, x: Array, starts: Sequence[Expr], sizes: Sequence[int]) -> Array:
    """x[start : start + size] along every axis, the starts moved inside as XLA does."""
    for axis, (start, size) in enumerate(zip(starts, sizes, strict=True)):
        last = x.shape[axis] - size
        lines = [np.take(x, range(k, k + size), axis) for k in range(last + 1)]
        if last * lines[0].size > MAX_SELECTIONS:
            raise Untraceable("dynamic_slice", "its index depends on values and may point to too many places")
        chosen = lines[-1]
        for k in reversed(range(last)):
            here = graph.apply("le", start, graph.constant(float(k)))
            chosen = np.asarray(np.frompyfunc(lambda a, b, c=here: graph.select(c, a, b), 2, 1)(lines[k], chosen))
        x = chosen
    return x


class _Tables:
    """The tables of constants, each made once: a function may read the same constants many times."""

    def __init__(self) -> None:
        self.known: dict[tuple, tuple[Array, Table]] = {}

    def of(self, x: Array) -> Table:
        """The table of an array; the array is kept, so that no other array reuses its address."""
        place = x.ctypes.data, x.shape, x.strides, x.dtype.str
        if place not in self.known:
            self.known[place] = x, Table(x)
        return self.known[place][1]


def _loaded(graph: Graph, table: Table, shape: tuple[int, ...], starts: Sequence[Expr], sizes: Sequence[int]) -> Array:
    """`window` of constants, by the places of its elements among all of them in their order."""
    strides = [math.prod(shape[axis + 1 :]) for axis in range(len(shape))]
    first = graph.zero
    for start, stride, length, size in zip(starts, strides, shape, sizes, strict=True):
        moved = inside(graph, start, length - size)
        first = graph.add(first, graph.mul(moved, graph.constant(float(stride))))
    found = np.empty(tuple(sizes), object)
    for offset in np.ndindex(*sizes):
        ahead = sum(k * stride for k, stride in zip(offset, strides, strict=True))
        found[offset] = graph.entry(table, graph.add(first, graph.constant(float(ahead))))
    return found


def inside(graph: Graph, index: Expr, last: int) -> Expr:
    """An integer index moved to 0 … last; 0 for NaN, so that it always points into its array."""
    above = graph.select(graph.apply("lt", graph.zero, index), index, graph.zero)
    end = graph.constant(float(last))
    return graph.select(graph.apply("lt", above, end), above, end)


def _gather(graph: Graph, p: EquationParameters, shape: tuple[int, ...], window: Window, indices: Array) -> Array:
    d, sizes, lead = p.fields("dimension_numbers"), p["slice_sizes"], indices.shape[:-1]
    into, batching = d.start_index_map, (d.operand_batching_dims, d.start_indices_batching_dims)
    windows = np.empty((*lead, *sizes), object)
    for position in np.ndindex(*lead):
        starts = _starts(graph, indices, position, len(shape), into, batching)
        found = window(starts, sizes)
        if p.choice("mode") == "FILL_OR_DROP":
            found = _filled(graph, p, found, starts, [n - s for n, s in zip(shape, sizes, strict=True)])
        windows[position] = found
    return arranged(d, windows, len(lead))


def _require_few(primitive: str, size: int, lead: tuple[int, ...]) -> None:
    if size * math.prod(lead) > MAX_SELECTIONS:
        raise Untraceable(primitive, "its indices depend on values and may point to too many places")


def _starts(
    graph: Graph, indices: Array, position: tuple[int, ...], rank: int, into: Sequence[int], batching: tuple
) -> list[Expr]:
    """Where the window of one row of indices begins, along each axis."""
    starts = [graph.zero] * rank
    for column, axis in enumerate(into):
        starts[axis] = indices[(*position, column)]
    for axis, batch in zip(*batching, strict=True):
        starts[axis] = graph.constant(float(position[batch]))
    return starts


def _scatter_add(graph: Graph, p: EquationParameters, operand: Array, indices: Array, updates: Array) -> Array:
    """Each window of the updates is added wherever it may belong, times one where it does and zero elsewhere."""
    if any(node.op == "placeholder" for node in reachable([n for n in indices.reshape(-1) if isinstance(n, Expr)])):
        raise Untraceable("lu", "its factors are used outside a linear solve, for more than 3 unknowns")
    d, lead = p.fields("dimension_numbers"), indices.shape[:-1]
    _require_few("scatter-add", operand.size, lead)
    window = list(d.update_window_dims)
    gone = {*d.inserted_window_dims, *d.operand_batching_dims}
    kept = iter(updates.shape[axis] for axis in window)
    sizes = [1 if axis in gone else next(kept) for axis in range(operand.ndim)]
    ahead = [axis for axis in range(updates.ndim) if axis not in window]
    windows = updates.transpose([*ahead, *window]).reshape((*lead, *sizes))
    into, batching = d.scatter_dims_to_operand_dims, (d.operand_batching_dims, d.scatter_indices_batching_dims)
    clip = p.choice("mode") == "CLIP"
    last = [n - size for n, size in zip(operand.shape, sizes, strict=True)]
    out = operand.copy()
    for position in np.ndindex(*lead):
        starts = _starts(graph, indices, position, operand.ndim, into, batching)
        if clip:
            low = [graph.apply("max", start, graph.zero) for start in starts]
            starts = [graph.apply("min", s, graph.constant(float(n))) for s, n in zip(low, last, strict=True)]
        for place in np.ndindex(*(n + 1 for n in last)):
            here = graph.true
            for start, k in zip(starts, place, strict=True):
                here = graph.apply("and", here, graph.apply("eq", start, graph.constant(float(k))))
            cells = tuple(slice(k, k + size) for k, size in zip(place, sizes, strict=True))
            one = np.frompyfunc(lambda x, y, h=here: graph.add(x, graph.select(h, y, graph.zero)), 2, 1)
            out[cells] = one(out[cells], windows[position])
    return out


def _filled(graph: Graph, p: EquationParameters, found: Array, starts: Sequence[Expr], last: Sequence[int]) -> Array:
    """A window outside its array is filled, by NaN unless JAX says otherwise."""
    inside = graph.true
    for start, end in zip(starts, last, strict=True):
        low = graph.apply("le", graph.zero, start)
        high = graph.apply("le", start, graph.constant(float(end)))
        inside = graph.apply("and", inside, graph.apply("and", low, high))
    fill = graph.constant(math.nan if p["fill_value"] is None else float(p["fill_value"]))
    return np.asarray(np.frompyfunc(lambda x: graph.select(inside, x, fill), 1, 1)(found))
