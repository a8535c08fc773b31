"""Which kernel runs a program: native code where it can be traced, XLA elsewhere."""

from __future__ import annotations

import warnings
from typing import Any, Literal

from coadjoint.kernels import native, xla
from coadjoint.kernels.chunk import Chunk
from coadjoint.kernels.interpreter import Untraceable
from coadjoint.kernels.program import Program

Backend = Literal["auto", "native", "xla"]

_told: set[str] = set()


def run(
    program: Program,
    parameters: Any,
    state: Any,
    h: float,
    records: int,
    save_every: int,
    monitors: bool = True,
    *,
    backend: Backend = "auto",
) -> Chunk:
    """records·save_every steps of `program` from `state`, keeping every save_every-th record.

    "auto" runs native code, or XLA where the program is outside the tracer's language, and warns once for each
    primitive; "native" raises Untraceable instead.
    """
    arguments = program, parameters, state, h, records, save_every, monitors
    if backend not in ("auto", "native", "xla"):
        raise ValueError(f'Argument `backend` must be "auto", "native" or "xla", but is {backend!r}.')
    if backend == "xla":
        return xla.run(*arguments)
    try:
        return native.run(*arguments)
    except Untraceable as reason:
        if backend == "native":
            raise
        _warn(reason)
        return xla.run(*arguments)


def _warn(reason: Untraceable) -> None:
    if reason.primitive not in _told:
        _told.add(reason.primitive)
        warnings.warn(f"{reason} XLA runs the program instead, more slowly.", RuntimeWarning, stacklevel=3)
