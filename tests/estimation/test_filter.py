"""A filter on the group: Kalman's own where all is linear, the exact tangent of a step elsewhere."""

from __future__ import annotations

from functools import cache
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

import coadjoint as co
from coadjoint.estimation import Filter, GaussMarkov, Measurement, ModelProcess, RandomWalk
from coadjoint.estimation.engines import FilterEngine
from coadjoint.estimation.prepared import prepared
from coadjoint.kernels.trace.evaluate import evaluate

H = 0.1


@cache
def oscillator(density):
    """ν̇ = −4 q − 0.3 ν + push + bias, with a bias that walks: a mass on a spring, beside a group."""
    system = co.System(
        co.Translation(1),
        lambda xi, n, nu, p: 0.5 * xi @ xi + 0.5 * nu @ nu - 2.0 * n @ n,
        additional=co.Trivial(1),
        parameters={"bias": [0.2]},
        forces=lambda motion, p: co.Force(force=-0.3 * motion.nu + motion.inputs.push + p.bias),
    )
    start = system.state(q=[0.5], qdot=[0.1], inputs={"push": np.zeros(1)})
    drifting = {"bias": RandomWalk(density)}
    return ModelProcess(system, start, inputs={"push": [0.0]}, noise={"force": 0.4}, drifting=drifting), start


@cache
def body(error):
    """A buoyant body with drag in a current, all of whose errors are coupled."""

    def lagrangian(xi, n, nu, a, p):
        through = nu - p.current[0] * a.north
        return 0.5 * through @ (p.mass * through) + 0.5 * xi @ (p.inertia * xi) + xi[0] * through[1] + 0.3 * n @ a.down

    def drag(motion, p):
        nu, xi = motion.nu - p.current[0] * motion.a.north, motion.xi
        return co.Force(torque=-0.3 * xi + 0.1 * jnp.cross(nu, xi), force=-0.2 * jnp.sqrt(1 + nu @ nu) * nu)

    system = co.System(
        co.SO3(),
        lagrangian,
        additional=co.Defining(),
        advected={"down": co.Defining(), "north": co.Defining()},
        parameters={"mass": [2.0, 3.0, 4.0], "inertia": [1.0, 2.0, 2.5], "current": [0.2]},
        forces=drag,
    )
    start = system.state(
        g=co.attitude.zyx(0.4, -0.2, 0.7), q=[1, 2, 3], xi=[0.2, -0.4, 0.3], qdot=[1, 0.2, -0.1],
        a0={"down": [0, 0, 1], "north": [1, 0, 0]},
    )  # fmt: skip
    noise = {"torque": [0.1, 0.2, 0.3], "force": 0.2}
    drifting = {"current": GaussMarkov(0.3, 50.0)}
    return ModelProcess(system, start, error=error, noise=noise, drifting=drifting), start


