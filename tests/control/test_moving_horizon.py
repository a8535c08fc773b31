"""Estimation on a moving horizon: Kalman's filter and smoother where all is linear, and the whole log's elsewhere."""

from __future__ import annotations

import math

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.stats import chi2

import coadjoint as co
import paper_vehicle
from coadjoint.control import Bounds, End, Input, Measured, Problem, Profile

H, STEPS, SIGMA, OF_PUSH, OF_V = 0.1, 40, 0.05, 0.4, 0.8


def cart():
    return co.System(
        co.Translation(1), lambda xi, p: 0.5 * p.mass * xi @ xi, parameters={"mass": 2.0},
        forces=lambda motion, p: co.Force(torque=motion.inputs.push + motion.inputs.thrust - 0.3 * motion.xi
                                          - 0.8 * motion.t),
    )  # fmt: skip


def of_cart(**more):
    system = cart()
    given = {
        "inputs": {"push": Input((1,)), "thrust": Input((1,))},
        "cost": lambda motion, p: 0.5 * (motion.inputs.push[0] / OF_PUSH) ** 2,
        "free_start": {"g": 0.5, "xi": OF_V},
        "measured": {"place": Measured(lambda motion, p: motion.g, None, SIGMA),
                     "speed": Measured(lambda motion, p: motion.xi, None, 0.1)},
    }  # fmt: skip
    return Problem(system, system.state(g=[0.3], xi=[0.2]), dt=H, steps=5, **(given | more))


def log():
    generator = np.random.default_rng(3)
    thrust = np.sin(0.3 * np.arange(STEPS))
    place = np.cumsum(0.05 * generator.standard_normal(STEPS + 1)) + 0.1 * np.arange(STEPS + 1)
    speed = np.where(np.arange(STEPS + 1) % 3 == 1, 0.1 * generator.standard_normal(STEPS + 1) + 0.5, np.nan)
    return thrust, place, speed


def kalman(prior=(0.5, OF_V)):
    """The filter's means and covariances of (x, 2v), and the smoother's means, of the midpoint rule, written here."""
    thrust, place, speed = log()
    gain, push = (2.0 - 0.15 * H) / (2.0 + 0.15 * H), H / (2.0 + 0.15 * H)
    A = np.array([[1.0, 0.25 * H * (1 + gain)], [0.0, gain]])
    B = np.array([0.5 * H * push, 2 * push])
    Q = np.outer(B, B) * OF_PUSH**2 / H
    mean, P = np.array([0.3, 0.4]), np.diag([prior[0] ** 2, 4 * prior[1] ** 2])
    means, spreads, ahead = [], [], []
    for k in range(STEPS + 1):
        for C, y, s in (([1.0, 0.0], place[k], SIGMA), ([0.0, 0.5], speed[k], 0.1)):
            if np.isfinite(y):
                C = np.array(C)
                K = P @ C / (C @ P @ C + s**2)
                mean, P = mean + K * (y - C @ mean), P - np.outer(K, C @ P)
        means.append(mean), spreads.append(P)
        if k < STEPS:
            mean, P = A @ mean + B * (thrust[k] - 0.8 * (k + 0.5) * H), A @ P @ A.T + Q
            ahead.append((mean, P))
    smooth = [means[-1]]
    for k in reversed(range(STEPS)):
        back = spreads[k] @ A.T @ np.linalg.inv(ahead[k][1])
        smooth.append(means[k] + back @ (smooth[-1] - ahead[k][0]))
    return np.array(means), np.array(spreads), np.array(smooth[::-1])


