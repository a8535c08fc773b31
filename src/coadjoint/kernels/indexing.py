"""Indices that depend on values: a selection among all places where they may point."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jax import lax

from coadjoint.kernels.expression import Graph, Node
from coadjoint.kernels.interpreter import Array, Rule, Untraceable, symbolic
from coadjoint.kernels.movement import MOVEMENT, arranged

MAX_SELECTIONS = 20_000
"""More would cost more than the step that asks for them; the program goes to XLA instead."""


def indexing_rules(graph: Graph, lift: Callable[[Array], Array]) -> dict[str, Rule]:
    """Slices and gathers whose starts are expressions; with numbers they are data movement."""

    def dynamic_slice(p: Any, x: Array, *starts: Array) -> Array:
        if not any(map(symbolic, starts)):
            return MOVEMENT["dynamic_slice"](p, lift(x), *starts)
        return window(graph, lift(x), [_entry(graph, start) for start in starts], p["slice_sizes"])

    def gather(p: Any, operand: Array, indices: Array) -> Array:
        if not symbolic(indices):
            return MOVEMENT["gather"](p, lift(operand), indices)
        return _gather(graph, p, lift(operand), indices)

    return {"dynamic_slice": dynamic_slice, "gather": gather}


def _entry(graph: Graph, index: Array) -> Node:
    """An index as an expression."""
    value = index[()]
    return value if isinstance(value, Node) else graph.constant(float(value))


def window(graph: Graph, x: Array, starts: Sequence[Node], sizes: Sequence[int]) -> Array:
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


def _gather(graph: Graph, p: Any, operand: Array, indices: Array) -> Array:
    d, sizes, lead = p["dimension_numbers"], p["slice_sizes"], indices.shape[:-1]
    places = operand.size * math.prod(lead)
    if places > MAX_SELECTIONS:
        raise Untraceable("gather", "its indices depend on values and may point to too many places")
    windows = np.empty((*lead, *sizes), object)
    for position in np.ndindex(*lead):
        starts = [graph.zero] * operand.ndim
        for column, axis in enumerate(d.start_index_map):
            starts[axis] = indices[(*position, column)]
        for axis, batch in zip(d.operand_batching_dims, d.start_indices_batching_dims, strict=True):
            starts[axis] = graph.constant(float(position[batch]))
        found = window(graph, operand, starts, sizes)
        if p["mode"] == lax.GatherScatterMode.FILL_OR_DROP:
            found = _filled(graph, p, found, starts, [n - s for n, s in zip(operand.shape, sizes, strict=True)])
        windows[position] = found
    return arranged(d, windows, len(lead))


def _filled(graph: Graph, p: Any, found: Array, starts: Sequence[Node], last: Sequence[int]) -> Array:
    """A window outside its array is filled, by NaN unless JAX says otherwise."""
    inside = graph.true
    for start, end in zip(starts, last, strict=True):
        low = graph.apply("le", graph.zero, start)
        high = graph.apply("le", start, graph.constant(float(end)))
        inside = graph.apply("and", inside, graph.apply("and", low, high))
    fill = graph.constant(math.nan if p["fill_value"] is None else float(p["fill_value"]))
    return np.asarray(np.frompyfunc(lambda x: graph.select(inside, x, fill), 1, 1)(found))