def test_a_linear_system_has_the_filter_of_kalman():
    process, start = oscillator(0.05)
    measurements = {"place": Measurement(lambda m: m.q, 0.04), "speed": Measurement(lambda m: 2 * m.nu + m.q, [0.01])}
    spread = {"q": 0.3, "nu": 0.2, "bias": 0.5}
    random, times = np.random.default_rng(7), H * np.arange(1, 101)
    seen = {"place": (times[::2], random.normal(size=50)), "speed": (times[::3], random.normal(size=34))}
    push = np.sin(times)
    filter = Filter(process, start, measurements=measurements, deviations=spread)
    found = filter.run(seen, dt=H, inputs={"push": (times - H, push)}, covariances=True)
    A = np.array([[0.0, 1.0, 0.0], [-4.0, -0.3, 1.0], [0.0, 0.0, 0.0]])
    left, right = np.eye(3) - 0.5 * H * A, np.eye(3) + 0.5 * H * A
    step, end = np.linalg.solve(left, right), np.eye(3)[1]
    begun = step[:, 1]
    mixed = 0.5 * (np.outer(begun, end) + np.outer(end, begun))
    Q = 0.4**2 * H / 3 * (np.outer(begun, begun) + mixed + np.outer(end, end))
    drift = np.diag([0.0, 0.0, 0.5 * 0.05**2 * H])
    Q = Q + step @ drift @ step.T + drift
    x, P = np.array([0.5, 0.1, 0.2]), np.diag([0.3, 0.2, 0.5]) ** 2
    rows = {"place": (np.array([[1.0, 0, 0]]), 0.04), "speed": (np.array([[1.0, 2, 0]]), 0.01)}
    for k, t in enumerate(times):
        x = step @ x + np.linalg.solve(left, H * np.array([0.0, push[k], 0.0]))
        P = step @ P @ step.T + Q
        for name, (C, R) in rows.items():
            for j in np.flatnonzero(np.abs(seen[name][0] - t) < 1e-9):
                S = C @ P @ C.T + R
                K = P @ C.T @ np.linalg.inv(S)
                x, P = x + K @ (seen[name][1][j] - C @ x), (np.eye(3) - K @ C) @ P
        chosen = [process.names.index(name) for name in ("q", "pi", "bias")]
        assert np.allclose(found.covariances[k + 1][np.ix_(chosen, chosen)], P, rtol=1e-12, atol=1e-14)
        theirs = found.states.n[k + 1], found.states.pi[k + 1], found.rows[k + 1, -1:]
        assert np.allclose(np.concatenate(theirs), x, rtol=0, atol=1e-12)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("error", ["left", "right"])
def test_the_tangent_of_a_step_is_that_of_differences(error):
    process, start = body(error)
    row = process.row(start)[None]
    after = process.advanced(row, H)
    Phi, _ = process.linearised(row, after, H)
    e = 1e-5
    for j, column in enumerate(Phi[0].T):
        ends = [process.advanced(process.moved(row, s * e * np.eye(process.width)[j : j + 1]), H) for s in (1, -1)]
        plus, minus = (evaluate(process.differ, after[0], end[0]) for end in ends)
        assert np.allclose((plus - minus) / (2 * e), column, atol=3e-9)


@pytest.mark.long
def test_left_and_right_errors_have_the_same_covariances_in_other_axes():
    found = {}
    spread = {"g": 0.1, "q": 0.5, "xi": 0.05, "nu": 0.1, "current": 0.3}
    P: dict[str, Any] = {"deviations": spread}
    for error in ("left", "right"):
        process, start = body(error)
        filter = Filter(process, start, measurements={}, **P)
        T = _changed(start)
        P = {"covariance": T @ filter.covariance @ T.T}
        for _ in range(5):
            filter.predict(H)
        found[error] = filter.covariance, filter.state
    T = _changed(found["left"][1])
    assert np.allclose(found["right"][0], T @ found["left"][0] @ T.T, rtol=1e-9, atol=1e-12)


def _changed(state):
    """∂(right error)/∂(left error)."""
    R, q = np.asarray(state.g), np.asarray(state.q)
    T = np.zeros((13, 13))
    x, y, z = q
    for i in range(0, 12, 3):
        T[i : i + 3, i : i + 3] = R
    T[3:6, :3] = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ R
    T[12, 12] = 1
    return T