@pytest.mark.cases(1)
@pytest.mark.parametrize("horizon", [1, 5])
def test_a_linear_motion_has_the_means_and_covariances_of_a_kalman_filter_and_its_smoother(horizon):
    estimator = of_cart().estimator(horizon * H, known="thrust")
    thrust, place, speed = log()
    means, spreads, smooth = kalman()
    at = [estimator.names.index(name) for name in ("g[0]", "mu[0]")]
    to = [estimator.directions.index(name) for name in ("g[0]", "mu[0]")]
    for k in range(STEPS + 1):
        inputs = {"thrust": thrust[k - 1 : k]} if k else {}
        estimate = estimator({"place": place[k : k + 1], "speed": speed[k : k + 1]}, inputs)
        np.testing.assert_allclose(estimate.nodes[-1, at], means[k], atol=1e-9)
        np.testing.assert_allclose(estimate.covariance[np.ix_(to, to)], spreads[k], rtol=1e-8, atol=1e-12)
    assert estimate.t == pytest.approx(H * STEPS) and float(estimate.state.t) == pytest.approx(H * STEPS)
    np.testing.assert_allclose(estimate.nodes[:, at], smooth[-1 - horizon :], atol=1e-8)
    np.testing.assert_allclose(2 * estimate.state.xi, means[-1, 1:], atol=1e-9)
    assert len(estimate.inputs["push"]) == horizon


def test_of_a_start_that_nobody_knows_the_measurements_tell_what_they_can():
    """Of one place the speed stays unknown; later the motion is that of a filter with a wide prior."""
    estimator = of_cart(free_start={"g": math.inf, "xi": math.inf}).estimator(known=("thrust",))
    thrust, place, speed = log()
    first = estimator({"place": place[0], "speed": np.nan})
    assert first.deviations["g[0]"] == pytest.approx(SIGMA) and first.deviations["mu[0]"] == math.inf
    assert first.deviations["t"] == 0.0
    second = estimator({"place": place[1]}, {"thrust": thrust[0]})
    assert 0 < second.deviations["mu[0]"] < math.inf
    estimator.reset()
    for k in range(STEPS + 1):
        inputs = {"thrust": thrust[k - 1]} if k else {}
        estimate = estimator({"place": place[k], "speed": speed[k]}, inputs)
    means, spreads, _ = kalman((1e5, 1e5))
    at = [estimator.names.index(name) for name in ("g[0]", "mu[0]")]
    np.testing.assert_allclose(estimate.nodes[-1, at], means[-1], atol=1e-7)
    assert estimate.deviations["mu[0]"] == pytest.approx(np.sqrt(spreads[-1][1, 1]), rel=1e-6)


def tumbling(steps, seed=11, prior=0.2):
    """A body under torques that nobody knows, the directions to two stars and its rates as sensors see them."""
    generator = np.random.default_rng(seed)
    system = co.System(
        co.SO3(), lambda xi, p: 0.5 * xi @ (p.J * xi), parameters={"J": np.array([1.0, 2.0, 3.0])},
        forces=lambda motion, p: co.Force(torque=motion.inputs.w),
    )  # fmt: skip
    stars = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, 0.8]])
    w = 0.3 / np.sqrt(H) * generator.standard_normal((steps, 3))
    run = co.simulate(
        system, system.state(xi=[0.5, -0.2, 0.8]), dt=H, steps=steps, inputs={"w": co.Held(H * np.arange(steps), w)}
    )
    seen = np.einsum("kji,sj->ksi", np.asarray(run.records.g), stars).reshape(steps + 1, 6)
    seen += 0.02 * generator.standard_normal(seen.shape)
    rates = np.asarray(run.records.mu) / [1.0, 2.0, 3.0] + 0.05 * generator.standard_normal((steps + 1, 3))
    start = system.state(g=co.attitude.zyx(*(0.5 * prior * generator.standard_normal(3))), xi=[0.4, 0.0, 0.6])
    problem = Problem(
        system, start, dt=H, steps=steps, inputs={"w": Input((3,))},
        cost=lambda motion, p: 0.5 * motion.inputs.w @ motion.inputs.w / 0.3**2,
        free_start={"g": prior, "xi": 0.5},
        measured={"stars": Measured(lambda motion, p: jnp.ravel(stars @ motion.g), seen, 0.02),
                  "rates": Measured(lambda motion, p: motion.xi, rates, 0.05)},
    )  # fmt: skip
    return problem, run, seen, rates


