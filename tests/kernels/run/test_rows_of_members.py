"""Members of an ensemble by XLA: rows that were reached, NaN behind a step that failed, and shared leaves."""

from __future__ import annotations

from functools import partial
from typing import Any, cast

import jax
import numpy as np
from vehicle import PAPER, VehicleProgram, start

from coadjoint.kernels.run import xla
from coadjoint.kernels.run.xla import ENSEMBLE_CAPACITY, _Carry, _loop, _Member, _spread, capacity, run_ensemble


def test_leaves_without_a_member_axis_are_shared_by_all():
    tree, axes = {"p": np.array([1.0, 2.0]), "q": np.arange(6.0).reshape(3, 2)}, {"p": False, "q": True}
    found = _spread(tree, axes)
    assert found["p"].shape == (3, 2) and np.array_equal(found["p"][2], tree["p"]) and found["q"] is tree["q"]


def test_a_member_has_the_rows_that_it_reached_and_nan_behind(monkeypatch):
    done = np.array([6, 3, 0])
    rows = np.repeat(np.arange(float(ENSEMBLE_CAPACITY))[:, None], 3, axis=1)
    asked: dict[str, Any] = {}

    def loop(program, parameters, states, h, steps, save_every, **options):
        asked.update(options, h=h, steps=steps, save_every=save_every)
        ends = {"energy": np.zeros(3)}, {"energy": np.ones(3)}
        numbers: Any = done, np.array([0, 2, 1]), 4 * done, np.full(3, 5)
        kept: Any = 6, {"x": rows}, {"energy": rows + 0.5}
        return _Carry(_Member(states, *numbers, *ends), *kept)

    monkeypatch.setattr(xla, "_compiled_loop", loop)
    given = (np.zeros(1), np.ones((3, 2)))
    found = run_ensemble(cast(Any, None), *given, 0.1, 3, 2, axes=(False, True))
    options = {"capacity": ENSEMBLE_CAPACITY, "monitored": True, "together": True}
    assert asked == {"h": 0.1, "steps": 6, "save_every": 2} | options
    nan = np.nan
    assert np.array_equal(found.records["x"], [[0, 1, 2], [0, 1, nan], [nan] * 3], equal_nan=True)
    assert np.array_equal(found.monitors["energy"], found.records["x"] + 0.5, equal_nan=True)
    assert found.rows.tolist() == [3, 2, 0] and found.steps is done and found.code.tolist() == [0, 2, 1]
    low, high = found.extrema["energy"]
    assert low.tolist() == [0, 0, 0] and high.tolist() == [1, 1, 1] and found.final.shape == (3, 2)


def test_records_of_all_members_are_placed_with_one_index():
    """With an index a member, a step of 10⁵ members costs a thousand steps of 10³ in place of a hundred."""
    states = jax.tree.map(lambda leaf: np.stack([leaf] * 3), start(0.01))
    parameters = jax.tree.map(lambda leaf: np.stack([leaf] * 3), PAPER)
    with jax.enable_x64(True):
        call = partial(_loop, cast(Any, VehicleProgram()), capacity=64, monitored=True, together=True)
        text = str(jax.make_jaxpr(call)(parameters, states, 0.01, 10, 2))
    assert "f64[65,3,3] = dynamic_update_slice" in text and "scatter" not in text


def test_a_chunk_of_many_members_keeps_fewer_records():
    assert capacity(np.zeros((1000, 20)), together=True) == ENSEMBLE_CAPACITY
    assert capacity(np.zeros((10**6, 20)), together=True) == 1
    assert capacity(np.zeros((10**5, 20)), together=True) == 16