def test_machine_code_does_what_arrays_do():
    process, start = body("right")
    measurements = {
        "place": Measurement(lambda m: m.q, 0.1, gate=0.5),
        "through": Measurement(lambda m, p: m.nu - p.current[0] * m.a.north, np.diag([0.1, 0.2, 0.3])),
    }
    spread = {"g": 0.1, "q": 0.5, "xi": 0.05, "nu": 0.1, "current": 0.3}
    filter = Filter(process, start, measurements=measurements, deviations=spread, members=3)
    random, times = np.random.default_rng(3), H * np.arange(1, 21)
    place = np.array([1.0, 2, 3]) + times[:, None, None] * [1, 0.2, -0.1] + 0.3 * random.normal(size=(20, 3, 3))
    place[4, 1] = np.nan
    seen = {"place": (times, place), "through": (times[::4], random.normal(size=(5, 3)))}
    first = filter.rows.copy(), filter.P.copy()
    native = filter.run(seen, dt=H, covariances=True)
    engine = FilterEngine(process, list(filter._measured.prepared.values()))
    engine._filters = None
    filter.rows, filter.P, filter._engine = *first, engine
    arrays = filter.run(seen, dt=H, covariances=True)
    used = native.nis["place"].used
    assert 0 < np.count_nonzero(~used) < used.size and not used[4, 1] and np.isnan(native.nis["place"].nis[4, 1])
    assert np.array_equal(used, arrays.nis["place"].used)
    assert np.allclose(native.rows, arrays.rows, atol=1e-10)
    assert np.allclose(native.covariances, arrays.covariances, rtol=1e-9, atol=1e-12)
    assert np.array_equal(native.covariances, native.covariances.swapaxes(-1, -2))
    assert np.all(np.linalg.eigvalsh(native.covariances) > -1e-15)


def test_one_call_at_a_time_is_the_run_of_a_log():
    process, start = oscillator(0.05)
    measurements, spread = {"place": Measurement(lambda m: m.q, 0.04)}, {"q": 0.3, "nu": 0.2}
    filters = [Filter(process, start, measurements=measurements, deviations=spread) for _ in range(2)]
    found = filters[0].run({"place": ([0.1, 0.25], [0.3, 0.4])}, dt=H, inputs={"push": ([0.1], [2.0])})
    filters[1].predict(0.1)
    filters[1].update({"place": 0.3})
    filters[1].predict(0.1, {"push": 2.0})
    filters[1].predict(0.05)
    told = filters[1].update({"place": 0.4})["place"]
    assert np.allclose(found.t, [0, 0.1, 0.2, 0.25]) and filters[1].t == pytest.approx(0.25)
    assert np.allclose(found.rows[-1], filters[1].rows[0], atol=1e-14) and told.used
    assert told.nis == pytest.approx(found.nis["place"].nis[1], rel=1e-9)


def test_a_parameter_that_nothing_drives_is_found():
    """A constant push of 0.2 is estimated from places alone, to its own deviation."""
    process, start = oscillator(0.05)
    truth = [process.row(start)[None]]
    for _ in range(200):
        truth.append(process.advanced(truth[-1], H))
    places = process.state(np.concatenate(truth)).n[1:, 0]
    seen = places + 0.01 * np.random.default_rng(5).normal(size=200)
    row = process.row(start)
    row[-1] = -0.4
    filter = Filter(
        process,
        row,
        measurements={"place": Measurement(lambda m: m.q, 1e-4)},
        deviations={"q": 0.1, "nu": 0.1, "bias": 1.0},
    )
    found = filter.run({"place": (H * np.arange(1, 201), seen)}, dt=H)
    assert abs(found.rows[-1, -1] - 0.2) < 3 * found.deviations[-1, -1] < 0.9


@pytest.mark.parametrize("error", ["left", "right"])
@pytest.mark.parametrize("angle", [1e-9, 1.0, 3.0, np.pi - 1e-6])
def test_errors_are_those_of_retract_however_large_they_are(error, angle):
    process, start = body(error)
    random, row = np.random.default_rng(2), process.row(start)[None]
    e = random.normal(size=(1, process.width))
    e[0, :3] *= angle / np.linalg.norm(e[0, :3])
    assert np.allclose(process.errors(row, process.moved(row, e)), e, atol=1e-7 if angle > 3.1 else 1e-12)


