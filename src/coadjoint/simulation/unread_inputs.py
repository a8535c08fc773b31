"""Inputs that a step and the functions of its state do not read, such as misspelt ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.trace.jaxprs import depends
from coadjoint.mechanics.state import State
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.spaces.named import Named


def unread(
    program: StepProgram,
    constants: Constants,
    state: State,
    names: Sequence[str],
    seen: Callable[[State], PyTree] | None = None,
) -> list[str]:
    """Those of `names` whose inputs, held over a step from `state`, change neither its equations, nor the state after
    it, nor the function `seen` of the state."""
    held = state.inputs
    if not isinstance(held, Named):
        return []
    some = {name: np.asarray(getattr(held, name), float) for name in names if name in held}

    def stepped(given: dict[str, PyTree]) -> list[PyTree]:
        here = state.replace(inputs=held.replace(**given))
        z = jnp.zeros(program.unknowns)
        residual, there = program.substep(constants, program.prepare(constants, here, 1.0), 1.0, z)
        return [residual, *jax.tree.leaves(there.replace(inputs=None)), *jax.tree.leaves(seen(here) if seen else ())]

    return [name for name, used in zip(sorted(some), depends(stepped, some), strict=True) if not used]
