"""What set-up has found, beside the machine code on disk (`kernels.run.store`): texts, numbers and names as JSON.

The name under which something is kept says all that it follows from, the library among it. What may not have come from
the library as its files are now is not kept.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np

from coadjoint.kernels.run import store
from coadjoint.kernels.run.machine import processor
from coadjoint.kernels.trace.identity import identity
from coadjoint.kernels.trace.library import edited, library

_FORM = "1"
"""Changes whenever what is kept is written in another way."""


def name(*parts: Any) -> str | None:
    """A name for what follows from values by the library alone; None where they have no identity, or none is kept."""
    if store.folder() is None:
        return None
    own, here = identity(*parts), library()
    if own is None or here is None or not own.whole:
        return None
    return store.key(_FORM, *processor(), here, own.digest)


def recalled(parts: tuple[Any, ...], find_out: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """What follows from these parts by the library alone, as it was kept, or found out now and kept."""
    known = name(*parts)
    found = find(known)
    if found is None:
        found = find_out()
        keep(known, found)
        found = _read(_write(found))  # as it will be found
    return found


def find(name: str | None) -> Any:
    """What was kept under a name, or None."""
    content = None if name is None else store.fetch(name)
    return None if content is None else _read(content)


def keep(name: str | None, value: Any) -> None:
    """Keep a value, not None, of dictionaries with texts as keys, lists, texts, numbers and arrays of float64."""
    if name is not None and not edited():
        store.keep(name, _write(value))


def _write(value: Any) -> bytes:
    return json.dumps(value, default=_written).encode()


def _read(content: bytes) -> Any:
    return json.loads(content, object_hook=_array)


def _written(value: Any) -> Any:
    array = np.asarray(value)
    if array.dtype != np.float64:
        raise TypeError(f"What is kept must be float64, but is {array.dtype}.")
    return {"float64": array.tobytes().hex(), "shape": array.shape}


def _array(value: dict[str, Any]) -> Any:
    if set(value) != {"float64", "shape"}:
        return value
    return np.frombuffer(bytes.fromhex(value["float64"])).reshape(value["shape"]).copy()
