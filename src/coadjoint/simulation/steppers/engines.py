"""The engines of a stepper, machine code (planned once, then read from disk) or XLA, and its observations."""

from __future__ import annotations

import base64
import threading
import zlib
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree, Scalar
from coadjoint.errors import LagrangianError
from coadjoint.kernels.emit import online
from coadjoint.kernels.emit.online import ALWAYS, SELDOM
from coadjoint.kernels.emit.plan import plan
from coadjoint.kernels.packing import Layout, flattened, layout
from coadjoint.kernels.program import Code, Program, StatusFlag
from coadjoint.kernels.run import disk_cache, native, plans, xla
from coadjoint.kernels.run.compiled import compiled
from coadjoint.kernels.trace.digest import digest
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.kernels.trace.fork_safety import require_own_xla
from coadjoint.kernels.trace.jaxprs import depends, jaxpr_of
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.internal_state import at_node
from coadjoint.mechanics.quantities import Quantities, quantities_from, value
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.trace_checks import require_float64
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.simulation.steppers.interface import Buffers, NativeEngine

Observe = Mapping[str, Callable[..., Any]]


class Watch(NamedTuple):
    """(parameters, state) → the observations of the functions, as arrays in their order; hashable, for tracing.

    If `moving`, that is if a function reads velocities, the state that functions see has the velocities of its momenta.
    """

    skeleton: System
    functions: Quantities
    moving: bool

    def __call__(self, constants: Constants, state: State) -> tuple[PyTree, ...]:
        system = replace_parameters(self.skeleton, constants.system)
        node = at_node(system, state) if self.moving else state
        return tuple(jnp.asarray(value(system, function, node), dtype=float) for _, function in self.functions)


def watch(system: System, observe: Observe | None, state: State) -> tuple[Watch, dict[str, tuple[int, ...]]]:
    """The observations of a system, with the shapes that they have; raises ArgumentError and LagrangianError."""
    fits = observe is None or isinstance(observe, Mapping)
    checks.expect(fits, observe, "observe", "a dictionary of names and functions of the state")
    functions, observed = quantities_from(observe), []
    for name, function in functions:
        what = f"The observation `{name}`"
        require_float64(partial(value, system, function), what, (state,))
        observed.append(found := evaluate(partial(value, system, function), state))
        if not isinstance(found, (np.ndarray, np.generic, float, int)):
            raise LagrangianError(f"{what} must be a number or an array, but is a {type(found).__name__}.")
        if not np.all(np.isfinite(found)):
            raise LagrangianError(f"{what} must be finite at the start, but is not: look for a division by zero.")
    read = depends(lambda state: [value(system, function, state) for _, function in functions], state)
    used = jax.tree.unflatten(jax.tree.structure(state), read)
    made = Watch(replace_parameters(system, None), functions, any(jax.tree.leaves((used.xi, used.nu))))
    return made, {name: np.shape(part) for (name, _), part in zip(functions, observed, strict=True)}


KEPT = 32
"""The most engines that stay in memory."""


_engines: OrderedDict[tuple[PyTree, ...], NativeEngine] = OrderedDict()


_lock = threading.Lock()


def native_engine(
    program: StepProgram, watch: Watch, constants: Constants, begun: State, pattern: tuple[int, ...],
    commanded: Sequence[int], width: int,
) -> NativeEngine:  # fmt: skip
    """The engine of a program; constants and begun give shapes, pattern is that of `plan.specialised`.

    Raises Untraceable, naming the primitive, if program or watch are outside the tracer's language.
    """
    watched = digest(jaxpr_of(watch, constants, begun)[0])
    more = pattern, tuple(commanded), width, watched
    key = program, layout(constants), layout(begun), *more
    with _lock:
        if key in _engines:
            _engines.move_to_end(key)
            return _engines[key]
    name = plans.name(program, constants, begun, "stepper", *more)
    found = disk_cache.find(name)
    if found is None:
        planned = plan(program, constants, begun, pattern, False)
        assembly = online.assemble(planned, online.observed(watch, constants, begun), commanded, width)
        disk_cache.keep(name, {"assembly": base64.b64encode(zlib.compress(assembly.encode())).decode()})
    else:
        assembly = zlib.decompress(base64.b64decode(found["assembly"])).decode()
    made = NativeEngine(assembly, width)
    with _lock:
        _engines[key] = made
        while len(_engines) > KEPT:
            _engines.popitem(last=False)
    return made