@pytest.mark.long
def test_a_horizon_over_the_whole_log_has_the_motion_that_the_solver_finds():
    """The prior is that of ξ in ḡ exp(ξ) to first order, and so weak here that the difference does not count."""
    problem, _, seen, rates = tumbling(12, prior=1e4)
    estimator = problem.estimator(iterations=12)
    for k in range(13):
        estimate = estimator({"stars": seen[k], "rates": rates[k]})
    found = problem.solve(guess="simulate", tolerance=1e-11)
    np.testing.assert_allclose(estimate.state.g, found.run.final.g, atol=1e-7)
    np.testing.assert_allclose(estimate.inputs["w"], found.inputs["w"], atol=1e-6)
    assert estimate.iterations < 12
    assert np.max(np.abs(estimate.state.g.T @ estimate.state.g - np.eye(3))) < 1e-13


@pytest.mark.long
def test_the_last_attitude_of_a_moving_horizon_is_nearly_that_of_the_whole_log_and_its_errors_are_as_told():
    """Errors over their covariance, of two logs at every fifth node, are those of χ²."""
    squares = []
    for seed in range(2):
        problem, run, seen, rates = tumbling(40, seed)
        estimator = problem.estimator(0.6)
        for k in range(41):
            estimate = estimator({"stars": seen[k], "rates": rates[k]})
            if k % 5 == 4:
                F = estimate.state.g.T @ np.asarray(run.records.g)[k]
                error = 0.5 * np.array([F[2, 1] - F[1, 2], F[0, 2] - F[2, 0], F[1, 0] - F[0, 1]])
                squares.append(error @ np.linalg.solve(estimate.covariance[:3, :3], error))
    low, high = chi2.ppf([0.001, 0.999], 3 * len(squares)) / len(squares)
    assert low < np.mean(squares) < high
    found = problem.solve(guess="simulate")
    F = estimate.state.g.T @ np.asarray(found.run.final.g)
    assert np.max(np.abs(F - np.eye(3))) < 0.05 * estimate.deviations["eta[0]"]


@pytest.mark.cases(1)
@pytest.mark.parametrize("what", ["input", "path"])
def test_bounds_hold_in_the_horizon_as_in_the_solver(what):
    thrust, place, speed = log()

    def last(**more):
        estimator = of_cart(**more).estimator(known="thrust")
        for k in range(6):
            found = estimator({"place": place[k], "speed": speed[k]}, {"thrust": thrust[k - 1]} if k else {})
        return found, estimator.names.index("g[0]")

    loose, g = last()
    most = np.max(loose.nodes[:, g]) - 0.02
    inputs = {"push": Input((1,), -0.1, 0.2) if what == "input" else Input((1,))}
    path = {"path": {"behind": Bounds(lambda motion, p: motion.g, upper=most)}} if what == "path" else {}
    estimate, _ = last(inputs={**inputs, "thrust": Input((1,))}, **path)
    found = of_cart(
        inputs={**inputs, "thrust": co.Held(H * np.arange(5), thrust[:5, None])}, **path,
        measured={"place": Measured(lambda motion, p: motion.g, place[:6, None], SIGMA),
                  "speed": Measured(lambda motion, p: motion.xi, speed[:6, None], 0.1)},
    ).solve(tolerance=1e-11)  # fmt: skip
    np.testing.assert_allclose(estimate.inputs["push"], found.inputs["push"], atol=1e-6)
    assert np.max(np.abs(loose.inputs["push"] - estimate.inputs["push"])) > 1e-3
    if what == "path":
        assert np.max(estimate.nodes[:, g]) <= most + 1e-9


