"""Each wrong use of an inertial unit's readings in a filter is told in a sentence, and so are gaps."""

from __future__ import annotations

import warnings
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import coadjoint as co
from coadjoint import estimation
from coadjoint.estimation.filtered import Consistency
from coadjoint.estimation.timetable import Series, require_readings

Strapdown: Any = estimation.StrapdownProcess
TIMES = np.arange(0.0, 2.0, 0.02)
REST = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, -9.81], (len(TIMES), 1))
PLACES = (np.arange(0.0, 2.0, 0.5), np.zeros((4, 3)))


@cache
def process():
    return Strapdown(noise={"gyroscope": 1e-3, "accelerometer": 1e-2})


def filter(**given: Any) -> Any:
    arguments: dict[str, Any] = {
        "measurements": {"place": estimation.Measurement(lambda motion: motion.q, 0.25)},
        "deviations": {"attitude": 0.1, "velocity": 0.1, "position": 1.0},
        **given,
    }
    return estimation.Filter(process(), estimation.InertialState(), **arguments)


def run(imu: Any = None, **given: Any) -> Any:
    inputs = {} if imu is None else {"imu": imu}
    return filter().run(given.pop("measured", {"place": PLACES}), inputs=inputs, **{"dt": 0.02, **given})


def with_hole():
    y = REST.copy()
    y[5, 2] = np.nan
    return TIMES, y


def seen(function):
    return filter(measurements={"place": estimation.Measurement(function, 1.0)})


def whole() -> Any:
    return run((TIMES, REST), covariances=True)


WRONG = {
    "a number as noise": (lambda: Strapdown(noise=1e-3), "`noise` of .*StrapdownProcess must be name → number, but is"),
    "a text as noise": (lambda: Strapdown(noise={"gyroscope": "1e-3"}), "must be numbers that are finite .* '1e-3'"),
    "a text as gravity": (
        lambda: Strapdown(gravity="9.81"),
        "`gravity` of .* must be a finite number from 0, but is '9.81'",
    ),
    "texts as values": (
        lambda: run((TIMES, REST), measured={"place": (PLACES[0], [["0"] * 3] * 4)}),
        "must be .times, ",
    ),
    "a text as value": (lambda: filter().update({"place": ["1", "2", "3"]}), "`place` of `measured` must be"),
    "a text as input": (lambda: filter().predict(0.02, {"imu": ["0"] * 6}), "The input `imu` "),
    "a time that is NaN": (
        lambda: run((TIMES, REST), measured={"place": ([0.5, np.nan], np.zeros((2, 3)))}),
        "times of `place` of `measured` must be finite, but number 1 of 2 is nan: leave it out",
    ),
    "a place of two numbers": (
        lambda: process().row(estimation.InertialState(position=(1, 2))),
        r"`position` of an InertialState must have shape \(3,\)",
    ),
    "a truth that is a table": (
        lambda: whole().nees({"q": 1}),
        "an InertialState with .*, or rows of numbers",
    ),
    "a truth of other nodes": (
        lambda: whole().nees(estimation.InertialState(position=np.zeros((5, 3)))),
        r"must have shape \(76, 28\), but has shape \(5, 28\)",
    ),
    "a truth of unlike nodes": (
        lambda: whole().nees(estimation.InertialState(position=np.zeros((5, 3)), velocity=np.zeros((4, 3)))),
        "unlike counts of nodes: .*velocity .4, 3., position .5, 3.",
    ),
    "a number as drift": (lambda: Strapdown(drifting=1.0), "`drifting` of .* must be name → drift, but is 1.0"),
    "gravity up": (lambda: Strapdown(gravity=-9.81), "`gravity` of .* must be a finite number from 0, but is -9.81"),
    "mounting in degrees": (lambda: Strapdown(euler_zyx=(180, 0, 0)), "must be angles in rad, up to 2π"),
    "no reading": (lambda: run(), "no step without a reading of `imu`, but those of `inputs` are missing"),
    "a prediction without one": (
        lambda: filter().predict(0.1),
        "no step without a reading of `imu`: give inputs={'imu'",
    ),
    "readings that begin late": (lambda: run((TIMES + 0.7, REST)), "begin at 0.7 s, and the filter is at t = 0 s"),
    "a reading that is NaN": (lambda: run(with_hole()), "must be finite numbers, but not all are at t = 0.1 s: leave"),
    "far too many steps": (lambda: run((TIMES, REST), dt=1e-9), "1.5e.09 steps of 1e-09 s would take 450 GB"),
    "an end that is no time": (lambda: run((TIMES, REST), until="x"), "`until` must be a finite number, but is"),
    "measurements without names": (lambda: filter(measurements=[1]), "`measurements` must be name → Measurement"),
    "deviations without names": (lambda: filter(deviations=1.0), "`deviations` must be name → number, but is 1.0"),
    "values without names": (lambda: filter().update([1]), "`measured` must be name → value, but is"),
    "a time that is no number": (lambda: filter().update({}, t="x"), "`t` must be a finite number, but is 'x'"),
    "inputs without names": (lambda: filter().predict(0.1, [1]), "`inputs` must be name → value, but is"),
    "a function of NumPy": (
        lambda: seen(lambda m: np.sin(m.q)),
        "`place` cannot be differentiated by JAX .* jax.numpy",
    ),
    "a function with if": (lambda: seen(lambda m: m.q if m.q[0] > 0 else -m.q), "jax.numpy, without `if` on values"),
    "a function that fails": (lambda: seen(lambda m: m.depth), "measurement `place` raised .* no `depth`"),
}


