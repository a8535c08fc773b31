"""Native code that steps without monitors, by loops over links, and XLA that observes many of its records together.

NumPy observes the records of a brief run, for which XLA would compile for seconds; they agree to round-off.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.errors import ArgumentError
from coadjoint.kernels.chunk import Chunk
from coadjoint.kernels.packing import flattened, layout, pack
from coadjoint.kernels.program import Code, LinkedStage, Program
from coadjoint.kernels.run import native
from coadjoint.kernels.run.compiled import compiled
from coadjoint.kernels.trace.fork_safety import require_own_xla

ROOM = 2**22
"""The most bytes of records between two observations, which stay in the cache of a processor."""

UNSOLVED = 1e-6
"""The largest residual of a step relative to its momentum that an iteration which has settled may leave."""

MOST = 64
"""The most records that XLA observes in one call: more save no time."""

BRIEF, NUMBERS = 512, 2**20
"""The most steps of a run that NumPy observes, and numbers in all its records: as quickly as XLA compiles."""

TOGETHER = 16
"""How many of its records NumPy observes in one call."""


class _Seen(NamedTuple):
    """The observations of some steps, a row for each: monitors, certificates, and whether all of them are finite.

    nodes: the records and the node at their end as rows of numbers, (steps + 1, size), if observing completes them.
    """

    monitors: Mapping[str, Any]
    certificates: Mapping[str, Any]
    finite: Array
    nodes: Any


def run(
    program: Program, parameters: PyTree, state: PyTree, h: Scalar, records: int, save_every: int,
    monitors: bool = True, *, pattern: tuple[int, ...] | None = None, by_numpy: bool = False,
) -> Chunk:  # fmt: skip
    """records·save_every steps of `program` from `state`, keeping every save_every-th record.

    Every step is observed; one where an observation is not finite fails. pattern: as in `native.run`. by_numpy: whether
    NumPy observes (`brief`), in place of XLA.
    """
    total, ahead = records * save_every, max(ROOM // (8 * layout(state).size * len(program.substeps)), 1)
    together = min(ahead, TOGETHER if by_numpy else MOST)
    part = partial(_part, program, parameters, h=h, together=together, pattern=pattern, by_numpy=by_numpy)
    done_so_far, parts = None, []
    while done_so_far is None or (done_so_far.steps < total and not done_so_far.code):
        done = 0 if done_so_far is None else done_so_far.steps
        found = part(state, min(ahead, total - done))
        due = slice(-done % save_every, None, save_every)
        chosen = jax.tree.map(lambda rows, due=due: rows[due], (found.records, dict(found.monitors)))
        parts.append(chosen if save_every == 1 else jax.tree.map(np.copy, chosen))
        done_so_far, state = _continued(done_so_far, found), found.final
    kept, seen = jax.tree.map(lambda *rows: np.concatenate(rows), *parts)
    return replace(done_so_far, records=kept, monitors=seen)


def brief(program: Program, state: PyTree, steps: int) -> bool:
    """Whether NumPy observes a run of so many steps; it has no rule for the ledger of inputs, which is a loop."""
    parts = steps * len(program.substeps)
    return parts <= BRIEF and parts * layout(state).size <= NUMBERS and getattr(state, "ledger", None) is None


def _continued(before: Chunk | None, part: Chunk) -> Chunk:
    """Both stretches of a run; records and monitors are those of the second."""
    if before is None:
        return part
    pairs = ((name, *limits, *part.extrema[name]) for name, limits in before.extrema.items())
    limits = {name: (np.minimum(a, c), np.maximum(b, d)) for name, a, b, c, d in pairs}
    return replace(
        part,
        steps=before.steps + part.steps,
        iterations=before.iterations + part.iterations,
        iterations_max=max(before.iterations_max, part.iterations_max),
        extrema=limits,
    )


def _part(
    program: Program, parameters: PyTree, state: PyTree, steps: int, *, h: Scalar, together: int,
    pattern: tuple[int, ...] | None, by_numpy: bool = False,
) -> Chunk:  # fmt: skip
    """Some steps, with a record, monitors and, in `extrema`, the limits of each; up to one that fails."""
    advance = partial(native.run, program, parameters, state, h, save_every=1, monitors=False, pattern=pattern)
    chunk, parts, read = advance(steps, substeps=True), len(program.substeps), layout(state)
    rows = np.concatenate([chunk.records.reshape(-1, read.size), pack(chunk.final)[1][None]])
    monitors, certificates, finite, nodes = _seen(program, parameters, state, rows, h, together, by_numpy)
    good = chunk.steps if np.all(finite) else int(np.argmin(finite))
    _require_solved(certificates, good)
    if good < chunk.steps:
        chunk = replace(advance(good, substeps=True), code=Code.NOT_FINITE)
    rows, end = rows if nodes is None else nodes, good * parts
    final = chunk.final if nodes is None else read.unpack(rows[end])
    both = {name: x[:good] for name, x in {**monitors, **certificates}.items()}
    return replace(
        chunk,
        records=read.views(rows[:end:parts]),
        final=final,
        monitors={name: both[name] for name in monitors},
        extrema={name: (np.min(x, 0, initial=np.inf), np.max(x, 0, initial=-np.inf)) for name, x in both.items()},
    )


def _require_solved(certificates: Mapping[str, Any], good: int) -> None:
    """Raise ArgumentError where the equations of all links are not solved by those of links that are alike."""
    residual = np.asarray(certificates.get("newton_residual", ()))[:good]
    if np.any(residual > UNSOLVED):
        raise ArgumentError(
            f"Step {int(np.argmax(residual > UNSOLVED))} of a stretch does not solve the equations of all links, by "
            f"{np.max(residual):.1g} of the momentum: a force or the Lagrangian acts on some links in a way that does "
            'not show at the start. Use backend="xla".'
        )


def _seen(
    program: Program, parameters: PyTree, start: PyTree, rows: np.ndarray, h: Scalar, together: int, by_numpy: bool
) -> _Seen:
    """The observations of the steps between rows, each a record or the node at the end, so many steps in a call."""
    if not by_numpy:
        require_own_xla()
    observe = _observe.by_numpy if by_numpy else _observe
    parts, found = len(program.substeps), list[_Seen]()
    steps, wide = (len(rows) - 1) // parts, together * parts
    for first in range(0, max(steps * parts, 1), wide):
        piece = rows[first : first + wide + 1]
        missing = wide + 1 - len(piece)  # the node at the end stands in for them
        if missing:
            piece = np.concatenate([piece, np.broadcast_to(piece[-1], (missing, rows.shape[1]))])
        with jax.enable_x64(True):
            seen = jax.tree.map(np.asarray, observe(program, parameters, start, piece, np.float64(h)))
        if seen.nodes is not None:
            start = layout(start).unpack(seen.nodes[wide])
        found.append(seen)
    each = [one[:3] for one in found]
    monitors, certificates, finite = jax.tree.map(lambda *x: np.concatenate(x)[:steps], *each)
    nodes = None
    if found[0].nodes is not None:
        nodes = np.concatenate([*(one.nodes[:wide] for one in found), found[-1].nodes[wide:]])
    return _Seen(monitors, certificates, finite, nodes)


@compiled()
def _observe(program: Program, parameters: PyTree, start: PyTree, rows: Array, h: Scalar) -> _Seen:
    """The observations of steps from the records in `rows` to the node of the next row, after a start."""
    stage = program.linked(start)
    with nullcontext() if stage is None else stage.observing():
        return _observed(program, stage, parameters, start, rows, h)


def _observed(
    program: Program, stage: LinkedStage | None, parameters: PyTree, start: PyTree, rows: Array, h: Scalar
) -> _Seen:
    given, parts = jax.vmap(layout(start).views)(rows), len(program.substeps)
    lengths = jnp.tile(h * np.array(program.substeps), (len(rows) - 1) // parts)
    nodes = given if stage is None else stage.accounted(parameters, start, given, lengths)
    before, after = (jax.tree.map(lambda rows, s=s: rows[s], nodes) for s in (np.s_[:-1], np.s_[1:]))
    first = jax.tree.map(lambda rows: rows[::parts], before)
    seen, certificates = dict(jax.vmap(lambda record: program.monitors(parameters, record, h))(first)), {}
    if stage is not None:
        found = jax.vmap(lambda *pair: stage.certificate(parameters, *pair))(before, lengths, after)
        certificates = {name: jnp.max(jnp.reshape(x, (-1, parts)), axis=1) for name, x in found.items()}
    values = [jnp.reshape(jnp.isfinite(x), (len(x), -1)) for x in (*seen.values(), *certificates.values())]
    nodes_seen = None if nodes is given else jax.vmap(flattened)(nodes)
    return _Seen(seen, certificates, jnp.all(jnp.concatenate(values, axis=1), axis=1), nodes_seen)
