"""Inputs and internal state renewed at the node where a step starts, and held over it."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from coadjoint.arrays import Scalar
from coadjoint.mechanics.forces import INPUTS, INTERNAL
from coadjoint.mechanics.internal_state import AtNode, advanced, at_node
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.work_balance import with_jump

RENEWED, INPUTS_HELD, ALL_HELD = 2.0, 3.0, 4.0
"""See `methods.program.Constants`; neither 0 nor 1, for which machine code would be specialised."""


def held(system: System, state: State, h: Scalar, renewal: Scalar | None = None, at: AtNode = at_node) -> State:
    """The state at a node with the inputs and the internal state over the step of h from there.

    h: one number, s. renewal: one number, see `Constants`. at: gives a state the velocities that are read.
    """
    driven = _with_inputs(system, state, renewal, at)
    due = None if renewal is None else renewal != ALL_HELD
    return with_jump(system, INTERNAL, driven, advanced(system, driven, h, due, at))


def _with_inputs(system: System, state: State, renewal: Scalar | None, at: AtNode) -> State:
    if system.inputs is None or not system.inputs.holds:
        return state
    motion = system.motion_at(at(system, state) if system.inputs.follow else state)
    inputs = jax.tree.map(lambda leaf: jnp.asarray(leaf, dtype=float), system.inputs.held(motion, state.inputs))
    if renewal is not None:
        inputs = jax.tree.map(lambda new, old: jnp.where(renewal == RENEWED, new, old), inputs, state.inputs)
    return with_jump(system, INPUTS, state, state.replace(inputs=inputs))
