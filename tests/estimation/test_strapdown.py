"""An inertial unit by itself: closed forms of its motion, of its errors' maps, and a filter that finds its biases."""

from __future__ import annotations

from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import coadjoint as co
from coadjoint.estimation import Filter, GaussMarkov, InertialState, Measurement, RandomWalk, StrapdownProcess
from coadjoint.estimation.engines import FilterEngine
from coadjoint.estimation.inertial_state import parts_of
from coadjoint.kernels.trace.evaluate import evaluate

G = 9.81
START = InertialState(2.0, co.attitude.zyx(0.4, -0.2, 0.7), (1.0, -0.5, 0.2), (3.0, 4.0, 5.0))
READING = np.array([0.3, -0.2, 0.5, 0.7, -0.4, -9.0])


@cache
def unit(error="left", mounted=False):
    more = {"position": (0.4, -0.1, 0.2), "euler_zyx": (0.3, 0.1, -0.2)} if mounted else {}
    drifting = {
        "gyroscope_bias": RandomWalk(1e-4),
        "accelerometer_bias": GaussMarkov(0.02, 300.0),
        "current": GaussMarkov(0.3, 600.0),
    }
    noise = {"gyroscope": 1e-3, "accelerometer": [2e-3, 3e-3, 4e-3]}
    return StrapdownProcess(error=error, noise=noise, drifting=drifting, **more)


