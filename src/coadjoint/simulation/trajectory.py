"""Trajectories as pure functions, for grad, jit and vmap."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree, Scalar
from coadjoint.checks import truth, whole
from coadjoint.errors import ArgumentError, Interrupted, StepError, warn
from coadjoint.interrupts import deferred_interrupts
from coadjoint.kernels.chunk import Chunk
from coadjoint.kernels.float64 import require_scope
from coadjoint.kernels.newton.coupled import Factors
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import backend as kernels
from coadjoint.kernels.run import native, xla
from coadjoint.kernels.run.backend import Backend
from coadjoint.kernels.run.interruptible import Cut
from coadjoint.kernels.trace.evaluate import traced
from coadjoint.kernels.trace.jaxprs import traced_by_kinds
from coadjoint.mechanics.constrained_start import Known, known_start
from coadjoint.mechanics.copies import replace_parameters
from coadjoint.mechanics.identity import OPAQUE, version
from coadjoint.mechanics.inputs import Given
from coadjoint.mechanics.internal_state import failure, require_internal
from coadjoint.mechanics.members import count_members
from coadjoint.mechanics.parameters import Parameters
from coadjoint.mechanics.restart_checks import Keep, continued
from coadjoint.mechanics.state import State
from coadjoint.mechanics.system import System
from coadjoint.mechanics.work_balance import with_ledger
from coadjoint.methods.method import Method
from coadjoint.methods.midpoint import Midpoint
from coadjoint.methods.program import Constants, StepProgram
from coadjoint.methods.rattle import begun_in_trace
from coadjoint.methods.step import in_records
from coadjoint.simulation import members
from coadjoint.simulation.accuracy.resolution import unresolved_records
from coadjoint.simulation.arguments import (
    inputs_held,
    require_forward,
    require_kinds,
    require_reversible,
    step_size,
    with_inputs,
)
from coadjoint.simulation.derived import after_step
from coadjoint.simulation.members import require_one_time
from coadjoint.simulation.native_trajectory import Blocks, native_trajectory
from coadjoint.simulation.plan import Plan


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Trajectory:
    """The nodes of a trajectory.

    records: the states at nodes 0, save_every, …, steps, (k,) on a leading axis, as `run.records`; ξ and ν are those of
    the step that starts there. Those of `Stepper.trajectory` are of the start alone. final: the state after the last
    step, with ξ and ν at the node itself, as `run.final`. code: 0 if every step converged, otherwise a
    `kernels.program.Code`; after a failed step the state stays at the last good node. iterations: Newton's iterations
    over all steps.
    """

    records: State
    final: State
    code: Any
    iterations: Any


@checks.known_arguments("co.trajectory")
@deferred_interrupts()
def trajectory(
    system: System,
    start: State,
    *,
    dt: Scalar,
    steps: int,
    method: Method | None = None,
    save_every: int = 1,
    inputs: Given | None = None,
    backend: Backend = "auto",
    keep: Keep | None = None,
    accuracy: bool = True,
) -> Trajectory:
    """`steps` steps from `start`, a pure function of parameters, start and dt: JAX maps and differentiates it inside
    `with co.float64():`, for chains as for single bodies.

        def height(mass):  # inside `with co.float64():`
            return co.trajectory(body.replace(mass=mass), start, dt=0.01, steps=200).final.q[2]

        with co.float64():
            slope = jax.grad(height)(2.0)

    Derivatives, forward and reverse, go through each step by the implicit function theorem: with R(z, s) = 0 the
    equations of a step from the state s, dz = −(∂R/∂z)⁻¹ ∂R/∂s ds. They are exact to round-off.

    Arguments:
        system, start, method, inputs, keep: those of `co.simulate`, without `co.each`; map over members with
            `jax.vmap`.
        dt: h, s; one number, traced or not, not 0; a negative one goes back in time.
        steps: the number of steps, at least 1.
        save_every: every how many steps a record is kept, by default 1; it must divide `steps`.
        accuracy: whether a sample of the steps is judged, each by comparison with shorter steps over the same time; by
            default True: it warns if dt does not resolve the motion, and gives a dt that does. Inside jit, grad or
            vmap no step is judged: call it with plain numbers first.
        backend: "native", with reverse mode in machine code and forward mode by XLA; "xla", for derivatives of any
            order; "auto" (the default), native on processors where the step can be traced.

    Returns a `Trajectory`. Called with plain numbers its arrays are NumPy's, and StepError is raised for a step that
    fails. Inside jit, grad or vmap, which need `with co.float64():`, `code` reports failure instead; the derivative of
    a failed run does not exist, and reverse mode by native code returns NaN for it. Where the start and parameters move
    it off the constraints, derivatives are those of `system.project(start)`; `code` is 5 for one that is off them.
    Numbers are unknown there, so that
    the symmetry of Λ for `co.Variational(symmetric=True)` is not checked: call it with plain ones first.

    Raises ArgumentError, GroupError and LagrangianError as `co.simulate` does, and StepError as described above.
    """
    method = Midpoint() if method is None else method
    require_kinds(system, start, method)
    h, steps, save_every = step_size(dt), whole(steps, "steps"), whole(save_every, "save_every")
    kernels.require_backend(backend)
    if steps % save_every:
        raise ArgumentError(f"Argument `save_every` must divide steps = {steps}, but is {save_every}.")
    if count_members(system.parameters) is not None or np.ndim(start.t):
        if not traced(start):
            require_one_time(start)
        raise ArgumentError("co.each is for co.simulate; map co.trajectory over members with jax.vmap.")
    start, _ = continued(system, start, keep)
    system, start = with_inputs(system, start, inputs, method.start == "velocity")
    require_internal(system, start, h)
    if not traced(system.parameters, start, h):
        require_forward(system, method, start, h)
        require_reversible(system, method, float(h), steps)
    digest = version(system, start, *([partial(inputs_held, system)] if inputs is not None else []), pure=False)
    program = StepProgram(replace_parameters(system, None), method, version=digest)
    blocks = (steps // save_every, save_every)
    if traced(system.parameters, start, h):
        require_scope("co.trajectory")
        made = _kept(program, _from_start)(program, blocks, backend, known_start(system, start))
        return made(system.parameters, start, jnp.asarray(h, float))
    begun = with_ledger(system, method.begin(system, start, h), False)
    constants = Constants(system.parameters, None)
    found = computed(program, constants, begun, h, blocks, backend, last=True)
    if truth(accuracy, "accuracy"):
        chosen = _choose(program, constants, begun, backend, False)
        plan = Plan(chosen, program, constants, float(h), steps, save_every, False)
        if sentence := unresolved_records(plan, found.records):
            warn(sentence, stacklevel=4)
    record = jax.tree.map(lambda rows: rows[-1], found.records)
    return replace(found, final=after_step(program, system.parameters, found.final, record))


def _kept(program: StepProgram, maker: Any) -> Any:
    """A cached maker of traced functions, or the maker alone where it is unknown what the program computes.

    Programs with the same version compute the same, so that the trace of one serves all that are equal to it.
    """
    known = program.version and not program.version.endswith(OPAQUE)
    return maker if known else maker.__wrapped__


@lru_cache(maxsize=64)
def _from_start(
    program: StepProgram, blocks: Blocks, backend: Backend, known: Known
) -> Callable[[Parameters | None, State, Scalar], Trajectory]:
    """The trajectory of (parameters, start, h) as a function that JAX traces once for each kind of arguments.

    known: `known_start`.
    """

    def found(parameters: Parameters | None, start: State, h: Scalar) -> Trajectory:
        system = replace_parameters(program.skeleton, parameters)
        begun, on = begun_in_trace(system, program.method.begin(system, start, h), known)
        constants, begun = Constants(parameters, None), with_ledger(system, begun, False)
        path = computed(program, constants, begun, h, blocks, backend, last=True)
        record = program.prepare(constants, path.final, h)
        path = replace(path, final=after_step(program, parameters, path.final, record))
        return path if on is None else replace(path, code=jnp.where(on, path.code, Code.OFF_CONSTRAINTS))

    return traced_by_kinds(found)


@lru_cache(maxsize=64)
def _from_begun(
    program: StepProgram, blocks: Blocks, backend: Backend, last: bool
) -> Callable[[Constants, State, Scalar], Trajectory]:
    """The same of (constants, begun, h), for a state that the method has begun."""

    def found(constants: Constants, begun: State, h: Scalar) -> Trajectory:
        begun = in_records(begun) if backend == "native" else begun
        chosen = _choose(program, constants, begun, backend, True)
        if chosen == "xla":
            begun = program.method.begin_by_xla(program.skeleton, begun)
            return _scan(program, constants, begun, h, blocks, last)
        return _by_native_code(program, constants, begun, h, blocks, last)

    return traced_by_kinds(found)


def computed(
    program: StepProgram,
    constants: Constants,
    begun: State,
    h: Scalar,
    blocks: Blocks,
    backend: Backend,
    *,
    last: bool = False,
) -> Trajectory:
    """blocks = (records, save_every) of a program from a state that was begun: the result of `trajectory`.

    last: whether a record of the last node follows, for whose ξ and ν the step from there is also solved. If it has no
    solution, they are those of the step before.
    """
    inside = traced(constants, begun, h)
    members.require_room_for(begun, blocks)
    if inside:
        require_scope("co.trajectory")
        replayed = _kept(program, _from_begun)(program, blocks, backend, last)
        return replayed(constants, begun, jnp.asarray(h, float))
    begun = in_records(begun) if backend == "native" else begun
    chosen = _choose(program, constants, begun, backend, False)
    if chosen == "xla":
        begun = program.method.begin_by_xla(program.skeleton, begun)
    with jax.enable_x64(True):
        found = _run(chosen, program, constants, begun, h, blocks, last)
    found = jax.tree.map(np.asarray, found)
    if found.code:
        reason = failure(program.skeleton, float(found.final.t), float(h))
        what = reason or _failed(Code(int(found.code)), program)
        raise StepError(f"A step of the trajectory failed: {what}")
    return found


def _failed(code: Code, program: StepProgram) -> str:
    """The failure of a step that ended with this code, and the remedy."""
    unsolved, beyond = program.method.remedies
    if code is Code.NOT_CONVERGED:
        return f"it did not converge; {unsolved}."
    if code is Code.BEYOND_CHART:
        return f"it left the chart of the difference map; {beyond}."
    return f"its numbers are not finite; {unsolved}, or check the energy and forces there."


def _choose(program: StepProgram, constants: Constants, state: State, backend: Backend, inside: bool) -> Backend:
    """Native code where JAX computes on this processor anyway, the step can be traced and the state is not XLA's.

    Inside a transformation numbers are unknown: others of the same shapes replace them. Steps that may fail, and those
    of many links, have no derivative in native code.
    """
    if backend == "auto" and (jax.default_backend() != "cpu" or isinstance(state.memory, Factors)):
        return "xla"
    if inside and any(stage.tolerant or not stage.structure.native for stage in program.stages):
        if backend == "native":
            raise ArgumentError(f'{program.method.title} has no derivative in native code: take backend="xla".')
        return "xla"
    given = (constants, state)
    parameters, begun = jax.tree.map(lambda leaf: np.full(np.shape(leaf), 0.5), given) if inside else given
    return kernels.choose(program, parameters, begun, False, backend)


def _run(
    backend: Backend,
    program: StepProgram,
    constants: Constants,
    start: State,
    h: Scalar,
    blocks: Blocks,
    last: bool,
) -> Trajectory:
    run = xla.run_long if backend == "xla" else partial(native.run, monitors=False)
    try:
        found = _of_chunk(run(program, constants, start, float(h), *blocks))
    except Cut as cut:
        raise _interrupted(cut.result, blocks) from None
    if not last or found.code:
        return found
    return _with_last(found, _of_chunk(run(program, constants, found.final, float(h), 1, 1)))


def _by_native_code(
    program: StepProgram, constants: Constants, start: State, h: Scalar, blocks: Blocks, last: bool
) -> Trajectory:
    """The trajectory of numbers that are unknown, inside a user's jit, grad or vmap."""

    def path(start: State, blocks: Blocks) -> Trajectory:
        def by_xla(arguments):
            path = _scan(program, arguments[0], arguments[1], arguments[2], blocks)
            return path.records, path.final

        records, final, code, iterations = native_trajectory(program, (constants, start, h), blocks, by_xla)
        return Trajectory(records, final, code.astype(int), iterations.astype(int))

    found = path(start, blocks)
    return _with_last(found, path(found.final, (1, 1))) if last else found


