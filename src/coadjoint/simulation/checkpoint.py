"""Where a run stands, as a file: exact numbers, which check themselves."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import jax
import numpy as np

from coadjoint.archives import stored_arrays
from coadjoint.errors import FileError
from coadjoint.kernels.program import Code
from coadjoint.manifest import DAMAGED
from coadjoint.mechanics.state import State
from coadjoint.simulation.plan import MembersPosition, Position

Arrays = Mapping[str, np.ndarray]
AnyPosition = Position | MembersPosition
P = TypeVar("P", Position, MembersPosition)


def packed(header: Mapping[str, Any], arrays: Arrays) -> bytes:
    """A header and arrays as a NumPy archive, stored without compression, with its SHA-256 behind it."""
    body = io.BytesIO()
    text = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    np.savez(body, allow_pickle=False, header=text, **{f"array/{name}": values for name, values in arrays.items()})
    return body.getvalue() + hashlib.sha256(body.getbuffer()).digest()


def unpacked(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The header and the arrays in `path`; raises FileError where it is damaged."""
    data = path.read_bytes()
    body, sealed = data[:-32], data[-32:]
    damaged = FileError(f"The file {path} is damaged: {DAMAGED}.")
    if hashlib.sha256(body).digest() != sealed:
        raise damaged
    try:
        arrays = stored_arrays(body)
        header = json.loads(bytes(arrays.pop("header")))
    except (ValueError, KeyError, RecursionError) as error:
        raise damaged from error
    return header, {name.partition("/")[2]: values for name, values in arrays.items()}


def position_numbers(position: AnyPosition) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """All of a position, exactly: its numbers, and its arrays."""
    header: dict[str, Any] = {}
    arrays = state_numbers("state", position.state)
    for name in _counts(position):
        value = getattr(position, name)
        if isinstance(value, np.ndarray):
            arrays[f"position/{name}"] = value
        else:
            header[name] = int(value) if isinstance(value, Code) else value
    for name, (low, high) in position.extrema.items():
        arrays[f"lowest/{name}"], arrays[f"highest/{name}"] = np.asarray(low), np.asarray(high)
    return header, arrays


def position_at(header: Mapping[str, Any], arrays: Arrays, like: P) -> P:
    """The position that `position_numbers` took apart; `like` is one of the same system, method and members."""
    lows = {name.partition("/")[2]: low for name, low in arrays.items() if name.startswith("lowest/")}
    found = {name: header[name] if name in header else arrays[f"position/{name}"] for name in _counts(like)}
    if "code" in found:
        found["code"] = Code(found["code"])
    state = state_like("state", arrays, like.state)
    extrema = {name: (low, arrays[f"highest/{name}"]) for name, low in lows.items()}
    return dataclasses.replace(like, state=state, extrema=extrema, **found)


def _counts(position: AnyPosition) -> list[str]:
    """The fields of a position other than its state and the extrema."""
    return [field.name for field in dataclasses.fields(position) if field.name not in ("state", "extrema")]


def state_numbers(name: str, state: State) -> dict[str, np.ndarray]:
    """The leaves of a state, numbered."""
    return {f"{name}/{i}": np.asarray(leaf) for i, leaf in enumerate(jax.tree.leaves(state))}


def state_like(name: str, arrays: Arrays, like: State) -> State:
    """The state whose leaves are in `arrays`, in the structure of `like`; raises FileError where they do not fit."""
    leaves, structure = jax.tree.flatten(like)
    found = [arrays.get(f"{name}/{i}") for i in range(len(leaves))]
    shapes = [None if leaf is None else leaf.shape for leaf in found]
    if shapes != [np.shape(leaf) for leaf in leaves] or f"{name}/{len(leaves)}" in arrays:
        raise FileError("The checkpoint belongs to another system or method: its state has other shapes.")
    return jax.tree.unflatten(structure, found)