@pytest.mark.parametrize(("call", "says"), WRONG.values(), ids=WRONG)
def test_a_wrong_use_of_readings_is_told(call, says):
    with pytest.raises(co.errors.CoadjointError, match=says) as caught:
        call()
    assert len(str(caught.value)) < 400 and "\n" not in str(caught.value)


def test_a_log_that_is_too_large_to_keep_is_refused(monkeypatch):
    monkeypatch.setattr("coadjoint.estimation.timetable.LARGEST", 2e6)
    with pytest.raises(
        co.errors.ArgumentError,
        match=r"A log of 1,501 nodes would take .* GB of memory, and may take at most 0.002 GB: raise",
    ):
        run((np.arange(0.0, 2.0, 0.001), np.tile(REST[0], (2000, 1))), dt=0.001, covariances=True)
    run((TIMES, REST), covariances=True)


@pytest.mark.parametrize(("hole", "told"), [(slice(30, 60), "from 0.58 s to 1.2 s"), (slice(50, None), "from 0.98 s")])
def test_a_gap_between_readings_is_told(hole: slice, told: str):
    with pytest.warns(UserWarning, match=f"no reading of `imu` {told}"):
        run((np.delete(TIMES, hole), np.delete(REST, hole, axis=0)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run((TIMES, REST))
        again = filter()
        again.predict(0.02, {"imu": REST[0]})
        again.predict(0.02)


def test_what_ends_before_the_log_is_held_up_to_its_end():
    nodes, readings = np.array([0.0, 0.5, 1.0, 5.0, 9.0]), np.linspace(0.0, 1.0, 11)
    with pytest.warns(UserWarning, match="no reading of `imu` from 1 s to 9 s"):
        require_readings("imu", Series(readings, readings[:, None]), nodes, 0.1, True)


def test_a_pause_of_an_hour_between_readings_is_refused():
    with pytest.raises(
        co.errors.ArgumentError, match=r"no reading of `imu` from 0\.58 s to 3600\.6 s.*one filter on each stretch"
    ):
        run((TIMES + np.where(np.arange(len(TIMES)) >= 30, 3600.0, 0.0), REST), until=3601.0)


def test_what_is_printed_tells_of_readings_in_other_units():
    right = run((TIMES, REST))
    with pytest.warns(UserWarning, match="check its unit"):
        wrong = run((TIMES, REST / 9.81))
    assert "place  4 of 4 used, their mean NIS" in str(right) and "of a consistent filter 3" in str(right)
    assert "those of the model; check" not in str(right)
    assert "its values differ from those of the model; check units" in str(wrong)
    assert repr(right) == "<Filtered: 76 nodes to 1.5 s; print it for the NIS of its measurements>"


def test_what_a_gate_left_out_counts_in_no_mean_and_raises_an_alarm_where_it_is_most():
    found = run((TIMES, REST))
    nis = np.array([2.0, 3.0, 4.0, 1e9, np.nan])

    def printed(used):
        one = Consistency(np.arange(5.0), nis, np.array(used))
        return str(replace(found, nis={"place": one}))

    small = replace(found, nis={"place": Consistency(np.arange(5.0), 0.05 * nis, np.array([True] * 3 + [False] * 2))})
    assert "far less; its covariance" in str(small) and "far less" not in printed([True, True, True, False, False])
    assert "3 of 5 used, their mean NIS 3, of" in printed([True, True, True, False, False])
    assert "those of the model; check" not in printed([True, True, True, False, False])
    assert "those of the model; check" in printed([True, False, False, False, False])
    assert "those of the model; check" in printed([True, True, True, True, False])


def test_whole_numbers_of_numpy_are_whole_numbers():
    two: Any = np.int64(2)
    assert filter(members=two).rows.shape[0] == 2 and len(run((TIMES, REST), save_every=two).t) == 38


@pytest.mark.parametrize(("scale", "told"), [(1 / 9.81, "-1.0]"), (-1.0, "9.81]")])
def test_specific_forces_in_g_or_with_z_up_are_told(scale: float, told: str):
    with pytest.warns(UserWarning, match="begins with .* check its unit, its axes") as caught:
        run((TIMES, scale * REST))
    assert told in str(caught[0].message) and "it is [0.0, 0.0, -9.81]" in str(caught[0].message).replace("-0.0", "0.0")


def test_readings_timed_in_milliseconds_are_told():
    with pytest.warns(UserWarning, match="Readings of `imu` come every 20 s, .* in seconds?"):
        run((1000 * TIMES, REST), measured={"place": (1000 * PLACES[0], PLACES[1])}, dt=1.0)


def test_the_true_motion_of_a_nees_may_be_states_or_rows():
    found, n = whole(), len(whole().t)
    truth = estimation.InertialState(found.t, np.tile(np.eye(3), (n, 1, 1)), position=np.tile([0.1, 0.0, 0.0], (n, 1)))
    rows = found.rows.copy()
    rows[:, 1:10], rows[:, 10:13], rows[:, 13:16], rows[:, 22:] = np.eye(3).ravel(), 0.0, [0.1, 0.0, 0.0], 0.0
    nees, free = found.nees(truth)
    assert free == 9 and np.array_equal(nees, found.nees(rows)[0]) and np.all(nees > 0)
