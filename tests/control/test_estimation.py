"""The most likely motion of what was measured: exact where all is linear, its deviations the curvature of the cost."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2

import coadjoint as co
from coadjoint.control import Input, Measured, Problem

SEED = 20261123
H, STEPS = 0.1, 30


def cart(**more):
    return co.System(
        co.Translation(1),
        lambda xi, p: 0.5 * p.mass * xi @ xi,
        parameters={"mass": 2.0},
        forces=lambda motion, p: co.Force(torque=motion.inputs.push - 0.3 * motion.xi),
        **more,
    )


def test_a_linear_motion_is_the_least_squares_solution_of_its_normal_equations():
    """x' = v, 2 v' = w − 0.3 v by the midpoint rule, positions at every third node: all by one matrix, written here."""
    generator = np.random.default_rng(SEED)
    nodes = np.arange(0, STEPS + 1, 3)
    y = 0.5 * H * nodes + 0.05 * generator.standard_normal(len(nodes))
    of_push, of_y, of_v = 0.4, 0.05, 0.8
    gain, push = (2.0 - 0.15 * H) / (2.0 + 0.15 * H), H / (2.0 + 0.15 * H)
    v, x = np.zeros((STEPS + 1, STEPS + 2)), np.zeros((STEPS + 1, STEPS + 2))  # of (x₀, v₀, w₀ … w_{N−1})
    x[0, 0], v[0, 1] = 1.0, 1.0
    for k in range(STEPS):
        v[k + 1] = gain * v[k]
        v[k + 1, 2 + k] += push
        x[k + 1] = x[k] + 0.5 * H * (v[k] + v[k + 1])
    rows = [x[nodes] / of_y, np.eye(STEPS + 2)[1:2] / of_v, np.sqrt(H) * np.eye(STEPS + 2)[2:] / of_push]
    matrix, right = np.concatenate(rows), np.concatenate([y / of_y, np.zeros(1 + STEPS)])
    right[len(nodes)] = 0.2 / of_v
    exact = np.linalg.lstsq(matrix, right, rcond=None)[0]
    spread = np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix)))

    system = cart()
    found = Problem(
        system,
        system.state(g=[0.3], xi=[0.2]),
        dt=H,
        steps=STEPS,
        inputs={"push": Input((1,))},
        cost=lambda motion, p: 0.5 * (motion.inputs.push[0] / of_push) ** 2,
        free_start={"g": math.inf, "xi": of_v},
        measured={"position": Measured(lambda motion, p: motion.g, y[:, None], of_y, times=H * nodes)},
    ).solve()
    start = found.run.start
    np.testing.assert_allclose([start.g[0], start.xi[0]], exact[:2], atol=1e-9)
    np.testing.assert_allclose(found.inputs["push"][:, 0], exact[2:], atol=1e-8)
    assert found.cost == pytest.approx(0.5 * np.sum((matrix @ exact - right) ** 2), rel=1e-9)
    np.testing.assert_allclose(found.residuals["position"][:, 0], x[nodes] @ exact / of_y - y / of_y, atol=1e-7)
    known = found.deviations()
    np.testing.assert_allclose([known["start g"][0], known["start xi"][0]], spread[:2], rtol=1e-8)


@cache
def log(seed):
    """A body that tumbles with drag under torques that nobody knows, its attitude and rates as sensors see them."""
    generator = np.random.default_rng(seed)
    system = co.System(
        co.SO3(),
        lambda xi, p: 0.5 * xi @ (p.inertia * xi),
        parameters={"inertia": np.array([1.0, 2.0, 3.0]), "drag": 0.25},
        forces=lambda motion, p: co.Force(torque=motion.inputs.unknown - p.drag * motion.xi),
    )
    start = system.state(g=co.attitude.zyx(0.3, -0.2, 0.1), xi=[0.5, -0.2, 0.8])
    unknown = 0.1 / np.sqrt(H) * generator.standard_normal((STEPS, 3))
    held = co.Held(H * np.arange(STEPS), unknown)
    run = co.simulate(system, start, dt=H, steps=STEPS, inputs={"unknown": held}, progress=False)
    attitudes = np.asarray(run.records.g) + 0.02 * generator.standard_normal((STEPS + 1, 3, 3))
    rates = np.asarray(run.records.mu) / [1.0, 2.0, 3.0] + 0.03 * generator.standard_normal((STEPS + 1, 3))
    attitudes[7:12] = np.nan
    return system, run, attitudes, rates


def tumbling(seed=SEED, drag=(0.0, 2.0), of_xi=math.inf, xi=None, **more):
    system, _, attitudes, rates = log(seed)
    left, _, right = np.linalg.svd(attitudes[0])
    start = system.state(g=left @ right, xi=rates[0] if xi is None else xi)
    given = {
        "inputs": {"unknown": Input((3,))},
        "cost": lambda motion, p: 0.5 * motion.inputs.unknown @ motion.inputs.unknown / 0.1**2,
        "parameters": {"drag": drag},
        "free_start": {"g": math.inf, "xi": of_xi},
        "measured": {
            "attitude": Measured(lambda motion, p: motion.g, attitudes, 0.02),
            "rates": Measured(lambda motion, p: motion.xi, rates, 0.03),
        },
    }
    return Problem(system, start, dt=H, steps=STEPS, **{**given, **more})


@pytest.mark.long
def test_start_and_parameter_lie_within_their_deviations_of_the_truth():
    """The mean square of 21 errors over their deviations, of three logs, has the band of χ²."""
    off = []
    for seed in (SEED + 1, SEED + 2, SEED + 3):
        found = tumbling(seed).solve()
        known, run = found.deviations(), log(seed)[1]
        off += [(found.parameters["drag"] - 0.25) / known["drag"]]
        off += list((found.run.start.xi - np.array([0.5, -0.2, 0.8])) / known["start xi"])
        F = np.asarray(found.run.start.g).T @ np.asarray(run.start.g)
        turned = 0.5 * np.array([F[2, 1] - F[1, 2], F[0, 2] - F[2, 0], F[1, 0] - F[0, 1]])
        off += list(turned / known["start g"])
    low, high = chi2.ppf([0.001, 0.999], len(off)) / len(off)
    assert low < np.mean(np.square(off)) < high


@pytest.mark.long
def test_the_motion_is_nearer_to_the_truth_than_the_sensors_and_the_misfit_is_as_large_as_its_noise():
    found, (_, run, attitudes, _) = tumbling().solve(), log(SEED)
    gap = np.abs(np.asarray(found.run.records.g) - np.asarray(run.records.g))
    assert np.sqrt(np.mean(gap**2)) < 0.5 * 0.02  # where nothing was seen, too
    count = sum(np.sum(np.isfinite(values)) for values in found.residuals.values())
    assert abs(2 * found.cost - (count - 7)) < 4 * math.sqrt(2 * count)  # χ²: one number less for each that is chosen
    assert np.all(np.isnan(found.residuals["attitude"][7:12]))
    assert str(np.sum(np.isfinite(attitudes))) in str(found)
    assert found.difference < 1e-12


@pytest.mark.long
def test_deviations_are_the_curvature_of_the_least_cost():
    """1/σ² = d²J/dθ², where J(θ) is the least cost with θ held."""
    found = tumbling().solve(tolerance=1e-11)
    known = found.deviations()
    step, drag = 0.3 * float(known["drag"]), float(found.parameters["drag"])
    sides = [tumbling(drag=(drag + s, drag + s)).solve(guess=found.run, tolerance=1e-11).cost for s in (step, -step)]
    assert (sum(sides) - 2 * found.cost) / step**2 == pytest.approx(float(known["drag"]) ** -2, rel=3e-3)
    held = {"g": math.inf}
    xi = np.asarray(found.run.start.xi)
    e = 0.3 * float(known["start xi"][0])
    with_held = tumbling(xi=xi, free_start=held | {"xi": np.array([1e-7, math.inf, math.inf])})
    sides = []
    for s in (e, -e):
        there = tumbling(xi=xi + s * np.eye(3)[0], free_start=with_held.free_start)
        sides.append(there.solve(guess=found.run, tolerance=1e-11).cost)
    assert (sum(sides) - 2 * found.cost) / e**2 == pytest.approx(float(known["start xi"][0]) ** -2, rel=3e-3)


@pytest.mark.long
def test_a_bound_leaves_nothing_unknown_and_what_is_not_measured_is_told():
    assert tumbling(drag=(0.5, 1.0)).solve().deviations()["drag"] == 0.0
    _, _, _, rates = log(SEED)
    blind = tumbling(measured={"rates": Measured(lambda motion, p: motion.xi, rates, 0.03)})
    with pytest.raises(co.errors.OptimumError, match="measurements do not determine"):
        blind.solve().deviations()  # no attitude: every start in g is as likely


def test_ill_posed_estimations_are_told():
    _, _, attitudes, rates = log(SEED)
    see = lambda motion, p: motion.xi  # noqa: E731
    for more, words in [
        ({"free_start": {"gee": 1.0}}, "must be a dictionary of g"),
        ({"free_start": {"q": 1.0}}, "no numbers"),
        ({"free_start": {"mu": 1.0}}, "given by its velocities"),
        ({"free_start": {"xi": 0.0}}, "positive"),
        ({"free_start": {"xi": [1.0, 1.0]}}, "3 numbers"),
        ({"measured": {"rates": rates}}, "must be a dictionary"),
        ({"measured": {"rates": Measured(see, rates[:-1], 0.03)}}, "give `times`"),
        ({"measured": {"rates": Measured(see, rates[:2], 0.03, times=[0.0, 0.13])}}, "between two nodes"),
        ({"measured": {"rates": Measured(see, rates[:2], 0.03, times=[0.0, 9.0])}}, "outside"),
        ({"measured": {"rates": Measured(see, rates[:2], 0.03, times=[0.1, 0.1])}}, "two values"),
        ({"measured": {"rates": Measured(see, attitudes, 0.03)}}, "its function returns"),
        ({"measured": {"rates": Measured(see, rates, [0.1, 0.1])}}, "deviation of the shape"),
        ({"free_duration": (1.0, 5.0)}, "leave `free_duration` out"),
    ]:
        with pytest.raises(co.errors.ArgumentError, match=words):
            tumbling(**more).solve()
    for values, deviation, words in [
        (rates, 0.0, "positive"),
        (rates * 1j, 0.1, "numbers"),
        (3.0, 0.1, "NaN for gaps"),
        ("many", 0.1, "numbers"),
    ]:
        with pytest.raises(co.errors.ArgumentError, match=words):
            Measured(see, values, deviation)


def test_a_stationary_motion_that_is_no_minimum_has_no_deviations():
    """(x² − 1)² is stationary at x = 0, where it is largest."""
    system = cart()
    found = Problem(
        system,
        system.state(g=[0.0]),
        dt=H,
        steps=2,
        inputs={"push": Input((1,))},
        cost=lambda motion, p: 0.5 * motion.inputs.push @ motion.inputs.push,
        free_start={"g": math.inf},
        measured={"square": Measured(lambda motion, p: motion.g[0] ** 2, np.ones(3), 0.5)},
    ).solve()
    assert found.iterations == 0
    with pytest.raises(co.errors.OptimumError, match="not a minimum"):
        found.deviations()