def hat(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


@pytest.mark.parametrize("step", [0.01, 2.0])
def test_a_constant_rate_and_specific_force_are_integrated_exactly(step):
    """Steps of any length lead to the same motion, that of the differential equations."""
    process = unit()
    row = process.with_inputs(process.row(START)[None], {"imu": READING})
    for _ in range(round(2.0 / step)):
        row = process.advanced(row, step)
    omega, f = READING[:3], READING[3:]

    def rates(t, x):
        R = co.attitude.from_rotation_vector(omega * t)
        return np.concatenate([x[3:], np.asarray(START.rotation) @ R @ f + [0, 0, G]])

    x = solve_ivp(rates, (0, 2), [*START.position, *START.velocity], rtol=1e-12, atol=1e-12).y[:, -1]
    state = process.state(row[0])
    assert state.t == pytest.approx(4.0)
    assert np.allclose(state.position, x[:3], atol=1e-10) and np.allclose(state.velocity, x[3:], atol=1e-10)
    turned = np.asarray(START.rotation) @ co.attitude.from_rotation_vector(2 * omega)
    assert np.allclose(state.rotation, turned, atol=1e-12)


def test_an_inertial_unit_is_at_rest_at_the_origin_unless_told_otherwise():
    parts = parts_of(InertialState())
    np.testing.assert_array_equal(parts.pop("rotation"), np.eye(3))
    assert not any(np.any(part) for part in parts.values())


def test_a_unit_at_rest_stays_where_it_is():
    process = unit("right", True)
    row = process.row(START._replace(velocity=(0, 0, 0)))[None]
    for _ in range(100):
        row = process.advanced(row, 0.1)
    assert np.allclose(process.state(row[0]).position, START.position, atol=1e-11)


@pytest.mark.parametrize("error", ["left", "right"])
def test_errors_are_those_of_retract_however_large_they_are(error):
    process, random = unit(error), np.random.default_rng(3)
    row = process.row(START)[None]
    for angle in (1e-8, 1.0, 3.1):
        e = random.normal(size=(1, process.width))
        e[0, :3] *= angle / np.linalg.norm(e[0, :3])
        assert np.allclose(process.errors(row, process.moved(row, e)), e, atol=1e-11)


@pytest.mark.cases(1)
@pytest.mark.parametrize("error", ["left", "right"])
def test_the_tangent_of_a_step_is_the_closed_form_of_the_invariant_error(error):
    """Barrau and Bonnabel (2017), (28) and (38), with biases: exp of their matrices over a step."""
    from scipy.linalg import expm

    process, h = unit(error), 0.1
    row = process.with_inputs(process.row(START)[None], {"imu": READING})
    after = process.advanced(row, h)
    Phi, Q = process.linearised(row, after, h)
    A = np.zeros((9, 9))
    A[6:9, 3:6] = np.eye(3)
    if error == "left":
        A[:9, :9] -= np.kron(np.eye(3), hat(READING[:3]))
        A[3:6, :3] = -hat(READING[3:])
    else:
        A[3:6, :3] = hat([0, 0, G])
    assert np.allclose(Phi[0, :9, :9], expm(A * h), atol=1e-12)
    for j in range(process.width):
        e = 1e-5 * np.eye(process.width)[j : j + 1]
        ends = [process.advanced(process.moved(row, s * e), h) for s in (1, -1)]
        plus, minus = (process.errors(after, end)[0] for end in ends)
        assert np.allclose((plus - minus) / 2e-5, Phi[0][:, j], atol=3e-9)
    noise = np.array([1e-6] * 3 + [4e-6, 9e-6, 16e-6]) * h
    if error == "left":  # to first order in h
        assert np.allclose(np.diag(Q[0])[:6], noise, rtol=0.05)


@pytest.mark.cases(1)
@pytest.mark.parametrize("error", ["left", "right"])
def test_without_biases_an_error_of_any_size_goes_on_by_a_linear_map(error):
    """Theorem 7 of Barrau and Bonnabel (2017)."""
    process = unit(error)
    row = process.with_inputs(process.row(START)[None], {"imu": READING})
    e = np.zeros((1, process.width))
    e[0, :9] = [0.9, -0.7, 1.1, 2.0, -3.0, 1.0, 4.0, 5.0, -6.0]
    after, other = process.advanced(row, 0.5), process.advanced(process.moved(row, e), 0.5)
    Phi, _ = process.linearised(row, after, 0.5)
    assert np.allclose(process.errors(after, other)[0, :9], Phi[0, :9, :9] @ e[0, :9], atol=1e-10)


@pytest.mark.long
def test_left_and_right_errors_have_the_same_covariances_in_other_axes():
    found = {}
    spread = {"attitude": [0.1, 0.2, 0.3], "velocity": 0.1, "position": [1.0, 2.0, 3.0], "gyroscope_bias": 0.01}
    for error in ("left", "right"):
        process = unit(error, True)
        whole = Measurement(lambda m: m.q, 0.01)
        filter = Filter(process, START, measurements={"place": whole}, deviations=spread)
        filter.predict(0.3, {"imu": READING})
        found[error] = filter.covariance, filter.state
    R, v, q = (np.asarray(part) for part in found["left"][1][1:4])
    T = np.eye(18)
    for i in (0, 3, 6):
        T[i : i + 3, i : i + 3] = R
    T[3:6, :3], T[6:9, :3] = hat(v) @ R, hat(q) @ R
    assert np.allclose(found["right"][0], T @ found["left"][0] @ T.T, rtol=1e-9, atol=1e-13)


def test_what_sensors_read_is_that_of_the_body_origin():
    process = unit("left", True)
    row = process.with_inputs(process.row(START)[None], {"imu": READING})[0]
    r, M = np.array([0.4, -0.1, 0.2]), co.attitude.zyx(0.3, 0.1, -0.2)
    read = process.reading(lambda m, p: jnp.concatenate([m.q, m.nu, m.xi, p.water.velocity]))
    seen = evaluate(read, row)
    R, omega = np.asarray(START.rotation), M @ READING[:3]
    assert np.allclose(seen[:3], np.array(START.position) - R @ r)
    assert np.allclose(seen[3:6], R.T @ START.velocity - np.cross(omega, r)) and np.allclose(seen[6:9], omega)


@pytest.mark.cases(1)
@pytest.mark.parametrize("error", ["left", "right"])
def test_a_log_of_an_unit_and_places_leads_to_the_biases_and_machine_code_does_what_arrays_do(error):
    """A vehicle on a rising spiral; the unit's readings are integrated, places and north are measured."""
    process, h, steps, random = unit(error), 0.05, 1200, np.random.default_rng(5)
    bias = np.array([0.01, -0.02, 0.015, 0.03, -0.02, 0.04])
    t = h * np.arange(steps)
    exact = np.stack([0.2 * np.sin(t), 0.1 * np.cos(0.7 * t), 0.3 + 0 * t], 1)
    rows = [process.row(START._replace(velocity=(1.0, 0, 0)))[None]]
    readings = []
    for k in range(steps):
        R = rows[-1][0, 1:10].reshape(3, 3)
        reading = np.concatenate([exact[k], R.T @ [0.1 * np.sin(0.3 * t[k]), 0.1, -G]])
        rows.append(process.advanced(process.with_inputs(rows[-1], {"imu": reading}), h))
        noise = np.array([1e-3] * 3 + [2e-3, 3e-3, 4e-3]) / np.sqrt(h) * random.normal(size=6)
        readings.append(reading + bias + noise)
    truth, times = np.concatenate(rows), 2.0 + h * np.arange(steps + 1)
    measurements = {
        "place": Measurement(lambda m: m.q, 0.01, gate=0.9999),
        "north": Measurement(lambda m: m.a.north, 1e-4),
    }
    seen = {
        "place": (times[5::5], truth[5::5, 13:16] + 0.1 * random.normal(size=(steps // 5, 3))),
        "north": (times[20::20], truth[20::20, 1:4] + 0.01 * random.normal(size=(steps // 20, 3))),
    }
    spread = {"attitude": 0.05, "velocity": 0.2, "position": 1.0, "gyroscope_bias": 0.02, "accelerometer_bias": 0.04}
    first = START._replace(velocity=(1.1, 0.1, 0.0), position=(3.5, 3.5, 5.5))
    filters = [Filter(process, first, measurements=measurements, deviations=spread) for _ in range(2)]
    assert filters[0]._engine._filters is not None
    engine = FilterEngine(process, list(filters[1]._measured.prepared.values()))
    engine._filters, filters[1]._engine = None, engine
    inputs = {"imu": (times[:-1], np.array(readings))}
    found, arrays = (one.run(seen, dt=h, inputs=inputs, covariances=True, save_every=20) for one in filters)
    assert np.allclose(found.rows, arrays.rows, atol=1e-9)
    assert np.allclose(found.covariances, arrays.covariances, rtol=1e-7, atol=1e-12)
    off = found.rows[-1, 22:28] - bias
    assert np.all(np.abs(off) < 4 * found.deviations[-1, 9:15]) and np.all(found.deviations[-1, 9:15] < 0.01)
    e = process.errors(found.rows[-1], truth[-1])
    assert np.all(np.abs(e[:9]) < 4 * found.deviations[-1, :9])


WRONG = {
    "error": (lambda: StrapdownProcess(error="middle"), '"left" or "right"'),
    "noise": (lambda: StrapdownProcess(noise={"gyro": 1.0}), "no part `gyro`: did you mean `gyroscope`"),
    "shape of noise": (lambda: StrapdownProcess(noise={"gyroscope": [1.0, 2.0]}), r"one number or have shape \(3,\)"),
    "drifting": (lambda: StrapdownProcess(drifting={"scale": RandomWalk()}), "no part `scale`"),
    "position": (lambda: StrapdownProcess(position=(1.0, 2.0)), r"`position`.*have shape \(3,\)"),
    "state": (lambda: unit().row(3.0), "must be an InertialState"),
    "rotation": (lambda: unit().row(InertialState(rotation=2 * np.eye(3))), "must be a rotation"),
    "current": (lambda: StrapdownProcess().row(InertialState(current=(1, 0, 0))), "has no `current`"),
    "of state": (
        lambda: evaluate(unit().reading(lambda s, p: s.q, of_state=True), unit().example),
        "no state of a system",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_use_of_an_inertial_unit_is_told(case):
    call, sentence = WRONG[case]
    with pytest.raises(co.errors.ArgumentError, match=sentence):
        call()
