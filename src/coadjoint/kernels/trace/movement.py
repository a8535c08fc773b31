"""Data movement: primitives that only place elements, the same for numbers and for expressions.

Indices must be numbers. Gather and scatter follow the definition in XLA's operation semantics.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.trace.interpreter import Array, Rule, symbolic
from coadjoint.kernels.trace.jaxprs import EquationParameters
from coadjoint.kernels.untraceable import Untraceable


def filled(shape: tuple[int, ...], value: object, like: Array) -> Array:
    """An array of `value`, of the dtype of `like`; `value` may be an expression."""
    out = np.empty(shape, like.dtype)
    out[...] = value
    return out


def _same(dtype: object, *arrays: Array) -> list[Array]:
    return list(arrays)


def _broadcast(p: EquationParameters, x: Array, *_: Array) -> Array:
    shape, placed = p["shape"], [1] * len(p["shape"])
    for axis, size in zip(p["broadcast_dimensions"], x.shape, strict=True):
        placed[axis] = size
    return np.broadcast_to(x.reshape(placed), shape)


def _slice(p: EquationParameters, x: Array) -> Array:
    strides = p["strides"] or (1,) * x.ndim
    return x[tuple(map(slice, p["start_indices"], p["limit_indices"], strides))]


def _starts(name: str, starts: tuple[Array, ...], shape: tuple[int, ...], sizes: tuple[int, ...]) -> list[slice]:
    if any(map(symbolic, starts)):
        raise Untraceable(name, "its indices depend on values")
    first = [min(max(int(s), 0), n - size) for s, n, size in zip(starts, shape, sizes, strict=True)]
    return [slice(f, f + size) for f, size in zip(first, sizes, strict=True)]


def _dynamic_slice(p: EquationParameters, x: Array, *starts: Array) -> Array:
    return x[tuple(_starts("dynamic_slice", starts, x.shape, p["slice_sizes"]))]


def _dynamic_update_slice(p: EquationParameters, x: Array, update: Array, *starts: Array) -> Array:
    out = x.astype(np.result_type(x, update))
    out[tuple(_starts("dynamic_update_slice", starts, x.shape, update.shape))] = update
    return out


def _pad(p: EquationParameters, x: Array, value: Array) -> Array:
    """Interior padding first, then the edges; a negative edge crops."""
    for axis, (low, high, interior) in enumerate(p["padding_config"]):
        size = x.shape[axis]
        inner = size + max(size - 1, 0) * interior
        spread = filled((*x.shape[:axis], inner, *x.shape[axis + 1 :]), value[()], x)
        spread[(slice(None),) * axis + (slice(None, None, interior + 1),)] = x
        spread = spread[(slice(None),) * axis + (slice(max(-low, 0), inner - max(-high, 0)),)]
        edges = [filled((*x.shape[:axis], max(e, 0), *x.shape[axis + 1 :]), value[()], x) for e in (low, high)]
        x = np.concatenate([edges[0], spread, edges[1]], axis)
    return x


def _split(p: EquationParameters, x: Array) -> list[Array]:
    ends = np.cumsum([0, *p["sizes"]])
    return [x[(slice(None),) * p["axis"] + (slice(a, b),)] for a, b in pairwise(ends)]


def _windows(
    name: str,
    shape: tuple[int, ...],
    indices: Array,
    sizes: list[int],
    dims: tuple,
    batching: tuple,
    clip: bool,
) -> tuple[Array, Array]:
    """Element numbers of every window, shape indices.shape[:-1] + sizes, and which windows lie inside."""
    if symbolic(indices):
        raise Untraceable(name, "its indices depend on values")
    into, of_operand, of_indices = dims, *batching
    lead = indices.shape[:-1]
    start = np.zeros((*lead, len(shape)), np.int64)
    for column, axis in enumerate(into):
        start[..., axis] = indices[..., column]
    for axis, batch in zip(of_operand, of_indices, strict=True):
        start[..., axis] = np.arange(shape[axis]).reshape([-1 if k == batch else 1 for k in range(len(lead))])
    last = np.asarray(shape) - np.asarray(sizes)
    inside = np.all((start >= 0) & (start <= last), axis=-1)
    if clip or not np.all(inside):
        start = np.clip(start, 0, last)
    offsets = np.indices(sizes).reshape(len(shape), -1).T
    cells = start[..., None, :] + offsets
    strides = np.asarray([int(np.prod(shape[axis + 1 :])) for axis in range(len(shape))], np.int64)
    return (cells @ strides).reshape(*lead, *sizes), inside | clip


def _gather(p: EquationParameters, operand: Array, indices: Array) -> Array:
    d, sizes = p.fields("dimension_numbers"), list(p["slice_sizes"])
    clip = p.choice("mode") == "CLIP"
    batching = (d.operand_batching_dims, d.start_indices_batching_dims)
    if (axis := _taken_along(d, operand.shape, indices, sizes)) is not None:
        lead = indices.shape[:-1]
        rows = np.take(operand, indices[..., 0], axis)
        first = range(axis, axis + len(lead))
        rows = rows.transpose([*first, *(k for k in range(rows.ndim) if k not in first)])
        return arranged(d, rows.reshape((*lead, *sizes)), len(lead))
    numbers, inside = _windows("gather", operand.shape, indices, sizes, d.start_index_map, batching, clip)
    inside = np.broadcast_to(inside.reshape((*inside.shape, *(1,) * len(sizes))), numbers.shape)
    values = operand.reshape(-1)[numbers]
    if not np.all(inside):
        if symbolic(operand):
            raise Untraceable("gather", "it reads outside its array")
        fill = np.nan if p["fill_value"] is None else p["fill_value"]
        values = np.where(inside, values, fill)
    return arranged(d, values, indices.ndim - 1)


def _taken_along(d: Any, shape: tuple[int, ...], indices: Array, sizes: list[int]) -> int | None:
    """The one axis along which a gather takes single places, all of them inside; None of other gathers."""
    if d.operand_batching_dims or len(d.start_index_map) != 1 or symbolic(indices):
        return None
    axis = d.start_index_map[0]
    alone = sizes == [1 if k == axis else size for k, size in enumerate(shape)]
    inside = alone and np.all((indices >= 0) & (indices < shape[axis]))
    return axis if inside else None


def arranged(dimensions: Any, windows: Array, lead: int) -> Array:
    """Windows (*lead, *sizes) as a gather returns them: without the collapsed axes, the others at their places."""
    gone = {*dimensions.collapsed_slice_dims, *dimensions.operand_batching_dims}
    kept = (size for axis, size in enumerate(windows.shape[lead:]) if axis not in gone)
    values = windows.reshape((*windows.shape[:lead], *kept))
    offsets = list(dimensions.offset_dims)
    ahead = [axis for axis in range(values.ndim) if axis not in offsets]
    return values.transpose(np.argsort([*ahead, *offsets]))


def _scatter(name: str, combine: Callable[[PyTree, PyTree], PyTree]) -> Rule:
    def rule(p: EquationParameters, operand: Array, indices: Array, updates: Array) -> Array:
        d = p.fields("dimension_numbers")
        window = list(d.update_window_dims)
        gone = {*d.inserted_window_dims, *d.operand_batching_dims}
        kept = iter(updates.shape[axis] for axis in window)
        sizes = [1 if axis in gone else next(kept) for axis in range(operand.ndim)]
        batching = (d.operand_batching_dims, d.scatter_indices_batching_dims)
        clip = p.choice("mode") == "CLIP"
        into = d.scatter_dims_to_operand_dims
        numbers, inside = _windows(name, operand.shape, indices, sizes, into, batching, clip)
        lead = [axis for axis in range(updates.ndim) if axis not in window]
        values = updates.transpose([*lead, *window]).reshape(-1)
        width = int(np.prod(sizes))
        out = np.array(operand, dtype=np.result_type(operand, updates)).reshape(-1)
        for number, value, valid in zip(numbers.reshape(-1), values, np.repeat(inside, width), strict=True):
            if valid:
                out[number] = combine(out[number], value)
        return out.reshape(operand.shape)

    return rule


def scatters(
    add: Callable, subtract: Callable, multiply: Callable, minimum: Callable, maximum: Callable
) -> dict[str, Rule]:
    """The scatter primitives, given how two elements combine."""
    combine = {"-add": add, "_add": add, "-sub": subtract, "-mul": multiply, "_mul": multiply}
    combine |= {"-min": minimum, "_min": minimum, "-max": maximum, "_max": maximum}
    rules = {f"scatter{suffix}": _scatter(f"scatter{suffix}", c) for suffix, c in combine.items()}
    return {"scatter": _scatter("scatter", lambda old, new: new), **rules}


MOVEMENT: dict[str, Rule] = {
    "broadcast_in_dim": _broadcast,
    "concatenate": lambda p, *xs: np.concatenate(xs, p["dimension"]),
    "copy": lambda p, x: x,
    "copy_p": lambda p, x: x,
    "device_put": _same,
    "dynamic_slice": _dynamic_slice,
    "dynamic_update_slice": _dynamic_update_slice,
    "expand_dims": lambda p, x: np.expand_dims(x, p["dimensions"]),
    "gather": _gather,
    "optimization_barrier": _same,
    "pad": _pad,
    "reshape": lambda p, x: x.reshape(p["new_sizes"]),
    "rev": lambda p, x: np.flip(x, p["dimensions"]),
    "slice": _slice,
    "split": _split,
    "stack": lambda p, *xs: np.stack(xs, p["axis"]),
    "tile": lambda p, x: np.tile(x, p["reps"]),
    "unstack": lambda p, x: [np.take(x, i, p["axis"]) for i in range(x.shape[p["axis"]])],
    "squeeze": lambda p, x: np.squeeze(x, tuple(p["dimensions"])),
    "stop_gradient": lambda p, x: x,
    "transpose": lambda p, x: x.transpose(p["permutation"]),
}