class LinkedEngine:
    """The steps of a chain of joints by loops over its links, for a member after the other; XLA observes.

    kernel: of single runs without monitors. watch, layouts, commanded: as for `XlaEngine`.
    """

    lanes = 1

    def __init__(
        self, kernel: native.Kernel, program: Program, watch: Watch, layouts: tuple[Layout, Layout], commanded: PyTree
    ):
        self._kernel, self._commanded = kernel, np.array(commanded, int)
        self._observed = partial(_observed, program, watch, layouts) if watch.functions else None

    def advance(self, buffers: Buffers, context: int, groups: int, steps: int, threads: int) -> int:
        """Read commands, take `steps` steps, write observations, with members on as many threads."""
        before, length = buffers.status[..., 0].copy(), buffers.h.ctypes.data

        def member(index: int) -> None:
            if before[index, 1]:
                return
            p = buffers.parameters[index % len(buffers.parameters)]
            state, record, status = buffers.state[index], np.empty(self._kernel.record.size), np.zeros(4, np.int64)
            state[self._commanded, 0] = buffers.commands[index]
            if steps:
                given, out = (p.ctypes.data, length, state.ctypes.data), (record.ctypes.data, 0, 0, status.ctypes.data)
                self._kernel.function(*given, 1, steps, *out)
            done, _, total, most = buffers.status[index, :, 0]
            buffers.status[index, :, 0] = done + status[0], status[1], total + status[2], max(most, status[3])

        if threads == 1 or groups == 1:
            for index in range(groups):
                member(index)
        else:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(member, range(groups)))
        if self._observed is not None:
            require_own_xla()
            parameters = np.broadcast_to(buffers.parameters[..., 0], (groups, buffers.parameters.shape[1]))
            with jax.enable_x64(True):
                buffers.observations[...] = self._observed(parameters, buffers.state[..., 0])
        return _told(buffers, before)


@compiled("watch", "layouts")
def _observed(program: Program, watch: Any, layouts: Any, parameters: Any, states: Any) -> Any:
    def one(p: Any, s: Any) -> Any:
        seen = watch(layouts[0].unpack(p), layouts[1].unpack(s))
        return jnp.concatenate([jnp.zeros(0), *(jnp.ravel(value) for value in seen)])

    return jax.vmap(one)(parameters, states)


def linked_engine(
    program: StepProgram, watch: Watch, constants: Constants, begun: State, pattern: tuple[int, ...],
    commanded: Sequence[int],
) -> LinkedEngine:  # fmt: skip
    """The engine of a chain that is too long to write out; raises Untraceable where loops do not run it."""
    layouts = layout(constants), layout(begun)
    kernel = native.kernel_for(program, constants, begun, native.Variant(*layouts, pattern, False, 1))
    return LinkedEngine(kernel, program, watch, layouts, commanded)


class XlaEngine:
    """The steps of `program` by XLA on the same memory as machine code, with one lane for each member.

    watch: (parameters, state) → arrays. layouts: of parameters and of a state. commanded: the places of commands.
    """

    lanes = 1

    def __init__(
        self, program: Program, watch: Callable[..., PyTree], layouts: tuple[Layout, Layout], commanded: PyTree
    ):
        self._advance = partial(_advance, program, watch, layouts, tuple(commanded))

    def advance(self, buffers: Buffers, context: int, groups: int, steps: int, threads: int) -> int:
        """Read commands, take `steps` steps, write observations; XLA uses its own threads."""
        parameters = np.broadcast_to(buffers.parameters[..., 0], (groups, buffers.parameters.shape[1]))
        rows = (parameters, buffers.state[..., 0], buffers.status[..., 0].copy(), buffers.commands)
        require_own_xla()
        with jax.enable_x64(True):
            found = jax.tree.map(np.asarray, self._advance(*rows, buffers.h[0], steps))
        buffers.state[..., 0], buffers.status[..., 0], buffers.observations[...] = found
        return _told(buffers, rows[2])


def _told(buffers: Buffers, before: np.ndarray) -> int:
    """The `StatusFlag` after a call, from the status of members before it."""
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
    program: Program,
    watch: Any,
    layouts: Any,
    commanded: PyTree,
    parameters,
    states,
    statuses,
    commands,
    h,
    steps,
) -> tuple[PyTree, PyTree, PyTree]:
    def one(p, s, status, command):
        constants, places = layouts[0].unpack(p), np.array(commanded, int)
        s = jnp.where(status[1] == 0, s.at[places].set(command), s)
        state, status, _ = jax.lax.while_loop(
            lambda carry: (carry[2] < steps) & (carry[1][1] == 0),
            partial(_step, program, constants, h),
            (layouts[1].unpack(s), status, jnp.asarray(0)),
        )
        seen = [jnp.ravel(value) for value in watch(constants, state)]
        return flattened(state), status, jnp.concatenate([jnp.zeros(0), *seen])

    return jax.vmap(one)(parameters, states, statuses, commands)


def _step(program: Program, constants: PyTree, h: Scalar, carry: PyTree) -> Any:
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
