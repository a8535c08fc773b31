"""Each wrong use of a filter is told in a sentence."""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint import estimation
from coadjoint.estimation.measurements import positive, semidefinite

Filter: Any = estimation.Filter
GaussMarkov: Any = estimation.GaussMarkov
ModelProcess: Any = estimation.ModelProcess
RandomWalk: Any = estimation.RandomWalk
Measurement: Any = estimation.Measurement


def system():
    return co.System(
        co.Translation(1),
        lambda xi, n, nu, p: 0.5 * xi @ xi + 0.5 * nu @ nu,
        additional=co.Trivial(1),
        parameters={"bias": 0.0},
        forces=lambda motion, p: co.Force(force=motion.inputs.push + p.bias - motion.nu),
    )


def start():
    return system().state(q=[0.0], inputs={"push": np.zeros(1)})


@cache
def process():
    return ModelProcess(system(), start(), inputs={"push": [0.0]})


@cache
def filter():
    measurements = {"place": Measurement(lambda m: m.q, 0.1)}
    return Filter(process(), start(), measurements=measurements, deviations={"q": 1.0, "nu": 0.1})


def run(**given):
    arguments = {"measured": {"place": ([1.0], [0.5])}, "dt": 0.1, **given}
    return filter().run(arguments.pop("measured"), **arguments)


