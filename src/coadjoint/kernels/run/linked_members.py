"""Runs many members of a chain of joints by loops over its links: a trajectory after the other, on threads."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from functools import partial

import jax
import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.kernels.chunk import Chunk, EnsembleChunk
from coadjoint.kernels.emit.plan import specialised
from coadjoint.kernels.program import Program
from coadjoint.kernels.run import native, observed
from coadjoint.kernels.run.ensemble import cores, members_of


def compile(program: Program, parameters: PyTree, state: PyTree, monitors: bool, axes: tuple[PyTree, PyTree]) -> None:
    """Have the kernel with which `run_ensemble` runs these members; raises the errors of `native.compile`."""
    (shape_p, p), (shape_s, s) = members_of(parameters, axes[0]), members_of(state, axes[1])
    variant = native.Variant(shape_p, shape_s, _pattern(p), monitors, 1)
    native.kernel_for(program, shape_p.unpack(p[0]), shape_s.unpack(s[0]), variant)


def run_ensemble(
    program: Program, parameters: PyTree, state: PyTree, h: float, records: int, save_every: int,
    monitors: bool = True, *, axes: tuple[PyTree, PyTree],
) -> EnsembleChunk:  # fmt: skip
    """As `ensemble.run_ensemble`."""
    (shape_p, p), (shape_s, s) = members_of(parameters, axes[0]), members_of(state, axes[1])
    advance = observed.run if monitors else partial(native.run, monitors=False)
    pattern = _pattern(p)

    def member(index: int) -> Chunk:
        constants, start = shape_p.unpack(p[index % len(p)]), shape_s.unpack(s[index % len(s)])
        return advance(program, constants, start, h, records, save_every, pattern=pattern)

    with ThreadPoolExecutor(cores()) as pool:
        return _gathered(list(pool.map(member, range(max(len(p), len(s))))), records)


def _pattern(p: np.ndarray) -> tuple[int, ...]:
    """That of `specialised` for parameters of all members, (members, size)."""
    return specialised(np.where(np.all(p == p[:1], axis=0), p[0], np.nan))


def _gathered(chunks: list[Chunk], records: int) -> EnsembleChunk:
    """The chunks of members as one; records that a member has not are NaN."""

    def filled(*rows: np.ndarray) -> np.ndarray:
        found = np.full((len(rows), records, *rows[0].shape[1:]), np.nan)
        for one, part in zip(found, rows, strict=True):
            one[: len(part)] = part
        return found

    def stacked(name: str) -> np.ndarray:
        return np.array([getattr(chunk, name) for chunk in chunks])

    kept = jax.tree.map(filled, *((chunk.records, dict(chunk.monitors)) for chunk in chunks))
    limits = jax.tree.map(lambda *ends: np.stack(ends), *(dict(chunk.extrema) for chunk in chunks))
    return EnsembleChunk(
        records=kept[0],
        final=jax.tree.map(lambda *leaves: np.stack(leaves), *(chunk.final for chunk in chunks)),
        steps=stacked("steps"),
        rows=np.array([len(jax.tree.leaves(chunk.records)[0]) for chunk in chunks]),
        code=stacked("code").astype(int),
        iterations=stacked("iterations"),
        iterations_max=stacked("iterations_max"),
        monitors=kept[1],
        extrema=limits,
    )
