"""The engine of a stepper by XLA: for what native code cannot take."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.kernels.emit.online import ALWAYS, SELDOM
from coadjoint.kernels.packing import Layout
from coadjoint.kernels.program import Code, Program, StatusFlag
from coadjoint.kernels.run import xla
from coadjoint.kernels.run.compiled import compiled
from coadjoint.kernels.trace.fork_safety import require_own_xla
from coadjoint.simulation.steppers.buffers import Buffers


class XlaEngine:
    """The steps of `program` by XLA on the same memory as machine code, one member a lane of its own.

    watch: (parameters, state) → arrays. layouts: of parameters and of a state. commanded: the places of commands.
    """

    lanes = 1

    def __init__(self, program: Program, watch: Callable[..., Any], layouts: tuple[Layout, Layout], commanded: Any):
        self._advance = partial(_advance, program, watch, layouts, tuple(commanded))

    def advance(self, buffers: Buffers, context: int, groups: int, steps: int, threads: int) -> int:
        """Commands in, `steps` steps, observations out; XLA has threads of its own."""
        parameters = np.broadcast_to(buffers.parameters[..., 0], (groups, buffers.parameters.shape[1]))
        rows = (parameters, buffers.state[..., 0], buffers.status[..., 0].copy(), buffers.commands)
        require_own_xla()
        with jax.enable_x64(True):
            found = jax.tree.map(np.asarray, self._advance(*rows, buffers.h[0], steps))
        buffers.state[..., 0], buffers.status[..., 0], buffers.observations[...] = found
        return _told(buffers, rows[2])


def _told(buffers: Buffers, before: np.ndarray) -> int:
    """What `StatusFlag` says after a call, from the status of members before it."""
    low, high = buffers.limits[..., 0]
    beyond = np.any((buffers.commands < low) | (buffers.commands > high), axis=1)
    taken, now = before[:, 0], buffers.status[:, 0, 0]
    changed = taken ^ now
    due = ((changed > taken) | (changed >= ALWAYS)) & (now >= SELDOM)
    found = {
        StatusFlag.FAILED: buffers.status[:, 1] > 0,
        StatusFlag.NOT_FINITE: ~np.isfinite(buffers.observations),
        StatusFlag.CLIPPED: beyond & (before[:, 1] == 0),
        StatusFlag.DUE: due,
    }
    return sum(int(flag) for flag, there in found.items() if np.any(there))


@compiled("watch", "layouts", "commanded")
def _advance(
    program: Program, watch: Any, layouts: Any, commanded: Any, parameters, states, statuses, commands, h, steps
) -> tuple[Any, Any, Any]:
    def one(p, s, status, command):
        constants, places = layouts[0].unpack(p), np.array(commanded, int)
        s = jnp.where(status[1] == 0, s.at[places].set(command), s)
        state, status, _ = jax.lax.while_loop(
            lambda carry: (carry[2] < steps) & (carry[1][1] == 0),
            partial(_step, program, constants, h),
            (layouts[1].unpack(s), status, jnp.asarray(0)),
        )
        seen = [jnp.ravel(value) for value in watch(constants, state)]
        numbers = [jnp.ravel(leaf) for leaf in jax.tree.leaves(state)]
        return jnp.concatenate(numbers), status, jnp.concatenate([jnp.zeros(0), *seen])

    return jax.vmap(one)(parameters, states, statuses, commands)


def _step(program: Program, constants: Any, h: Any, carry: Any) -> Any:
    """One step, as `xla` takes it in a run; a failed one leaves the state as it was."""
    state, (done, _, total, most), count = carry
    result = xla.step(program, constants, state, h, certify=False)
    code = result.code
    if program.stops:
        event = program.stop(constants, state, result.after)
        code = jnp.where((code == 0) & ~jnp.isfinite(event), int(Code.NOT_FINITE), code)
        code = jnp.where((code == 0) & (event > 0), int(Code.STOPPED), code)
    good = code == 0
    after = jax.tree.map(lambda new, old: jnp.where(good, new, old), result.after, state)
    iterations = jnp.where(good, result.iterations, 0)
    status = jnp.stack([done + good, code, total + iterations, jnp.maximum(most, iterations)])
    return after, status, count + 1