def test_half_a_turn_is_not_consistent_with_small_deviations():
    process, start = body("left")
    filter = Filter(process, start, measurements={}, covariance=0.01 * np.eye(process.width))
    found = filter.run({}, dt=H, until=H, covariances=True)
    half = process.moved(found.rows, np.pi * np.eye(process.width)[[2, 2]])
    assert found.nees(half)[0][0] == pytest.approx((np.pi / 0.1) ** 2, rel=1e-9)
    known = Filter(process, start, measurements={}, deviations={"g": 0.1}).run({}, dt=H, until=H, covariances=True)
    with pytest.raises(co.errors.ArgumentError, match="known exactly"):
        known.nees(known.rows)


@pytest.mark.long
def test_a_bias_that_only_a_sensor_reads_is_found_and_does_not_act_on_the_motion():
    plain, start = body("left")
    system, walk = plain._system, RandomWalk([1e-5, 1e-5, 1e-5])
    process = ModelProcess(
        system,
        start,
        noise={"torque": 0.01, "force": 0.01},
        drifting={"current": GaussMarkov(0.3, 50.0)},
        biases={"gyroscope": walk},
    )
    bias, random = np.array([0.03, -0.02, 0.01]), np.random.default_rng(8)
    row = np.concatenate([process.row(start)[:-3], bias])[None]
    truth = [row]
    for _ in range(200):
        truth.append(process.advanced(truth[-1], H))
    other = plain.row(start)[None]
    for _ in range(200):
        other = plain.advanced(other, H)
    assert np.array_equal(truth[-1][:, :-3], other)
    rows = np.concatenate(truth)[1:]
    measurements = {
        "gyro": Measurement(lambda m, p, biases: m.xi + biases.gyroscope, 1e-6),
        "attitude": Measurement(lambda m: jnp.concatenate([m.a.down, m.a.north]), 1e-6),
    }
    spread = {"g": 0.01, "xi": 0.01, "nu": 0.01, "gyroscope": 0.05}
    filter = Filter(process, start, measurements=measurements, deviations=spread)
    seen = {}
    for name, exact in filter.expected(rows).items():
        seen[name] = H * np.arange(1, 201), exact + 1e-3 * random.normal(size=exact.shape)
    found = filter.run(seen, dt=H)
    assert np.all(np.abs(found.rows[-1, -3:] - bias) < 4 * found.deviations[-1, -3:])
    assert np.all(found.deviations[-1, -3:] < 1e-3) and process.names[-1] == "gyroscope[2]"


def test_a_parameter_returns_to_the_mean_of_its_drift():
    process, start = oscillator(0.05)
    drifting = {"bias": GaussMarkov(0.01, 2.0, mean=0.21)}
    one = ModelProcess(process._system, start, drifting=drifting)
    filter = Filter(one, start, measurements={}, deviations={})
    for _ in range(3):
        filter.predict(H)
    assert filter.rows[0, -1] == pytest.approx(0.21 - 0.01 * np.exp(-0.15), abs=1e-15)
    assert one.advanced(one.row(start)[None], 0.3)[0, -1] == pytest.approx(0.21 - 0.01 * np.exp(-0.15), abs=1e-15)


def test_arguments_with_defaults_are_no_parameters():
    process, start = oscillator(0.05)
    places = {f"q{i}": Measurement(lambda motion, i=i: motion.q[i], 0.1) for i in range(1)}
    filter = Filter(process, start, measurements=places, deviations={"q": 1.0})
    assert filter.update({"q0": 0.5})["q0"].nis == pytest.approx(0.0)


