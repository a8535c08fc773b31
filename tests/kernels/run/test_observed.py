"""Native code that observes nothing, with XLA for the monitors of its records."""

from __future__ import annotations

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
import pytest

from coadjoint.kernels.chunk import Chunk
from coadjoint.kernels.program import Code
from coadjoint.kernels.run import native, observed
from coadjoint.kernels.run.compiled import Compiled

H = 0.5
CALLS: list[int] = []
"""The steps of each call of machine code."""


@dataclass(frozen=True)
class Counting:
    """x + h at every step; one monitor is x² − 4x, the other is not finite from x = `bad` on."""

    bad: float
    stages, substeps = (), (1.0,)

    def linked(self, state):
        return None

    def monitors(self, parameters, record, h):
        x = record["x"]
        return {"square": x**2 - 4 * x, "bounded": jnp.where(x < self.bad, x, jnp.nan)[None]}


def counted(program, parameters, state, h, records, save_every, monitors=True, substeps=False, pattern=None):
    """The steps that machine code does, one iteration each; it fails where x would exceed 8."""
    assert save_every == 1 and not monitors and substeps
    CALLS.append(records)
    x = state["x"] + h * np.arange(records + 1)
    steps = min(records, round(float(8.0 - state["x"]) / h))
    code = Code.CONVERGED if steps == records else Code.NOT_CONVERGED
    return Chunk(x[:steps, None], {"x": x[steps]}, steps, code, steps, 1, {}, {})


@pytest.fixture(autouse=True)
def pieces(monkeypatch):
    """Four records together."""
    monkeypatch.setattr(native, "run", counted)
    monkeypatch.setattr(observed, "MOST", 4)
    CALLS.clear()


def xla_begins(*_):
    raise AssertionError("compiled by XLA")


@pytest.mark.parametrize("by_numpy", [False, True])
def test_every_step_is_observed_and_every_save_every_th_record_is_kept(monkeypatch, by_numpy):
    monkeypatch.setattr(observed, "TOGETHER", 4)
    if by_numpy:
        monkeypatch.setattr(Compiled, "__call__", xla_begins)
    found = observed.run(Counting(9.0), (), {"x": np.float64(0.0)}, H, 3, 5, by_numpy=by_numpy)
    assert (found.steps, found.code, found.iterations, found.final["x"]) == (15, Code.CONVERGED, 15, 7.5)
    np.testing.assert_array_equal(found.records["x"], [0.0, 2.5, 5.0])
    np.testing.assert_array_equal(found.monitors["square"], [0.0, -3.75, 5.0])
    assert found.extrema["square"] == (-4.0, 21.0) and found.monitors["bounded"].shape == (3, 1)
    assert found.extrema["bounded"] == (0.0, 7.0)
    assert CALLS == [15]


def test_a_run_is_brief_by_its_steps_and_by_the_numbers_in_its_records():
    few, many = {"x": np.zeros(8)}, {"x": np.zeros(8192)}
    assert observed.brief(Counting(0.0), few, 512) and not observed.brief(Counting(0.0), few, 513)
    assert observed.brief(Counting(0.0), many, 128) and not observed.brief(Counting(0.0), many, 129)


def test_no_more_steps_are_taken_before_they_are_observed_than_the_cache_holds(monkeypatch):
    monkeypatch.setattr(observed, "ROOM", 8 * 6)
    found = observed.run(Counting(9.0), (), {"x": np.float64(0.0)}, H, 3, 5)
    assert CALLS == [6, 6, 3] and (found.steps, found.iterations, found.iterations_max) == (15, 15, 1)
    assert found.extrema == {"square": (-4.0, 21.0), "bounded": (0.0, 7.0)}
    np.testing.assert_array_equal(found.monitors["square"], [0.0, -3.75, 5.0])


def test_a_run_ends_before_the_step_whose_observations_are_not_finite():
    found = observed.run(Counting(2.75), (), {"x": np.float64(0.0)}, H, 3, 5)
    assert (found.steps, found.code, found.final["x"]) == (6, Code.NOT_FINITE, 3.0)
    np.testing.assert_array_equal(found.records["x"], [0.0, 2.5])
    assert found.extrema["bounded"] == (0.0, 2.5)


def test_a_run_ends_before_the_step_that_machine_code_cannot_solve():
    found = observed.run(Counting(9.0), (), {"x": np.float64(6.0)}, H, 2, 5)
    assert (found.steps, found.code, found.final["x"]) == (4, Code.NOT_CONVERGED, 8.0)
    assert found.extrema["square"] == (12.0, 26.25)
