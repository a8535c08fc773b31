"""Optima, controllers and estimators whose dt does not resolve the motion say so once."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import coadjoint as co

BODY = co.System(
    co.SO3(), lambda xi: 0.5 * xi @ (np.array([1.0, 2.0, 3.0]) * xi), forces=lambda m: co.Force(torque=m.inputs.torque)
)
SPIN = [6.0, 1.0, 1.0]


def problem(dt):
    return co.control.Problem(
        BODY, BODY.state(xi=SPIN), dt=dt, steps=6, inputs={"torque": co.control.Input((3,), -20.0, 20.0)},
        cost=lambda m: 0.5 * m.inputs.torque @ m.inputs.torque + m.xi @ m.xi, final_cost=lambda m: m.xi @ m.xi,
    )  # fmt: skip


def told(run) -> list[str]:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        run()
    return [str(one.message) for one in said if "does not resolve this motion" in str(one.message)]


def controlled(stated):
    controller = stated.controller()
    for _ in range(3):
        assert controller(BODY.state(xi=SPIN)).status == "solved"


def estimated(dt):
    seen = {"rate": co.control.Measured(lambda m: m.xi, None, 0.01)}
    stated = co.control.Problem(
        BODY, BODY.state(xi=SPIN), dt=dt, steps=4, free_start={"xi": 1.0}, measured=seen,
        inputs={"torque": co.control.Input((3,))}, cost=lambda m: m.inputs.torque @ m.inputs.torque,
    )  # fmt: skip
    estimator = stated.estimator(known=("torque",))
    for k in range(5):
        estimator({"rate": SPIN}, inputs={"torque": np.zeros(3)} if k else None)


@pytest.mark.parametrize("run", [controlled, pytest.param(lambda stated: stated.solve().run, marks=pytest.mark.long)])
def test_plans_and_optima_of_long_steps_warn_once(run):
    said = told(lambda: run(problem(0.5)))
    assert len(said) == 1 and said[0].startswith("dt = 0.5 ")
    assert told(lambda: run(problem(0.03))) == []


def test_an_estimator_of_long_steps_warns_once():
    assert len(told(lambda: estimated(0.5))) == 1 and told(lambda: estimated(0.03)) == []


@pytest.mark.long
def test_none_is_judged_that_shall_not_be():
    from dataclasses import replace

    silent = replace(problem(0.5), duration=None, accuracy=False)
    assert told(lambda: controlled(silent)) == [] and told(lambda: silent.solve()) == []