@pytest.mark.long
@pytest.mark.cases(1)
@pytest.mark.parametrize("error", ["left", "right"])
def test_velocities_of_a_state_are_those_of_its_momenta_after_a_measurement_too(error):
    process, start = body(error)
    known = {"speed": Measurement(lambda m: jnp.concatenate([m.xi, m.nu]), 1e-12)}
    filter = Filter(process, start, measurements=known, deviations={"g": 0.1, "xi": 1.0, "nu": 1.0})
    read = np.array([0.3, 0.1, -0.2, 0.9, -0.3, 0.4])
    filter.update({"speed": read})
    assert np.allclose([*filter.state.xi, *filter.state.nu], read, atol=1e-6)
    found = filter.run({"speed": ([0.1, 0.2], [read, read])}, dt=H)
    assert np.allclose(np.hstack([found.states.xi, found.states.nu]), read, atol=1e-3)
    assert np.allclose(filter.expected(found.rows)["speed"], np.hstack([found.states.xi, found.states.nu]), atol=1e-12)
    given = np.zeros((1, process.width)), np.concatenate([filter.rows, read[None, 3:]], axis=1)
    both = Measurement(lambda state: state.nu, 1.0, of_state=True), Measurement(lambda m: m.nu, 1.0)
    (seen, slopes), (motion, same) = (prepared(process, "nu", one).function(*given) for one in both)
    assert np.allclose(seen, motion, atol=1e-14) and np.allclose(slopes, same, atol=1e-12) and np.any(slopes)


def test_rows_with_velocities_have_their_momenta():
    process, start = body("left")
    rows = np.repeat(process.row(start)[None], 3, axis=0)
    xi, nu = np.random.default_rng(3).normal(size=(2, 3, 3))
    states = process.state(process.with_velocities(rows, xi, nu))
    assert np.allclose(states.xi, xi, atol=1e-12) and np.allclose(states.nu, nu, atol=1e-12)
    assert np.array_equal(states.q, process.state(rows).q)
    through = nu - 0.2 * states.a[:, 3:]
    assert np.allclose(states.pi, through * [2.0, 3.0, 4.0] + np.outer(xi[:, 0], [0.0, 1.0, 0.0]), atol=1e-12)


def test_steps_that_are_drawn_have_the_covariance_of_the_filter():
    """Of 4000 members the sample lies in the intervals of a Wishart matrix about Q, also of what drifts."""
    process, start = body("left")
    rows, members = process.row(start)[None], 4000
    after = process.advanced(rows, H)
    _, Q = process.linearised(rows, after, H)
    drawn = process.drawn(np.repeat(rows, members, axis=0), H, np.random.default_rng(5))
    e = process.errors(np.repeat(after, members, axis=0), drawn)
    off = e.T @ e / members - Q[0]
    spread = np.sqrt((np.outer(np.diag(Q[0]), np.diag(Q[0])) + Q[0] ** 2) / members)
    assert np.all(np.abs(off) <= 5 * spread + 1e-15) and np.all(np.diag(Q[0])[6:] > 0)
    assert np.all(np.abs(e.mean(axis=0)) <= 5 * np.sqrt(np.diag(Q[0]) / members) + 1e-15)


@pytest.mark.cases(1)
@pytest.mark.parametrize("rows", [np.zeros(3), "state", np.zeros((2, 4), int)])
def test_rows_of_another_size_are_refused(rows):
    process, start = body("left")
    filter = Filter(process, start, measurements={"place": Measurement(lambda m: m.q, 1.0)}, deviations={"q": 1.0})
    with pytest.raises(co.errors.ArgumentError, match=r"must be rows \(…, \d+\) of the process"):
        filter.expected(rows)


def test_a_value_that_is_too_large_for_numbers_is_told_and_leaves_the_filter_as_it_was():
    process, start = body("left")
    known = {"place": Measurement(lambda m: m.q, 1.0), "gated": Measurement(lambda m: m.q, 1.0, gate=0.999)}
    filter = Filter(process, start, measurements=known, deviations={"g": 0.1, "q": 1.0, "xi": 0.1, "nu": 0.1})
    filter.predict(H)
    rows = filter.rows.copy()
    for take in (filter.update, lambda seen: filter.run({"place": ([0.2], [seen["place"]])}, dt=H)):
        with pytest.raises(
            co.errors.StepError, match=r"does not stay finite.*: a measurement is too far|no finite NIS"
        ):
            take({"place": [1e200, 1e200, 1e200]})
        assert np.array_equal(filter.rows, rows)
    assert not filter.update({"gated": [1e200, 1e200, 1e200]})["gated"].used
