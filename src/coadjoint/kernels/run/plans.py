"""Kernels on disk: the machine code of a program with the names and shapes of its output, found without a trace.

`identity` of a program is a text that is the same in every process, or None if its functions have no known identity;
such a program is traced. `current` shows whether the traced functions have changed since.
"""

from __future__ import annotations

import jax

from coadjoint.arrays import PyTree
from coadjoint.kernels.expressions.block_elimination import CANCELLATION
from coadjoint.kernels.program import MAX_UNKNOWNS, NEWTON, Program
from coadjoint.kernels.run import disk_cache
from coadjoint.kernels.trace.identity import Shapes

RULES = (*NEWTON, CANCELLATION, MAX_UNKNOWNS)


def name(program: Program, parameters: PyTree, state: PyTree, *more: object) -> str | None:
    """The name of the kernel of a program at these shapes and with these additions; None if its identity is unknown."""
    own = getattr(program, "identity", None)
    structure = repr(jax.tree_util.tree_structure((parameters, state)))
    if own is None or " at 0x" in structure:
        return None
    return disk_cache.name(own, RULES, structure, Shapes((parameters, state)), more)
