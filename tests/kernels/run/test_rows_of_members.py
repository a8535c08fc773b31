"""Members of an ensemble by XLA: rows that were reached, NaN behind a step that failed, and shared leaves."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from coadjoint.kernels.run import xla
from coadjoint.kernels.run.xla import ENSEMBLE_CAPACITY, _Carry, _spread, run_ensemble


def test_leaves_without_a_member_axis_are_shared_by_all():
    tree, axes = {"p": np.array([1.0, 2.0]), "q": np.arange(6.0).reshape(3, 2)}, {"p": False, "q": True}
    found = _spread(tree, axes)
    assert found["p"].shape == (3, 2) and np.array_equal(found["p"][2], tree["p"]) and found["q"] is tree["q"]


def test_a_member_has_the_rows_that_it_reached_and_nan_behind(monkeypatch):
    done = np.array([6, 3, 0])
    rows = np.broadcast_to(np.arange(float(ENSEMBLE_CAPACITY)), (3, ENSEMBLE_CAPACITY)).copy()
    asked: dict[str, Any] = {}

    def loops(program, parameters, states, h, steps, save_every, *, capacity, monitored):
        asked.update(h=h, steps=steps, save_every=save_every, capacity=capacity, monitored=monitored)
        seen = {"energy": rows + 0.5}
        ends = {"energy": np.zeros(3)}, {"energy": np.ones(3)}
        return _Carry(states, done, np.array([0, 2, 1]), 4 * done, np.full(3, 5), {"x": rows}, seen, *ends)

    monkeypatch.setattr(xla, "_loops", loops)
    given = (np.zeros(1), np.ones((3, 2)))
    found = run_ensemble(cast(Any, None), *given, 0.1, 3, 2, axes=(False, True))
    assert asked == {"h": 0.1, "steps": 6, "save_every": 2, "capacity": ENSEMBLE_CAPACITY, "monitored": True}
    nan = np.nan
    assert np.array_equal(found.records["x"], [[0, 1, 2], [0, 1, nan], [nan] * 3], equal_nan=True)
    assert np.array_equal(found.monitors["energy"], found.records["x"] + 0.5, equal_nan=True)
    assert found.rows.tolist() == [3, 2, 0] and found.steps is done and found.code.tolist() == [0, 2, 1]
    low, high = found.extrema["energy"]
    assert low.tolist() == [0, 0, 0] and high.tolist() == [1, 1, 1] and found.final.shape == (3, 2)