def _with_last(found: Trajectory, one: Trajectory) -> Trajectory:
    """The trajectory with a record of its last node: that of one step from there, where it has a solution."""
    inside = traced(found.final)
    good, numbers = one.code == 0, jnp if inside else np
    end = found.final if found.records.memory is not None else found.final.replace(memory=None)
    if not inside and not good:  # records of a failed step may be none
        record = jax.tree.map(lambda rows, leaf: np.asarray(leaf)[None], found.records, end)
    else:
        record = jax.tree.map(lambda row, leaf: numbers.where(good, row, leaf[None]), one.records, end)
    records = jax.tree.map(lambda rows, row: numbers.concatenate([rows, row]), found.records, record)
    return Trajectory(records, found.final, found.code, found.iterations)


def _of_chunk(chunk: Chunk) -> Trajectory:
    return Trajectory(chunk.records, chunk.final, np.int64(chunk.code), np.int64(chunk.iterations))


def _interrupted(chunk: PyTree, blocks: Blocks) -> KeyboardInterrupt:
    """The exception for an interrupted trajectory, with the steps that were done, if there are any."""
    if not chunk.steps:
        return KeyboardInterrupt()
    done, steps = chunk.steps, blocks[0] * blocks[1]
    return Interrupted(
        f"Interrupted at step {done:,} of {steps:,} (t = {float(chunk.final.t):.6g} s); the trajectory up to there "
        f"is in `.run` of this exception (`error`), and `error.run.final` is a start for the other {steps - done:,}.",
        _of_chunk(chunk),
    )


