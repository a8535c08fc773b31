"""Which kernel runs a program: native code where it can be traced, XLA otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import Literal

import numpy as np

from coadjoint.arrays import PyTree, Scalar
from coadjoint.errors import ArgumentError, shown, warn
from coadjoint.interrupts import look
from coadjoint.kernels.chunk import Chunk, EnsembleChunk
from coadjoint.kernels.program import Program
from coadjoint.kernels.run import ensemble, linked_members, native, observed, xla
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.untraceable import Untraceable

Backend = Literal["auto", "native", "xla"]

_told: set[str] = set()
CALLBACKS = ("pure_callback", "bitcast_convert_type")
"""Primitives with which a Python function is called at every step."""
OUTSIDE = "A function of this system is called from outside JAX, which no native kernel can do."


def choose(
    program: Program,
    parameters: PyTree,
    state: PyTree,
    monitors: bool,
    backend: Backend,
    axes: tuple[PyTree, PyTree] | None = None,
) -> Backend:
    """ "native" or "xla": the choice for this program; compiles a native kernel on the way.

    axes: of an ensemble, as `run_ensemble` takes them.

    "auto" falls back to XLA where the program cannot be traced and says so once, naming the primitive; "native"
    raises ArgumentError there.
    """
    require_backend(backend)
    possible = native.written(program) or native.linked(program, state) is not None
    if backend == "xla" or (backend == "auto" and not possible):
        return "xla"
    try:
        if axes is None:
            native.compile(program, parameters, state, monitors)
        else:
            _of_members(program).compile(program, parameters, state, monitors, axes)
    except Untraceable as reason:
        fall_back(reason, backend)
        return "xla"
    return "native"


def _of_members(program: Program) -> ModuleType:
    """What runs many members by native code."""
    return ensemble if native.written(program) else linked_members


def monitor_shapes(
    program: Program, parameters: PyTree, state: PyTree, backend: Backend
) -> Mapping[str, tuple[int, ...]]:
    """Names and shapes of the observations at a record of a single run, whose backend `choose` has chosen."""
    if backend == "native" and not observed_by_xla(backend, program, parameters, state):
        return native.compile(program, parameters, state).monitor_shapes
    found = evaluate(program.monitors, parameters, state, 1.0)
    return {name: np.shape(value) for name, value in found.items()}


def require_backend(backend: Backend) -> None:
    """Raise ArgumentError unless there is such a backend."""
    if not isinstance(backend, str) or backend not in ("auto", "native", "xla"):
        raise ArgumentError(f'Argument `backend` must be "auto", "native" or "xla", but is {shown(backend)}.')


def fall_back(reason: Untraceable, backend: Backend) -> None:
    """Say once that XLA takes over; raises ArgumentError where only native code was asked for."""
    what = OUTSIDE if reason.primitive in CALLBACKS else reason
    sentence = f"{what} It runs by XLA, which is slower for small systems."
    if backend == "native":
        raise ArgumentError(f'{reason} Use backend="xla" or "auto".') from reason
    if sentence not in _told and not reason.quiet:
        _told.add(sentence)
        warn(sentence, stacklevel=4)


def observed_by_xla(
    backend: Backend, program: Program, parameters: PyTree, state: PyTree, monitors: bool = True
) -> bool:
    """Whether XLA, or NumPy, observes the records of native code (`run.observed`), for which it is made ready at the
    first step."""
    return backend == "native" and monitors and native.loops(program, parameters, state)


def run(
    backend: Backend,
    program: Program,
    parameters: PyTree,
    state: PyTree,
    h: Scalar,
    records: int,
    save_every: int,
    monitors: bool = True,
    length: int | None = None,
) -> Chunk:
    """records·save_every steps of `program` by the backend that `choose` found, keeping every save_every-th record.

    length: the steps of the complete run; a brief one is observed by NumPy.
    """
    look()
    given = program, parameters, state, h, records, save_every, monitors
    if observed_by_xla(backend, program, parameters, state, monitors):
        return observed.run(*given, by_numpy=length is not None and observed.brief(program, state, length))
    return (native if backend == "native" else xla).run(*given)


def run_ensemble(
    backend: Backend,
    program: Program,
    parameters: PyTree,
    state: PyTree,
    h: float,
    records: int,
    save_every: int,
    monitors: bool = True,
    *,
    axes: tuple[PyTree, PyTree],
) -> EnsembleChunk:
    """`run` for many members; `axes`: True where a leaf of (parameters, state) has a leading axis of members."""
    look()
    kernel = _of_members(program) if backend == "native" else xla
    return kernel.run_ensemble(program, parameters, state, h, records, save_every, monitors, axes=axes)