WRONG = {
    "no system": (lambda: ModelProcess(None, start()), "`system` must be a co.System"),
    "error": (lambda: ModelProcess(system(), start(), error="middle"), '`error`.*must be "left" or "right"'),
    "method": (
        lambda: ModelProcess(system(), start(), method=co.methods.VariableStep(co.Midpoint())),
        "a method of fixed steps",
    ),
    "a discrete Lagrangian": (
        lambda: ModelProcess(
            (only := co.System(co.SO3(), discrete_lagrangian=lambda xi, h: h * xi @ xi)), only.state()
        ),
        "has only a discrete Lagrangian: give co.System `lagrangian` as well",
    ),
    "noise": (lambda: ModelProcess(system(), start(), inputs={"push": [0.0]}, noise={"drag": 1.0}), "no part `drag`"),
    "negative noise": (
        lambda: ModelProcess(system(), start(), inputs={"push": [0.0]}, noise={"force": -1.0}),
        "finite and not negative",
    ),
    "shape of noise": (
        lambda: ModelProcess(system(), start(), inputs={"push": [0.0]}, noise={"force": [1.0, 2.0]}),
        r"`force` of `noise` must be one number or have shape \(1,\)",
    ),
    "drifting": (
        lambda: ModelProcess(system(), start(), inputs={"push": [0.0]}, drifting={"mass": RandomWalk(1.0)}),
        "no parameter `mass`: did you mean `bias`",
    ),
    "drift": (
        lambda: ModelProcess(system(), start(), inputs={"push": [0.0]}, drifting={"bias": 0.1}),
        "must be a co.estimation.RandomWalk",
    ),
    "time": (lambda: GaussMarkov(0.1, 0.0), "`time` of .* must be positive"),
    "density": (lambda: RandomWalk("much"), "finite and not negative"),
    "covariance": (lambda: Measurement(lambda m: m.q, [[1.0, 2.0], [2.0, 1.0]]), "positive definite"),
    "zero covariance": (lambda: Measurement(lambda m: m.q, 0.0), "must be a positive number"),
    "gate": (
        lambda: Measurement(lambda m: m.q, 1.0, gate=3.0),
        "`gate` of .*, a probability, must be a number between 0 and 1, but is 3.0",
    ),
    "function": (lambda: Measurement(2.0, 1.0), "must be a function of the motion"),
    "size of covariance": (
        lambda: Filter(
            process(), start(), measurements={"q": Measurement(lambda m: m.q, [1.0, 1.0])}, deviations={"q": 1.0}
        ),
        "its noise has 1 numbers",
    ),
    "measurement": (
        lambda: Filter(process(), start(), measurements={"q": lambda m: m.q}, deviations={}),
        "must be a co.estim",
    ),
    "deviation": (
        lambda: Filter(process(), start(), measurements={}, deviations={"yaw": 1.0}),
        "no error `yaw`: it knows g, nu, q, xi",
    ),
    "neither": (lambda: Filter(process(), start(), measurements={}), "either `deviations` or `covariance`"),
    "P": (lambda: Filter(process(), start(), measurements={}, covariance=-np.eye(4)), "without negative eigenvalues"),
    "members": (
        lambda: Filter(process(), start(), measurements={}, deviations={}, members=0),
        "`members` must be a whole number from 1",
    ),
    "state": (lambda: Filter(process(), 3.0, measurements={}, deviations={}), "one of the system's states"),
    "process": (lambda: Filter(system(), start(), measurements={}, deviations={}), "one such as ModelProcess"),
    "shape of a deviation": (
        lambda: Filter(process(), start(), measurements={}, deviations={"q": [1.0, 2.0]}),
        r"`q` of `deviations` must be one number or have shape \(1,\)",
    ),
    "shape of a drift": (
        lambda: ModelProcess(system(), start(), inputs={"push": [0.0]}, drifting={"bias": RandomWalk([1.0, 2.0])}),
        r"how `bias` drifts must be one number or have shape \(1,\)",
    ),
    "far from the mean": (
        lambda: ModelProcess(system(), start(), inputs={"push": [0.0]}, drifting={"bias": GaussMarkov(0.1, 5, mean=1)}),
        "would decay to the mean",
    ),
    "mean": (lambda: GaussMarkov(0.1, 5.0, mean=np.inf), "`mean`.*must be finite"),
    "bias": (
        lambda: ModelProcess(system(), start(), inputs={"push": [0.0]}, biases={"gyro": 0.1}),
        "must be a co.estimation.RandomWalk",
    ),
    "shape of an input": (lambda: filter().predict(0.1, {"push": [1.0, 2.0]}), "input `push` is 1 numbers"),
    "input that is NaN": (lambda: filter().predict(0.1, {"push": np.nan}), "`push` must be finite"),
    "arguments": (
        lambda: Filter(process(), start(), measurements={"q": Measurement(lambda a, b, c, d: a.q, 1.0)}, deviations={}),
        "needs 4 arguments",
    ),
    "times of a clock": (lambda: run(until=1.7e9), "subtract the time at which the log begins"),
    "step": (lambda: filter().predict(0.0), "`dt` must be positive"),
    "input": (lambda: filter().predict(0.1, {"pull": 1.0}), "no input `pull`: did you mean `push`"),
    "name": (lambda: filter().update({"depth": 1.0}), "no measurement `depth`: it knows place"),
    "value": (lambda: filter().update({"place": [1.0, 2.0]}), "1 numbers at each time"),
    "order of times": (lambda: run(measured={"place": ([1.0, 0.5], [0.5, 0.5])}), "must not go back"),
    "times": (lambda: run(measured={"place": ([1.0, 2.0], [0.5])}), "as many values"),
    "an infinite value": (lambda: filter().update({"place": np.inf}), "number 1 of 1 is infinite: leave it out, or"),
    "an infinite value of a log": (
        lambda: run(measured={"place": ([1.0, 2.0], [0.5, -np.inf])}),
        "`place` of `measured` must be numbers, NaN where nothing was measured, but number 2 of 2 is infinite",
    ),
    "pair": (lambda: run(measured={"place": 3.0}), r"must be \(times, values\)"),
    "before": (lambda: run(measured={"place": ([-1.0], [0.5])}, until=1.0), "before the filter"),
    "until": (lambda: run(measured={}), "needs `until`"),
    "end": (lambda: run(until=-2.0), "after the last time of the log"),
    "a time that is True": (lambda: filter().update({}, t=True), "`t` must be a finite number, but is True"),
    "a time in words": (lambda: filter().update({}, t="2.0"), "`t` must be a finite number, but is '2.0'"),
    "a complex time": (lambda: filter().update({}, t=np.complex128(0)), "`t` must be a finite number, but is"),
    "a step that is True": (lambda: filter().predict(True), "`dt` must be positive, but is True"),
    "a value in words": (lambda: filter().update({"place": "4.2"}), "`place` of `measured` must be numbers, but is"),
    "a value that is True": (lambda: filter().update({"place": True}), "`place` of `measured` must be numbers"),
    "times in words": (lambda: run(measured={"place": (["1.0"], [0.5])}), "both numbers, but is"),
    "values that are truth": (lambda: run(measured={"place": ([1.0], [False])}), "both numbers, but is"),
    "an end that is True": (lambda: run(until=True), "`until` must be a finite number, but is True"),
    "dt that is True": (lambda: run(dt=True), "`dt` must be positive, but is True"),
    "an input in words": (lambda: filter().predict(0.1, {"push": "1.0"}), "`push` must be finite numbers, but is"),
    "deviations in words": (lambda: RandomWalk("0.1"), "finite and not negative"),
    "variances in words": (lambda: Measurement(lambda m: m.q, "0.1"), "must be a positive number"),
    "memory that is True": (
        lambda: Filter(process(), start(), measurements={}, deviations={}, memory=True),
        "`memory` must be a finite number from 0, but is True",
    ),
    "every": (lambda: run(save_every=0), "`save_every` must be a whole number from 1"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_use_is_told(case):
    call, sentence = WRONG[case]
    with pytest.raises(co.errors.ArgumentError, match=sentence) as told:
        call()
    assert str(told.value).endswith(".") and len(str(told.value)) < 400


def test_a_model_without_a_step_is_told():
    wild = ModelProcess(system(), start(), inputs={"push": [0.0]})
    lost = Filter(wild, start(), measurements={}, deviations={"q": 1.0})
    lost.rows[:, :] = np.nan
    with pytest.raises(co.errors.StepError, match="The filter failed at t"):
        lost.predict(0.1)


def test_arrays_that_do_not_fit_are_told():
    first, known = start(), {"place": estimation.Measurement(lambda motion: motion.q, 1.0)}
    one = estimation.ModelProcess(system(), first)
    filter = estimation.Filter(one, first, measurements=known, deviations={"q": 1.0, "nu": 1.0})
    rows = filter.rows.copy()
    for name, value in (("rows", rows[0]), ("rows", rows[:, 1:]), ("rows", rows.astype(int)), ("P", np.eye(2))):
        with pytest.raises(co.errors.ArgumentError, match=f"`{name}` of a filter must be a float64 array"):
            setattr(filter, name, value)
    random = np.random.default_rng(1)
    for given, of in ((rows[0], random), (rows[:, 1:], random), (rows, 3)):
        with pytest.raises(co.errors.ArgumentError, match="A step is drawn from rows"):
            one.drawn(given, 0.1, of)
    with pytest.raises(co.errors.ArgumentError, match="velocities of rows"):
        one.with_velocities(rows, np.zeros((1, 2)), np.zeros((1, 1)))
    with pytest.raises(co.errors.ArgumentError, match="`dt` must be positive"):
        filter.predict(True)
    with pytest.raises(co.errors.ArgumentError, match=r"must be the result of `Filter\.run`"):
        co.estimation.smoothed(filter)  # pyright: ignore[reportArgumentType]


@pytest.mark.cases(1)
@pytest.mark.parametrize("turns", [1, 3])
def test_a_compass_in_degrees_is_told_and_one_in_radians_that_is_wrapped_or_counts_turns_is_not(turns):
    t = np.arange(1.0, 60.0)
    heading = np.radians(6.0 * turns * t + 100)
    known = {"yaw": Measurement(lambda m: m.q, 0.1, space=co.SO2()), "place": Measurement(lambda m: m.q, 0.1)}
    more = {"measurements": known, "deviations": {"q": 1.0, "nu": 0.1}, "accuracy": False}
    filter = Filter(process(), start(), **more, members=2)
    both = np.stack([np.degrees(heading) % 360] * 2, axis=1)[..., None]
    with pytest.warns(UserWarning, match="`yaw` of `measured` jumps by 360 .* as degrees do"):
        filter.run({"yaw": (t, both)}, dt=0.5)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        wrapped = np.stack([heading % (2 * np.pi), (heading + np.pi) % (2 * np.pi) - np.pi, heading], axis=1)
        Filter(process(), start(), **more, members=3).run({"yaw": (t, wrapped[..., None])}, dt=0.5)


def test_a_covariance_is_symmetric_and_has_no_negative_variance():
    assert semidefinite(np.array([[4.0, 2.0], [2.0, 1.0]])) and semidefinite(np.diag([1e-20, 0.0, 1e20]))
    for P in (np.diag([1.0, -1e-12]), np.diag([1.0, np.nan]), [[1.0, 1.1], [1.1, 1.0]], [[1.0, 0.5], [0.4, 1.0]]):
        assert not semidefinite(np.asarray(P))
    assert positive(np.array(2.0)) and positive(np.array([1.0, 2.0])) and positive(np.eye(2))
    for R in (np.array([1.0, 0.0]), np.array([1.0, np.inf]), np.zeros((1, 1, 1)), np.ones((2, 2)), np.ones((2, 3))):
        assert not positive(R)
