"""Kernels on disk: the machine code of a program with the names and shapes of what it writes, found without a trace.

A program says what it does by `identity`, a text that is the same in every process, or None where that cannot be told;
such a program is traced. What functions were traced of it is told by `current`: whether it still is what they do.
"""

from __future__ import annotations

from typing import Any

import jax

from coadjoint.kernels.newton.increments import CANCELLATION
from coadjoint.kernels.program import FLOOR, MAX_ITERATIONS, MAX_UNKNOWNS, STALLED, TOLERANCE, Program
from coadjoint.kernels.run import disk_cache
from coadjoint.kernels.trace.identity import Shapes

NEWTON = (TOLERANCE, FLOOR, STALLED, MAX_ITERATIONS, CANCELLATION, MAX_UNKNOWNS)


def name(program: Program, parameters: Any, state: Any, *more: Any) -> str | None:
    """The name for what a program comes to at these shapes and with this more; None where it cannot be told."""
    own = getattr(program, "identity", None)
    structure = repr(jax.tree_util.tree_structure((parameters, state)))
    if own is None or " at 0x" in structure:
        return None
    return disk_cache.name(own, NEWTON, structure, Shapes((parameters, state)), more)
