"""Native code that steps without monitors, by loops over links, and XLA that observes many of its records together."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from coadjoint.arrays import Array, PyTree, Scalar
from coadjoint.kernels.chunk import Chunk
from coadjoint.kernels.packing import layout, pack
from coadjoint.kernels.program import Code, Program
from coadjoint.kernels.run import native
from coadjoint.kernels.run.compiled import compiled
from coadjoint.kernels.trace.fork_safety import require_own_xla

ROOM = 2**22
"""The most bytes of records that are observed together, which stay in the cache of a processor."""

MOST = 64
"""The most records that are observed together: more save no time."""


class _Seen(NamedTuple):
    """The observations of some steps, a row for each: monitors, certificates, and whether all of them are finite."""

    monitors: dict[str, Array]
    certificates: dict[str, Array]
    finite: Array


def run(
    program: Program, parameters: PyTree, state: PyTree, h: Scalar, records: int, save_every: int, monitors: bool = True
) -> Chunk:
    """records·save_every steps of `program` from `state`, keeping every save_every-th record.

    Every step is observed; one where an observation is not finite fails.
    """
    total, together = records * save_every, max(min(ROOM // (8 * layout(state).size), MOST), 1)
    whole, parts = None, []
    while whole is None or (whole.steps < total and not whole.code):
        done = 0 if whole is None else whole.steps
        part = _part(program, parameters, state, h, min(together, total - done), together)
        due = slice(-done % save_every, None, save_every)
        parts.append(jax.tree.map(lambda rows, due=due: rows[due], (part.records, dict(part.monitors))))
        whole, state = _continued(whole, part), part.final
    kept, seen = jax.tree.map(lambda *rows: np.concatenate(rows), *parts)
    return replace(whole, records=kept, monitors=seen)


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


def _part(program: Program, parameters: PyTree, state: PyTree, h: Scalar, steps: int, together: int) -> Chunk:
    """Some steps, with a record, monitors and, in `extrema`, the limits of each; up to one that fails."""
    chunk = native.run(program, parameters, state, h, steps, 1, monitors=False)
    seen = _seen(program, parameters, chunk, h, together)
    good = chunk.steps if np.all(seen.finite) else int(np.argmin(seen.finite))
    if good < chunk.steps:
        chunk = replace(native.run(program, parameters, state, h, good, 1, monitors=False), code=Code.NOT_FINITE)
        seen = jax.tree.map(lambda rows: rows[:good], seen)
    both = {**seen.monitors, **seen.certificates}
    limits = {name: (np.min(rows, 0, initial=np.inf), np.max(rows, 0, initial=-np.inf)) for name, rows in both.items()}
    return replace(chunk, monitors=seen.monitors, extrema=limits)


def _seen(program: Program, parameters: PyTree, chunk: Chunk, h: Scalar, together: int) -> _Seen:
    """The observations of the steps of a chunk; the last node fills what is missing of `together` steps."""
    end = pack(chunk.final)[1]
    rows = np.tile(end, (together + 1, 1))
    if chunk.steps:
        rows[: chunk.steps] = np.concatenate([x.reshape(chunk.steps, -1) for x in jax.tree.leaves(chunk.records)], 1)
    require_own_xla()
    with jax.enable_x64(True):
        found = _observe(program, parameters, chunk.final, rows, np.float64(h))
    return jax.tree.map(lambda values: np.asarray(values)[: chunk.steps], found)


@compiled()
def _observe(program: Program, parameters: PyTree, like: PyTree, rows: Array, h: Scalar) -> _Seen:
    """The observations of steps from the records in `rows` to the node of the next row."""
    read = layout(like).views

    def one(row: Array, following: Array) -> _Seen:
        record = read(row)
        stage = program.linked(record)
        seen, certificates = dict(program.monitors(parameters, record, h)), {}
        if stage is not None:
            certificates = dict(stage.certificate(parameters, record, h, read(following)))
        values = [jnp.ravel(jnp.isfinite(value)) for value in (*seen.values(), *certificates.values())]
        return _Seen(seen, certificates, jnp.all(jnp.concatenate(values)))

    return jax.vmap(one)(rows[:-1], rows[1:])
