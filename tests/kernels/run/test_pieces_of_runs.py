"""Runs in pieces, parameters that change in the midst of runs, and the columns of their derivatives."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from coadjoint.kernels.run import batch, native
from coadjoint.kernels.run.batch import PiecewiseParameters, _move, _turn
from coadjoint.kernels.untraceable import NotLinked


def wandering(knots: int, steps: int = 4) -> PiecewiseParameters:
    """Two runs with two parameters, the third and the first, and two components of derivatives."""
    values = np.arange(2.0 * knots * 2).reshape(2, knots, 2)
    return PiecewiseParameters(np.array([2, 0]), 2, steps, values)


@pytest.mark.parametrize(
    ("steps", "knots"),
    [(3, [(0, 0, 3)]), (4, [(0, 0, 4)]), (5, [(0, 0, 4), (1, 4, 1)]), (20, [(0, 0, 4), (1, 4, 4), (2, 8, 12)])],
)
def test_the_last_knot_lasts_to_the_end(steps, knots):
    assert wandering(3).knots(steps) == knots


def test_a_knot_adds_its_values_to_the_parameters_of_each_run():
    p, numbers = np.array([10.0, 20.0, 30.0]), np.zeros((1, 3, 4))
    _move(numbers, p, wandering(3), 1)
    assert numbers[0, 2, :2].tolist() == [30.0 + 2.0, 30.0 + 8.0]
    assert numbers[0, 0, :2].tolist() == [10.0 + 3.0, 10.0 + 9.0] and np.all(numbers[0, 1] == 0.0)


def test_directions_of_parameters_go_from_a_knot_to_the_next():
    """One direction of all steps, then two for each of three knots, of which one pair at a time moves parameters."""
    directions, along = np.zeros((7, 2)), np.array([[1.0, 2.0], [3.0, 4.0]])
    directions[0], directions[1:3] = 9.0, along
    assert _turn(directions, wandering(3), 0) == 3 and np.array_equal(directions[1:3], along)
    assert _turn(directions, wandering(3), 1) == 5
    assert np.array_equal(directions[3:5], along) and not np.any(directions[1:3]) and not np.any(directions[5:])
    assert _turn(directions, wandering(3), 2) == 7
    assert np.array_equal(directions[5:], along) and not np.any(directions[1:5]) and np.all(directions[0] == 9.0)


def counting(kernel, inputs, result, records: int, save_every: int) -> None:
    """In the place of the machine: lanes count their steps and fail at the step of their parameter, in 3 iterations."""
    fails, _ = inputs
    for lane in range(result.state.shape[1]):
        done, code, iterations, most = result.status[:, lane]
        for row in range(records):
            result.records[row, 0, lane] = result.state[0, lane]
            for _ in range(save_every if code == 0 else 0):
                if result.state[0, lane] == fails[0, lane]:
                    code = 2
                    break
                result.state[0, lane] += 1
                done, iterations, most = done + 1, iterations + 3, max(most, result.state[0, lane])
        result.status[:, lane] = done, code, iterations, most


@pytest.mark.parametrize("steps", [1, 3, 5, 7, 12])
def test_pieces_of_a_run_are_that_run_although_lanes_fail_on_the_way(monkeypatch, steps):
    def launched(most: int, fails: list[float]) -> native.LaneArrays:
        pace, record = SimpleNamespace(steps=most), SimpleNamespace(size=1)
        kernel: Any = SimpleNamespace(pace=pace, record=record, monitor_size=0, certificates=())
        return native.launch(kernel, np.array([fails]), np.full(3, 0.1), np.zeros((1, 3)), 4, 5)

    took: list[int] = []
    monkeypatch.setattr(native, "_call", counting)
    monkeypatch.setattr(native, "Clock", lambda pace: SimpleNamespace(lap=took.append))
    found, whole = launched(steps, [2.0, 13.0, 99.0]), launched(20, [2.0, 13.0, 99.0])
    assert found.status.tolist() == whole.status.tolist() == [[2, 13, 20], [2, 2, 0], [6, 39, 60], [2, 13, 20]]
    assert found.state.tolist() == [[2, 13, 20]] and sum(took) == 20 and max(took) <= steps
    for lane, rows in enumerate((1, 3, 4)):
        assert found.records[:rows, 0, lane].tolist() == whole.records[:rows, 0, lane].tolist() == [0, 5, 10, 15][:rows]
    took.clear()
    assert launched(steps, [2.0, 1.0, 0.0]).status[0].tolist() == [2, 1, 0] and sum(took) < 3 + steps


def test_parameters_with_derivatives_stay_symbols_although_they_are_zeros_or_ones(monkeypatch):
    class Seen(Exception):
        pass

    def plan(program, parameters, state, pattern, monitors, unrolled):
        raise Seen(pattern)

    monkeypatch.setattr(batch, "plan", plan)
    for active, pattern in (((), (0, 1, 2, 0, 1)), ((0, 4), (2, 1, 2, 0, 2)), ((1, 2), (0, 2, 2, 0, 1))):
        with pytest.raises(Seen) as raised:
            batch.driven(cast(Any, "a program"), np.array([0.0, 1.0, 0.7, 0.0, 1.0]), np.zeros(2), active)
        assert raised.value.args[0] == pattern


def test_a_chain_whose_links_were_found_to_differ_is_not_written_in_loops_again(monkeypatch):
    monkeypatch.setattr(native.plans, "name", lambda *_: "its name")
    monkeypatch.setattr(native.disk_cache, "find", {"its name": {"unlike": "a link differs"}}.get)
    variant = native.Variant(cast(Any, ()), cast(Any, ()), (), False, 1)
    with pytest.raises(NotLinked, match="a link differs"):
        native._kept(cast(Any, None), (), (), variant, None)