def _scan(
    program: StepProgram, constants: Constants, start: State, h: Scalar, blocks: Blocks, last: bool = False
) -> Trajectory:
    """last: as in `computed`; then there is one more block, of which the first step gives its record alone."""
    count, every = blocks

    def one(carry, number):
        def go(carry):
            state, _, iterations = carry
            result = xla.step(program, constants, state, h, certify=False)
            there, record = (result.after, result.code, iterations + result.iterations), result.record
            if not last:
                return there, record
            alone = state if record.memory is not None else state.replace(memory=None)
            record = _where((number < count * every) | (result.code == 0), record, alone)
            return _where(number < count * every, there, carry), record

        kept = jax.eval_shape(go, carry)[1].memory is not None  # factors that are carried over are in no record

        def stay(carry):
            return carry, carry[0] if kept else carry[0].replace(memory=None)

        return jax.lax.cond((carry[1] == 0) & (number <= count * every), go, stay, carry)

    @partial(jax.checkpoint, prevent_cse=False)
    def block(carry, numbers):
        carry, records = jax.lax.scan(one, carry, numbers)
        return carry, jax.tree.map(lambda rows: rows[0], records)

    start = jax.tree.map(jnp.asarray, start)
    numbers = jnp.arange((count + last) * every)
    step, numbers = (one, numbers) if every == 1 else (block, numbers.reshape(-1, every))
    (final, code, iterations), records = jax.lax.scan(step, (start, jnp.asarray(0), jnp.asarray(0)), numbers)
    return Trajectory(records, final, code, iterations)


def _where(condition: PyTree, one: Any, other: Any) -> PyTree:
    return jax.tree.map(lambda x, y: jnp.where(condition, x, y), one, other)
