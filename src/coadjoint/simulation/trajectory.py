"""Trajectories as pure functions: what grad, jit and vmap go through."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.errors import ArgumentError, StepError
from coadjoint.kernels import xla
from coadjoint.kernels.evaluate import traced
from coadjoint.kernels.program import Code
from coadjoint.mechanics.parameters import float64
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System, replace_parameters
from coadjoint.methods.method import Method
from coadjoint.methods.midpoint import Midpoint
from coadjoint.methods.program import Constants, StepProgram


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Trajectory:
    """The nodes of a trajectory: `records` with a leading axis, and the state after the last step in `final`.

    `code` is 0 where every step converged (see `kernels.program.Code`); after a failed step the state stays at the
    last good node. `iterations` counts Newton's iterations over all steps.
    """

    records: State
    final: State
    code: Any
    iterations: Any


def trajectory(
    system: System, start: State, *, dt: Any, steps: int, method: Method | None = None, save_every: int = 1
) -> Trajectory:
    """`steps` steps of length dt from `start`, a pure function of parameters, start and dt: differentiable exactly.

    Derivatives go through each step by the implicit function theorem, forward and reverse. Every save_every-th record
    is kept. Called with plain numbers it returns NumPy and raises StepError for a step that fails; inside jit, grad or
    vmap, which need `with co.float64():`, look at `code`.
    """
    method = Midpoint() if method is None else method
    h = float64(dt, "Argument `dt`")
    if not isinstance(steps, int) or steps < 1:
        raise ArgumentError(f"Argument `steps` must be a whole number of at least 1, but is {steps!r}.")
    if not isinstance(save_every, int) or save_every < 1 or steps % save_every:
        raise ArgumentError(
            f"Argument `save_every` must be a whole number that divides steps = {steps}, but is {save_every!r}."
        )
    begun = method.begin(system, start, h)
    program = StepProgram(replace_parameters(system, None), method)
    blocks = (steps // save_every, save_every)
    if traced(system.parameters, begun, h):
        if not jax.config.jax_enable_x64:  # pyright: ignore[reportAttributeAccessIssue]
            raise ArgumentError(
                "co.trajectory inside your own jit, grad or vmap needs float64: wrap it in `with co.float64():`."
            )
        return _scan(program, Constants(system.parameters, None), begun, h, blocks)
    with jax.enable_x64(True):
        constants = Constants(system.parameters, None)
        found = jax.tree.map(np.asarray, _compiled(program, constants, begun, h, blocks))
    if found.code:
        raise StepError(f"A step of the trajectory failed: {Code(int(found.code)).name.lower().replace('_', ' ')}.")
    return found


def _scan(program: StepProgram, constants: Constants, start: State, h: Any, blocks: tuple[int, int]) -> Trajectory:
    def one(carry, _):
        def go(carry):
            state, _, iterations = carry
            result = xla.step(program, constants, state, h, certify=False)
            return (result.after, result.code, iterations + result.iterations), result.record

        return jax.lax.cond(carry[1] == 0, go, lambda carry: (carry, carry[0]), carry)

    @partial(jax.checkpoint, prevent_cse=False)
    def block(carry, _):
        carry, records = jax.lax.scan(one, carry, None, length=blocks[1])
        return carry, jax.tree.map(lambda rows: rows[0], records)

    start = jax.tree.map(jnp.asarray, start)
    step = one if blocks[1] == 1 else block
    (final, code, iterations), records = jax.lax.scan(step, (start, jnp.asarray(0), jnp.asarray(0)), None, blocks[0])
    return Trajectory(records, final, code, iterations)


_compiled = partial(jax.jit, static_argnums=(0, 4))(_scan)
