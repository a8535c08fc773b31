"""Native code and XLA give the same runs, and the choice between them is said once."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from vehicle import PAPER, LeftRectangle, VehicleProgram, start

from coadjoint.errors import ArgumentError
from coadjoint.kernels.run import backend, xla

H = 0.01


def assert_close(ours, theirs, tolerance=1e-12):
    for x, y in zip(jax.tree.leaves(ours), jax.tree.leaves(theirs), strict=True):
        assert np.shape(x) == np.shape(y)
        np.testing.assert_allclose(x, y, rtol=tolerance, atol=tolerance * max(1.0, np.max(np.abs(y), initial=0.0)))


def everything(chunk):
    return chunk.records, chunk.final, dict(chunk.monitors), {name: chunk.extrema[name] for name in chunk.monitors}


@pytest.mark.long
def test_both_kernels_give_the_same_chunk(monkeypatch):
    """With as many records as a chunk may have, of which the last one is kept as the others are."""
    monkeypatch.setattr(xla, "CAPACITY", 5)
    s = start(H, [1.0, -2.0, 3.0])
    ours, theirs = (backend.run(name, VehicleProgram(), PAPER, s, H, 5, 20) for name in ("native", "xla"))
    assert_close(everything(ours), everything(theirs))
    for name in ("steps", "code"):
        assert getattr(ours, name) == getattr(theirs, name)
    assert 0 < ours.iterations <= 2 * theirs.iterations, "chords shrink by a factor"
    assert set(ours.extrema) == set(theirs.extrema)


@pytest.mark.long
def test_both_kernels_give_the_same_ensemble():
    starts = [start(H, xi) for xi in ([1.0, -2.0, 3.0], [0.1, 0.2, 0.3], [np.nan, 0, 0])]
    s = jax.tree.map(lambda *leaves: np.stack(leaves), *starts)
    native, xla = (
        backend.run_ensemble(name, VehicleProgram(), PAPER, s, H, 2, 20, axes=(False, True))
        for name in ("native", "xla")
    )
    # A state of NaN stays in both: compare the members that are well.
    well = slice(0, 2)
    for ours, theirs in zip(everything(native), everything(xla), strict=True):
        assert_close(jax.tree.map(lambda x: x[well], ours), jax.tree.map(lambda x: x[well], theirs))
    for name in ("steps", "rows", "code"):
        np.testing.assert_array_equal(getattr(native, name), getattr(xla, name))
    assert np.all(native.iterations <= 2 * np.asarray(xla.iterations))


@dataclass(frozen=True)
class Sorting(LeftRectangle):
    def guess(self, p, s, h):
        return super().guess(p, s, h)[jnp.argsort(jnp.arange(6.0) + 0.0 * s.t)]


def test_a_fallback_is_told_once_and_names_the_primitive():
    program = VehicleProgram((Sorting(),))
    with pytest.warns(match="`sort`"):
        assert backend.choose(program, PAPER, start(H), True, "auto") == "xla"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert backend.choose(program, PAPER, start(H), True, "auto") == "xla"
    with pytest.raises(ArgumentError, match="`sort`"):
        backend.choose(program, PAPER, start(H), True, "native")
    assert backend.choose(VehicleProgram(), PAPER, start(H), True, "auto") == "native"


def test_an_unknown_backend_is_refused():
    with pytest.raises(ArgumentError, match="`backend` must be"):
        backend.choose(VehicleProgram(), PAPER, start(H), True, "cuda")  # pyright: ignore
