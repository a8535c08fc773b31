"""Identification with losses that outliers do not dominate."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.identification import Log, identify
from coadjoint.identification.figures import measured_and_simulated
from coadjoint.losses import Huber, Student

SIGMA, DRAG = 0.01, 0.4


@cache
def cart() -> tuple[Any, Any, Log]:
    """A cart with drag that is pushed to and fro, and the log of its place and its speed."""
    system = co.System(
        co.Translation(1),
        lambda xi, p: 0.5 * xi @ xi,
        parameters={"drag": [DRAG]},
        forces=lambda motion, p: co.Force(torque=-p.drag * motion.xi + motion.inputs.push),
    )
    t = 0.1 * np.arange(101)
    push = np.sin(2 * t)[:, None]
    start = system.state(g=[0.0], xi=[0.3], inputs={"push": push[0]})
    run = co.simulate(
        system, start, dt=0.05, steps=200, inputs={"push": co.Held(t, push)}, save_every=2, monitors=False
    )
    random = np.random.default_rng(4)
    x, v = np.asarray(run.records.g)[:, 0], np.asarray(run.dataset.xi.values)[:, 0]
    columns = {"x": x + SIGMA * random.normal(size=101), "v": v + SIGMA * random.normal(size=101)}
    return system, start, Log(t, columns, {"push": push})


def found(log: Log, **options: Any) -> Any:
    system, start, _ = cart()
    seen: Any = {"x": lambda s: s.g[0], "v": lambda s: s.mu[0]}
    guess = system.replace(drag=[0.6])
    given: Any = {"start": start, "parameters": ["drag"], "measured": seen, "segment": None, "dt": 0.05, **options}
    return identify(guess, log, **given)


def spoiled(size: float) -> Log:
    """Every tenth speed is off to one side."""
    _, _, log = cart()
    v = log.columns["v"].copy()
    v[5::10] += size
    return Log(log.time, {**log.columns, "v": v}, log.inputs)


@pytest.mark.parametrize("loss", [Huber(), Student(4)])
def test_outliers_of_one_tenth_hardly_move_a_parameter_and_its_noise(loss: co.losses.Loss):
    robust = found(spoiled(0.2), loss=loss)
    drag = robust["drag[0]"]
    assert abs(drag.value - DRAG) < 3.5 * drag.standard_error and drag.standard_error < 0.01
    assert 0.5 * SIGMA < robust.noise["v"] < 2 * SIGMA
    assert np.max(robust.weights["v"][5::10]) < 0.2 < np.min(robust.weights["x"])


def test_a_wild_value_is_left_out_and_named_by_row_and_column_with_a_loss_only():
    wild = spoiled(0.0).columns["v"].copy()
    wild[40] = 3000.0
    log = cart()[2]
    log = Log(log.time, {**log.columns, "v": wild}, log.inputs)
    log.columns["x"][60] = -999.0
    log = Log(log.time, log.columns, log.inputs)
    with pytest.raises(ArgumentError, match="`v` is 3000 in row 41, at 4 s, between") as raised:
        found(log)
    assert "`x` is -999 in row 61" in str(raised.value)
    robust = found(log, loss=Huber())
    told = [one for one in robust.warnings if "row 41" in one or "row 61" in one]
    assert len(told) == 2 and all(one.startswith("Left out: `") and "leave that" not in one for one in told)
    assert (
        np.isnan(robust.weights["v"][40])
        and abs(robust["drag[0]"].value - DRAG) < 3.5 * robust["drag[0]"].standard_error
    )


@pytest.mark.parametrize(
    ("options", "says"),
    [({"loss": "huber"}, "`loss` must be co.losses.Huber.. or"), ({"loss": Huber(), "coloured": ["v"]}, "white noise")],
)
def test_a_wrong_loss_raises_one_sentence(options: dict[str, Any], says: str):
    with pytest.raises(ArgumentError, match=says):
        found(cart()[2], **options)


def test_logs_of_several_runs_have_no_gaps_between_them():
    log = cart()[2]
    both = found([log.between(0.0, 4.0), log.between(5.0, 10.0)])  # type: ignore[arg-type]
    assert both.segments == 2 and not any("gap" in one for one in both.warnings)


def test_a_delay_that_its_bound_stops_is_named():
    """Both columns are 0.4 s late."""
    log = cart()[2]
    columns = {name: np.concatenate([np.full(4, values[0]), values[:-4]]) for name, values in log.columns.items()}
    late = Log(log.time, columns, log.inputs)
    with pytest.raises(co.errors.CoadjointError, match=r"bound longest_delay=0.1 s stopped delay.both: give a larger"):
        found(late, delays={"both": ["x", "v"]}, longest_delay=0.1, noise={"x": SIGMA, "v": SIGMA})


def test_a_figure_of_three_columns_and_two_runs_labels_each_column_and_breaks_the_line():
    t = 0.1 * np.arange(20)
    log = Log(t, {name: np.sin(t) for name in ("x", "v", "w")}, breaks=(12,))
    figure = measured_and_simulated(log, dict(log.columns))
    first, second, third, empty = figure.axes
    assert not empty.get_visible() and [axes.get_xlabel() for axes in (first, second, third)] == [
        "",
        *2 * ["time $t$ (s)"],
    ]
    assert second.xaxis.get_tick_params()["labelbottom"]
    line = first.lines[1].get_ydata()
    assert np.flatnonzero(np.isnan(line)).tolist() == [11]
