"""A cache of checked starts of runs, keyed by the behaviour of their functions and by their numbers.

Every run reads all functions once and computes their digest (`mechanics.identity`). A start that was checked with the
same digest, numbers, method and step size is not checked again in this process. Any change in the behaviour of a
function of the system, its inputs, events or quantities changes the digest, whether through a closure, a global, an
array, an attribute or a function of a library. Groups, spaces, difference maps and methods are identified by their
classes and fields. Functions that reach the same values as at an earlier reading (`kernels.trace.reached`) are not read
again.

A system whose functions all belong to the library, such as a shipped vehicle, is not read: the files of the library and
the values that the functions hold identify it (`kernels.trace.identity`). The results of checks are kept on
disk for other processes (`kernels.run.disk_cache`) if groups, spaces, maps and methods are the library's.
"""

from __future__ import annotations

import copy
import threading
from collections import OrderedDict
from collections.abc import Callable
from typing import NamedTuple, TypeVar

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels import store
from coadjoint.kernels.run import disk_cache
from coadjoint.kernels.trace.digest import digest
from coadjoint.kernels.trace.identity import identity
from coadjoint.kernels.trace.jaxprs import trace_context
from coadjoint.kernels.trace.library import library
from coadjoint.kernels.trace.reached import numbers_of, reached
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.identity import NUMBERS, OPAQUE, parts, version
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.methods.program import StepProgram
from coadjoint.texts import Table

V = TypeVar("V")

KEPT = 64
"""The most starts that are remembered."""


class Known(NamedTuple):
    """The results of set-up: the state as the method begins it, warnings, the program, and values for the monitors."""

    state: State
    warnings: list[str]
    program: StepProgram
    watching: Table


class Reading(NamedTuple):
    """The digest of all functions when they were read, the key of the results for it, and their name on disk, if any.

    own: whether all functions belong to the library, so that none was read.
    """

    version: str
    key: tuple[PyTree, ...]
    name: str | None
    own: bool


_readings: OrderedDict[tuple[PyTree, ...], Reading] = OrderedDict()
"""Earlier readings by what their functions reached just before."""


_known: OrderedDict[tuple[PyTree, ...], Known] = OrderedDict()


_verdicts: OrderedDict[tuple[PyTree, ...], Table] = OrderedDict()


_lock = threading.Lock()


def read(
    system: System,
    start: State,
    functions: list[Callable[[State], PyTree]],
    events: object,
    observed: PyTree,
    *more: object,
) -> Reading | None:
    """Read all functions once; None if they cannot be read, which the checks report, or cannot be compared.

    functions: those of a state, including those of `events`, Events by names. observed: the monitors. more: further
    values on which the checks depend.
    """
    try:
        numbers, structure = jax.tree_util.tree_flatten((system.parameters, start))
        here = library()
        seen = _reached(system, functions, events, observed)
        same = None if seen is None else (structure, here, seen, numbers_of(numbers), observed, *more)
        known = None if same is None else _earlier(same)
        if known is not None:
            return known
        found = _read(system, start, (numbers, structure, here), functions, events, observed, *more)
    except Exception:
        return None
    if same is not None:
        _remember(_readings, same, found)
    return found


def _reached(
    system: System, functions: list[Callable[[State], PyTree]], events: object, observed: PyTree
) -> tuple[object, ...] | None:
    """All that the functions of a reading reach now, apart from its numbers, in this context; None if unknown."""
    context = trace_context()
    held = {name: one for name, one in vars(system).items() if name not in NUMBERS}
    more = None if context is None else reached(type(system), held, functions, events)
    return None if more is None else (context, *more)


def _earlier(same: tuple[PyTree, ...]) -> Reading | None:
    with _lock:
        known = _readings.get(same)
        if known is not None:
            _readings.move_to_end(same)
    return known


def _read(
    system: System,
    start: State,
    given: tuple[list[PyTree], PyTree, str | None],
    functions: list[Callable[[State], PyTree]],
    events: object,
    observed: PyTree,
    *more: object,
) -> Reading:
    """The reading by traces. given: numbers, their structure, and the digest of the library."""
    numbers, structure, here = given
    own = identity(parts(system), events, observed)
    whole = own is not None and own.library_only and here is not None
    if own is not None and whole:
        seen = f"{here} {own.digest}"
        key = (structure, seen, digest(numbers), *more)
    else:
        seen = version(system, start, *functions)
        key = (replace_parameters(system, None), structure, seen, digest(numbers), events, observed, *more)
    hash(key)
    plain, name = repr(structure), None
    if own is not None and here is not None and not seen.endswith(OPAQUE) and " at 0x" not in plain:
        name = disk_cache.name("start", own.digest, seen, plain, numbers, *more)
    return Reading(seen, key, name, whole)


def found(reading: Reading | None) -> Known | None:
    """A copy of the earlier results for this reading; None if there are none."""
    if reading is None:
        return None
    with _lock:
        known = _known.get(reading.key)
        if known is not None:
            _known.move_to_end(reading.key)
    return None if known is None else _copied(known)


def verdict(reading: Reading | None, purpose: str) -> Table | None:
    """A copy of the earlier results of checks for this purpose and reading, from this or another process."""
    if reading is None:
        return None
    with _lock:
        found = _verdicts.get((purpose, reading.key))
    if found is None:
        found = disk_cache.find(_named(reading, purpose))
        if found is not None:
            _remember_verdict(reading, purpose, found)
    return None if found is None else copy.deepcopy(found)


def remember_verdict(reading: Reading | None, purpose: str, found: Table) -> None:
    """Keep the results of checks, lists of texts and arrays of float64, here and for other processes."""
    if reading is None:
        return
    _remember_verdict(reading, purpose, found)
    disk_cache.keep(_named(reading, purpose), found)


def _remember_verdict(reading: Reading, purpose: str, found: dict[str, object]) -> None:
    """Keep it in this process."""
    _remember(_verdicts, (purpose, reading.key), copy.deepcopy(found))


def _named(reading: Reading, purpose: str) -> str | None:
    return None if reading.name is None else store.key(reading.name, purpose)


def remember(reading: Reading | None, known: Known) -> None:
    """Keep the results for a reading."""
    if reading is None:
        return
    _remember(_known, reading.key, _copied(known))


def _remember(kept: OrderedDict[tuple[PyTree, ...], V], key: tuple[PyTree, ...], value: V) -> None:
    with _lock:
        kept[key] = value
        while len(kept) > KEPT:
            kept.popitem(last=False)


def _copied(known: Known) -> Known:
    state, watching = jax.tree.map(np.array, (known.state, known.watching))
    return Known(state, list(known.warnings), known.program, watching)
