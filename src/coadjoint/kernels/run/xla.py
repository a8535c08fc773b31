"""Runs a program by XLA: for large systems, on GPUs, and within a user's own transformations."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

from coadjoint.arrays import PyTree, Scalar
from coadjoint.kernels.chunk import Chunk, EnsembleChunk
from coadjoint.kernels.program import Code, Program
from coadjoint.kernels.run.compiled import compiled
from coadjoint.kernels.run.interruptible import Clock, Cut, PieceLength
from coadjoint.kernels.trace.fork_safety import require_own_xla

CAPACITY = 1024
"""The most records one chunk may keep: one size, so that all chunks of a run share a compilation."""

ROOM = 2**25
"""The most bytes for the records of a chunk; large states have fewer than CAPACITY records."""


ENSEMBLE_CAPACITY, ENSEMBLE_ROOM = 64, 2**28
"""The same for an ensemble, all members together."""


def capacity(state: PyTree, together: bool = False) -> int:
    """The most records of one chunk from such a state: a power of two; together: the leaves have a member axis."""
    size = sum(8 * int(np.size(leaf)) for leaf in jax.tree.leaves(state))
    most, room = (ENSEMBLE_CAPACITY, ENSEMBLE_ROOM) if together else (CAPACITY, ROOM)
    return min(most, 1 << max(room // max(size, 1), 1).bit_length() - 1)


class StepResult(NamedTuple):
    """A step: its record, the state after it, and the outcome of its stages."""

    record: Any
    after: Any
    code: jax.Array
    iterations: jax.Array
    certificates: dict[str, jax.Array]
    course: tuple[jax.Array, PyTree]
    """The unknowns of every substep, (substeps, m), and the states after them."""


def step(program: Program, parameters: PyTree, state: PyTree, h: Scalar, certify: bool = True) -> StepResult:
    """One step of a program; a failed one leaves the state as it was."""
    before = state

    def substep(state, fraction):
        result = _stages(program, parameters, state, fraction * h, certify)
        return result.after, result

    fractions = program.substeps
    prepared = program.prepare(parameters, state, h)
    if len(fractions) == 1:
        after, result = substep(prepared, fractions[0])
    else:
        after, results = lax.scan(substep, jax.tree.map(jnp.asarray, prepared), np.array(fractions))
        result = StepResult(
            record=jax.tree.map(lambda rows: rows[0], results.record),
            after=after,
            code=results.code[jnp.argmax(results.code > 0)],
            iterations=jnp.sum(results.iterations),
            certificates={name: jnp.max(values) for name, values in results.certificates.items()},
            course=jax.tree.map(lambda rows: rows[:, 0], results.course),
        )
    after = jax.tree.map(lambda new, old: jnp.where(result.code == 0, new, old), after, before)
    return result._replace(after=after)


def _stages(program: Program, parameters: PyTree, state: PyTree, h: Scalar, certify: bool) -> StepResult:
    """The stages of a substep one after the other."""
    code, iterations, record = jnp.asarray(int(Code.CONVERGED)), jnp.asarray(0), None
    certificates: dict[str, jax.Array] = {}
    unknowns = []
    for stage in program.stages:
        part = stage.fraction * h
        equations, guess = stage.equations(parameters, state, part), stage.guess(parameters, state, part)
        root = stage.structure.root(equations, guess, part, stage.blocks, stage.carried(state))
        inside = stage.chart(parameters, state, part, root.unknowns) < 1.0
        found = (root.code == 0) & inside
        z = jnp.where(found, root.unknowns, guess) if stage.tolerant else root.unknowns
        sound = jnp.where(found, 1.0, 0.0) if stage.tolerant else 1.0
        after = stage.advance(parameters, stage.solved(state, root.found), part, z, sound)
        finite = jnp.stack([jnp.all(jnp.isfinite(leaf)) for leaf in jax.tree.leaves(after)]).all()
        after = stage.carry(after, root.carried)
        here = jnp.where(root.code > 0, root.code, jnp.where(inside, int(Code.CONVERGED), int(Code.BEYOND_CHART)))
        here = jnp.asarray(int(Code.CONVERGED)) if stage.tolerant else here
        here = jnp.where((here == 0) & ~finite, int(Code.NOT_FINITE), here)
        code = jnp.where(code > 0, code, here)
        iterations = iterations + root.iterations
        if record is None and not stage.tolerant:
            record = stage.record(parameters, state, part, z)
        if certify:
            for name, value in stage.certificate(parameters, state, part, z, after).items():
                certificates[name] = jnp.maximum(certificates.get(name, -jnp.inf), value)
        unknowns.append(z)
        state = after
    course = jax.tree.map(lambda leaf: jnp.asarray(leaf)[None], (jnp.concatenate(unknowns), state))
    return StepResult(record, state, code, iterations, certificates, course)


class _Member(NamedTuple):
    """One member between two steps; of several members every leaf has a leading member axis."""

    state: PyTree
    done: jax.Array
    code: jax.Array
    iterations: jax.Array
    iterations_max: jax.Array
    lowest: dict[str, jax.Array]
    highest: dict[str, jax.Array]


class _Carry(NamedTuple):
    member: _Member
    trips: jax.Array
    records: PyTree
    monitors: dict[str, jax.Array]


def _observed(
    program: Program, h: Scalar, monitored: bool, parameters: PyTree, state: PyTree
) -> tuple[StepResult, dict[str, jax.Array]]:
    """A step of one member and its monitors; a value that is not finite, or an event, is the code of the step."""
    result = step(program, parameters, state, h, monitored)
    seen = dict(program.monitors(parameters, result.record, h)) if monitored else {}
    # Observations are results too: they are never NaN.
    stop = [program.stop(parameters, state, result.after)] if program.stops else []
    watched = [*seen.values(), *result.certificates.values(), *stop]
    finite = jnp.asarray([jnp.all(jnp.isfinite(value)) for value in watched], bool).all()
    code = jnp.where((result.code == 0) & ~finite, int(Code.NOT_FINITE), result.code)
    for event in stop:
        code = jnp.where((code == 0) & (event > 0), int(Code.STOPPED), code)
    return result._replace(code=code), seen


def _advanced(member: _Member, result: StepResult, seen: dict[str, jax.Array]) -> _Member:
    """The member after the step; a failed step, and all that follow it, leave it as it was."""
    going = member.code == 0
    good = going & (result.code == 0)
    watched = {**seen, **result.certificates}

    def extreme(choose, old):
        return {name: jnp.where(good, choose(old[name], value), old[name]) for name, value in watched.items()}

    most = jnp.maximum(member.iterations_max, result.iterations)
    return _Member(
        state=jax.tree.map(lambda new, old: jnp.where(good, new, old), result.after, member.state),
        done=member.done + good,
        code=jnp.where(going, result.code, member.code),
        iterations=member.iterations + jnp.where(good, result.iterations, 0),
        iterations_max=jnp.where(going, most, member.iterations_max),
        lowest=extreme(jnp.minimum, member.lowest),
        highest=extreme(jnp.maximum, member.highest),
    )


def _loop(
    program: Program, parameters, state, h, steps, save_every, *, capacity: int, monitored: bool, together: bool = False
) -> _Carry:
    """The steps; together: of members, along the leading axis of the parameters and the state, up to the last one.

    Members take their steps in unison, so that one index places a row of the records of all: with an index a member,
    each step would cost a scatter into, and a choice between, all records.
    """
    observed, advanced = partial(_observed, program, h, monitored), _advanced
    if together:
        observed, advanced = jax.vmap(observed), jax.vmap(advanced)
    observe = jax.jit(observed, inline=True)  # traced once for its shapes and for the loop
    shapes, seen_shapes = jax.eval_shape(observe, parameters, state)

    def rows(shape):
        return jnp.zeros((capacity + 1, *shape.shape), shape.dtype)  # the last row takes the records that are not kept

    def limits(sign):
        watched = {**seen_shapes, **shapes.certificates}
        return {name: jnp.full(shape.shape, sign * jnp.inf) for name, shape in watched.items()}

    def advance(carry: _Carry) -> _Carry:
        result, seen = observe(parameters, carry.member.state)
        row = jnp.where(carry.trips % save_every == 0, carry.trips // save_every, capacity)

        def store(buffer, value):
            return lax.dynamic_update_index_in_dim(buffer, jnp.asarray(value), row, 0)

        return _Carry(
            member=advanced(carry.member, result, seen),
            trips=carry.trips + 1,
            records=jax.tree.map(store, carry.records, result.record),
            monitors=jax.tree.map(store, carry.monitors, seen),
        )

    nothing = jnp.zeros(shapes.code.shape, int)
    member = _Member(state, nothing, nothing, nothing, nothing, limits(1), limits(-1))
    start = _Carry(member, jnp.asarray(0), jax.tree.map(rows, shapes.record), jax.tree.map(rows, seen_shapes))
    return lax.while_loop(lambda c: (c.trips < steps) & jnp.any(c.member.code == 0), advance, start)


_compiled_loop = compiled("capacity", "monitored", "together")(_loop)


def run(
    program: Program, parameters: PyTree, state: PyTree, h: Scalar, records: int, save_every: int, monitors: bool = True
) -> Chunk:
    """records·save_every steps of `program` from `state`, keeping every save_every-th record, `capacity` at most."""
    require_own_xla()
    with jax.enable_x64(True):
        numbers = (np.float64(h), np.int64(records * save_every), np.int64(save_every))
        options = {"capacity": capacity(state), "monitored": monitors, "together": False}
        carry = jax.tree.map(np.asarray, _compiled_loop(program, parameters, state, *numbers, **options))
    end, steps = carry.member, int(carry.member.done)
    valid = min(-(-steps // save_every), records)
    return Chunk(
        records=jax.tree.map(lambda rows: rows[:valid].copy(), carry.records),
        final=end.state,
        steps=steps,
        code=Code(int(end.code)),
        iterations=int(end.iterations),
        iterations_max=int(end.iterations_max),
        monitors={name: rows[:valid].copy() for name, rows in carry.monitors.items()},
        extrema={name: (end.lowest[name], end.highest[name]) for name in end.lowest},
    )


def run_long(program: Program, parameters: PyTree, state: PyTree, h: float, records: int, save_every: int) -> Chunk:
    """`run` without monitors for any number of records, in pieces between which Python sees signals.

    Raises Cut with the steps that were done where it is interrupted.
    """
    clock, steps, found = Clock(PieceLength()), 0, None
    try:
        while found is None or (found.steps < records * save_every and not found.code):
            row, phase = divmod(steps, save_every)
            wished = clock.pace.steps
            blocks, length = min(wished // save_every, records - row, capacity(state)), save_every
            if phase or not blocks:
                blocks, length = 1, min(wished, save_every - phase)
            part = run(program, parameters, state, h, blocks, length, False)
            found = part if found is None else _joined(found, part, keep=not phase)
            state, steps = found.final, found.steps
            clock.lap(blocks * length)
    except KeyboardInterrupt:
        if found is None:
            raise
        raise Cut(found) from None
    return found


def _joined(before: Chunk, now: Chunk, keep: bool) -> Chunk:
    """Two stretches of a run, one after the other; keep: whether the records of the second one are records of both."""
    rows = jax.tree.map(lambda a, b: np.concatenate([a, b]) if keep else a, before.records, now.records)
    return replace(
        now,
        records=rows,
        steps=before.steps + now.steps,
        iterations=before.iterations + now.iterations,
        iterations_max=max(before.iterations_max, now.iterations_max),
    )


def _spread(tree: PyTree, axes: PyTree) -> PyTree:
    """Every leaf with a leading member axis; `axes`, a prefix of the tree, is True where there is one already."""
    leaves, structure = jax.tree.flatten(tree)
    flags = jax.tree.leaves(jax.tree.map(lambda flag, part: jax.tree.map(lambda _: flag, part), axes, tree))
    count = next(np.shape(leaf)[0] for leaf, flag in zip(leaves, flags, strict=True) if flag)
    pairs = zip(leaves, flags, strict=True)
    filled = [leaf if flag else np.broadcast_to(leaf, (count, *np.shape(leaf))) for leaf, flag in pairs]
    return jax.tree.unflatten(structure, filled)


def run_ensemble(
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
    """`run` for many members together; `axes`: True where a leaf of (parameters, state) has a leading member axis.

    records ≤ `capacity` of the state with the axis of members.
    """
    spread = _spread((parameters, state), axes)
    require_own_xla()
    with jax.enable_x64(True):
        numbers = (np.float64(h), np.int64(records * save_every), np.int64(save_every))
        options = {"capacity": capacity(spread[1], together=True), "monitored": monitors, "together": True}
        carry = _compiled_loop(program, *spread, *numbers, **options)
        end = jax.tree.map(np.asarray, carry.member)
        kept, seen = jax.tree.map(lambda rows: np.asarray(rows[:records]), (carry.records, carry.monitors))
    rows = np.minimum(-(-end.done // save_every), records)
    absent = np.arange(records) >= rows[:, None]

    def by_member(values):
        values = np.array(np.moveaxis(values, 0, 1), order="C")
        values[absent] = np.nan
        return values

    return EnsembleChunk(
        records=jax.tree.map(by_member, kept),
        final=end.state,
        steps=end.done,
        rows=rows,
        code=end.code,
        iterations=end.iterations,
        iterations_max=end.iterations_max,
        monitors={name: by_member(values) for name, values in seen.items()},
        extrema={name: (end.lowest[name], end.highest[name]) for name in end.lowest},
    )