@pytest.mark.long
def test_a_vehicle_with_a_place_and_a_direction_of_gravity_is_estimated_on_its_group():
    """The vehicle of the paper, its place, depth and direction of gravity seen: what the solver finds of the same."""
    generator = np.random.default_rng(2)
    vehicle = paper_vehicle.system(
        forces=lambda motion, p: co.Force(torque=motion.inputs.torque, force=motion.inputs.force - 20.0 * motion.nu)
    )
    truth = co.simulate(
        vehicle, vehicle.state(g=co.attitude.zyx(0.2, 0.1, -0.3), q=[0, 0, 1], xi=[0.2, 0.1, -0.1], a0=[0, 0, 1]),
        dt=H, steps=6, inputs={"torque": np.zeros(3), "force": np.array([5.0, 0.0, 2.0])},
    )  # fmt: skip
    seen = {
        "place": np.asarray(truth.records.q),
        "down": np.asarray(truth.records.a),
        "ahead": np.asarray(truth.records.g)[:, :, 0],
    }
    seen = {name: rows + 0.01 * generator.standard_normal(rows.shape) for name, rows in seen.items()}
    functions = {"place": lambda m, p: m.q, "down": lambda m, p: m.a, "ahead": lambda m, p: m.g[:, 0]}
    problem = Problem(
        vehicle, vehicle.state(g=co.attitude.zyx(0.25, 0.05, -0.2), q=[0.1, 0, 1], a0=[0, 0, 1]), dt=H, steps=6,
        inputs={"torque": Input((3,)), "force": Input((3,))},
        cost=lambda motion, p: motion.inputs.torque @ motion.inputs.torque
        + 0.01 * motion.inputs.force @ motion.inputs.force,
        free_start={"g": 1e3, "q": 1e3, "xi": 1e3, "qdot": 1e3},
        measured={name: Measured(function, seen[name], 0.01) for name, function in functions.items()},
    )  # fmt: skip
    estimator = problem.estimator(iterations=15)
    for k in range(7):
        estimate = estimator({name: rows[k] for name, rows in seen.items()})
    found = problem.solve(guess="simulate", tolerance=1e-11)
    for part in ("g", "q", "mu", "pi", "a", "xi", "nu"):
        np.testing.assert_allclose(getattr(estimate.state, part), getattr(at_the_end(found.run), part), atol=2e-6)
    assert len(estimator.directions) == 3 + 3 + 3 + 3 + 1 and len(estimator.names) == 9 + 3 * 4 + 1
    again = co.simulate(vehicle, estimate.state, dt=H, steps=1, inputs={"torque": np.zeros(3), "force": np.zeros(3)})
    np.testing.assert_allclose(again.start.mu, estimate.state.mu, atol=1e-13)


def at_the_end(run):
    """The last state, with the velocities of its momenta."""
    final = run.final
    q = final.q
    return run.system.state(g=final.g, q=q, mu=final.mu, pi=final.pi, a0=np.asarray(final.g) @ np.asarray(final.a))


@pytest.mark.cases(1)
@pytest.mark.parametrize("drag", [0.0, 1.0])
def test_the_estimate_stays_along_what_is_never_measured_and_its_deviation_is_infinite(drag):
    def resisted(m):
        return co.Force(torque=m.inputs.w - drag * m.xi * jnp.sqrt(m.xi @ m.xi + 1e-6))

    system = co.System(co.Translation(2), lambda xi: 0.5 * xi @ xi, forces=resisted)
    estimator = Problem(
        system, system.state(g=[0.0, 0.5], xi=[1.0, 0.0]), dt=H, steps=5, inputs={"w": Input((2,))},
        cost=lambda m: 0.5 * m.inputs.w @ m.inputs.w, free_start={"g": math.inf, "xi": math.inf},
        measured={"x": Measured(lambda m: m.g[0], None, 0.01)},
    ).estimator()  # fmt: skip
    generator = np.random.default_rng(0)
    for k in range(40):
        place = math.log(1 + 0.1 * k) + 0.01 * generator.normal()
        now = estimator({"x": place})
        assert now.deviations["g[1]"] == now.deviations["mu[1]"] == math.inf
        assert abs(now.state.g[1] - 0.5) < 1e-9 and abs(now.state.mu[1]) < 1e-9
        assert abs(now.state.g[0] - place) < 0.06 and (k < 1 or now.deviations["mu[0]"] < 0.4)
    assert now.deviations["mu[0]"] == pytest.approx(0.21, abs=0.01)


@pytest.mark.cases(1)
@pytest.mark.parametrize("iterations", [1, 10])
def test_of_a_body_one_of_whose_axes_is_measured_the_turn_about_it_stays_unknown(iterations):
    body = co.System(
        co.SO3(), lambda xi: 0.5 * xi @ (jnp.array([1.0, 2, 3]) * xi), forces=lambda m: co.Force(torque=m.inputs.w)
    )
    estimator = Problem(
        body, body.state(), dt=H, steps=5, inputs={"w": Input((3,))}, cost=lambda m: 0.5 * m.inputs.w @ m.inputs.w,
        free_start={"g": math.inf, "xi": math.inf}, measured={"axis": Measured(lambda m: m.g[:, 0], None, 0.01)},
    ).estimator(iterations=iterations)  # fmt: skip
    seen = np.array([math.cos(0.1), 0.0, -math.sin(0.1)])
    for _ in range(12):
        now = estimator({"axis": seen})
        assert now.deviations["eta[0]"] == now.deviations["mu[0]"] == math.inf
        assert abs(now.state.mu[0]) < 1e-9
    assert np.max(np.abs(now.state.g[:, 0] - seen)) < 1e-6
    assert [now.deviations[name] < 0.4 for name in ("eta[1]", "eta[2]", "mu[1]", "mu[2]")] == [True] * 4


