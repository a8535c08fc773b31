"""Starts of runs that have been checked in this process, by what their functions do and by the numbers in them.

Every run reads all functions once and takes the digest of what it read (`mechanics.version`). What was checked for the
same digest, the same numbers, method and step size is not checked again: whatever changes what a function of the
system, its inputs, events or quantities does, be it a closure, a global, an array, an attribute or a function of a
library, changes its digest. Groups, spaces, difference maps and methods count by their classes and fields.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from coadjoint.kernels.trace.digest import digest
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.version import version
from coadjoint.methods.program import StepProgram

KEPT = 64
"""How many starts are remembered."""


class Known(NamedTuple):
    """What set-up found: the state as the method begins it, warnings, the program, and what monitors observe with."""

    state: State
    warnings: list[str]
    program: StepProgram
    watching: dict[str, Any]


class Reading(NamedTuple):
    """The digest of all functions as they were read, and the key of what was found for it."""

    version: str
    key: tuple[Any, ...]


_known: OrderedDict[tuple[Any, ...], Known] = OrderedDict()
_lock = threading.Lock()


def read(system: System, start: State, functions: list[Callable[[State], Any]], *more: Any) -> Reading | None:
    """Read all functions once; None where they cannot be read, which the checks put into words, or compared.

    more: what else the checks depend on, hashable.
    """
    try:
        numbers, structure = jax.tree_util.tree_flatten((system.parameters, start))
        seen = version(system, start, *functions)
        key = (replace_parameters(system, None), structure, seen, digest(numbers), *more)
        hash(key)
    except Exception:
        return None
    return Reading(seen, key)


def found(reading: Reading | None) -> Known | None:
    """What was found for this reading before, as a copy of its own."""
    if reading is None:
        return None
    with _lock:
        known = _known.get(reading.key)
        if known is not None:
            _known.move_to_end(reading.key)
    return None if known is None else _copied(known)


def remember(reading: Reading | None, known: Known) -> None:
    """Keep what was found for a reading."""
    if reading is None:
        return
    with _lock:
        _known[reading.key] = _copied(known)
        while len(_known) > KEPT:
            _known.popitem(last=False)


def _copied(known: Known) -> Known:
    state, watching = jax.tree.map(np.array, (known.state, known.watching))
    return Known(state, list(known.warnings), known.program, watching)