@pytest.mark.cases(14)
@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda: of_cart(measured={}).estimator(), "needs measurements"),
        (lambda: of_cart(parameters={"mass": (1.0, 3.0)}).estimator(), "leave out `parameters`"),
        (lambda: of_cart(end=End(g=[1.0])).estimator(), "no end to reach"),
        (lambda: of_cart(final_cost=lambda motion, p: motion.g[0]).estimator(), "no end to reach"),
        (lambda: of_cart(cost=None).estimator(known="thrust"), "any motion is as likely"),
        (lambda: pushed(Input((1,), course="linear")).estimator(), "`push` is none"),
        (lambda: pushed(Profile(lambda t, theta: theta, [0.0])).estimator(), "`push` is none"),
        (lambda: pushed(Input((1,), rate=1.0)).estimator(), "bounds no rates"),
        (lambda: of_cart().estimator(known=("trust",)), "no co.control.Input `trust`: did you mean"),
        (lambda: of_cart().estimator(known=3), "must be names"),
        (lambda: of_cart().estimator(0.03), "whole number of steps"),
        (lambda: of_cart().estimator(0.0), "at least one"),
        (lambda: of_cart().estimator(iterations=0), "whole number from 1"),
        (lambda: of_cart().estimator(known="thrust")({"height": 1.0}), "measures `place`, `speed`"),
        (lambda: of_cart().estimator(known="thrust")({"place": [1.0, 2.0]}), "must be 1 finite numbers"),
        (lambda: of_cart().estimator(known="thrust")({"place": np.inf}), "must be 1 finite numbers"),
        (lambda: of_cart().estimator(known="thrust")([1.0]), "dictionary"),
        (lambda: of_cart().estimator(known="thrust")(np.array([3.0, 1.0])), "dictionary of measurements"),
        (lambda: of_cart().estimator(known="thrust")(np.zeros(1)), "dictionary of measurements"),
        (lambda: of_cart().estimator(known="thrust")({}, np.zeros(2)), "dictionary of known inputs"),
        (lambda: of_cart().estimator(), "input `thrust`.*`known`"),
        (lambda: of_cart(cost=lambda m, p: -0.5 * m.inputs.push[0] ** 2).estimator(known="thrust"), "input `push`"),
        (lambda: of_cart(cost=lambda m, p: m.g[0] ** 2).estimator(known="thrust"), "input `push`"),
        (lambda: of_cart().estimator(known="thrust")({}, {"thrust": 1.0}), "from the second call on"),
        (lambda: twice(of_cart().estimator(known="thrust")), "inputs that are known, `thrust`"),
        (lambda: twice(of_cart().estimator(known="thrust"), {"thrust": np.nan}), "must be numbers|finite numbers"),
        (lambda: of_cart().solve(), "`place` has no values"),
        (lambda: of_cart(path={"here": Bounds(lambda motion, p: motion.g, 0.0, 0.1),
                               "there": Bounds(lambda motion, p: motion.g, 1.0, 2.0)})
            .estimator(known="thrust")({}), "`there`"),
        (lambda: twice(of_cart(cost=lambda m, p: jnp.log(m.inputs.push[0])).estimator()), "is not finite about"),
    ],
)  # fmt: skip
def test_what_cannot_be_estimated_is_told_in_one_sentence(ask, words):
    with pytest.raises(co.errors.CoadjointError, match=words) as error:
        ask()
    assert "\n" not in str(error.value)


def pushed(push):
    return of_cart(inputs={"push": push, "thrust": Input((1,))})


def twice(estimator, inputs=None):
    estimator({})
    estimator({}, inputs)
