"""Forces and parameters that wander: their strength, and intervals that hold the truth beside them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy import stats
from tests.identification.outside_logs import INTERVAL, remus
from tests.identification.test_coloured import markov
from tests.identification.test_sensor_model import NEAR, SOUGHT, STATE, SYSTEM, TRUE
from tests.torpedo import NOISE, zigzags

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.identification import Log, identify, synthetic_log
from coadjoint.identification.channels import VEHICLE, Channels
from coadjoint.identification.fit import Fit
from coadjoint.identification.problem import setting
from coadjoint.identification.process_noise import (
    Knots,
    Wander,
    _unlikely,
    likeliest,
    normal_equations,
    posterior,
    prediction_errors,
    wander_errors,
)
from coadjoint.identification.process_noise_estimate import _units
from coadjoint.identification.process_noise_model import wandering, without
from coadjoint.identification.unknowns import unknowns

KNOTS = Knots(("a", "b"), np.array([0, 1]), np.array([0, 1]), 0.5, 12)
S, TAU = 2.0, 2.0
"""Of the force that wanders, N along each axis and s."""


def covariance(wander):
    """Of all knots, by the covariance of the process."""
    far = KNOTS.spacing * np.abs(np.subtract.outer(np.arange(KNOTS.count), np.arange(KNOTS.count)))
    return KNOTS.spread(np.stack([s**2 * np.exp(-far / tau) for s, tau in zip(*wander, strict=True)]))


def linear(wander, segments, rows=60, seed=0, wandered=False):
    """J and r of segments that see a wander in two numbers, with a start of two numbers and one parameter; with what
    takes x = 0 to it where that is asked."""
    random = np.random.default_rng(seed)
    J = random.normal(size=(segments, rows, 2 + KNOTS.size + 1))
    root = np.linalg.cholesky(covariance(wander))
    x = random.normal(size=(segments, KNOTS.size)) @ root.T
    r = random.normal(size=(segments, rows)) + np.einsum("srk,sk->sr", J[:, :, 2:-1], x)
    return (J, r, -x) if wandered else (J, r)


def test_the_roots_of_the_precision_are_those_of_the_process():
    wander = Wander(np.array([0.7, 3.0]), np.array([0.3, 5.0]))
    L = KNOTS.spread(KNOTS.roots(wander))
    np.testing.assert_allclose(L @ covariance(wander) @ L.T, np.eye(KNOTS.size), atol=1e-12)


def test_the_likelihood_is_the_restricted_one_of_the_covariance_and_has_its_derivatives():
    """Between two wanders: log |V| + log |XᵀV⁻¹X| + rᵀ(V⁻¹ − V⁻¹X(XᵀV⁻¹X)⁻¹XᵀV⁻¹)r with V = 1 + F cov(x) Fᵀ."""
    J, r = linear(Wander(np.array([1.0, 0.5]), np.array([1.0, 2.0])), 3)
    own = slice(2, 2 + KNOTS.size)
    given = normal_equations(J, r, np.zeros((3, KNOTS.size)), own, 2 + KNOTS.size)

    def brute(wander):
        X, V = np.zeros((180, 7)), np.zeros((180, 180))
        for s in range(3):
            rows = slice(60 * s, 60 * s + 60)
            X[rows, 2 * s : 2 * s + 2], X[rows, 6] = J[s, :, :2], J[s, :, -1]
            V[rows, rows] = np.eye(60) + J[s, :, own] @ covariance(wander) @ J[s, :, own].T
        W, flat = np.linalg.inv(V), r.ravel()
        A = X.T @ W @ X
        left = flat @ W @ flat - flat @ W @ X @ np.linalg.solve(A, X.T @ W @ flat)
        return np.linalg.slogdet(V)[1] + np.linalg.slogdet(A)[1] + left

    one, other = (Wander(np.array(s), np.array(t)) for s, t in (([1.0, 0.6], [0.9, 3.0]), ([0.4, 1.2], [4.0, 0.5])))
    ours = _unlikely(given, KNOTS, one)[0] - _unlikely(given, KNOTS, other)[0]
    assert ours == pytest.approx(brute(one) - brute(other), rel=1e-8)
    place, slopes = np.log(np.concatenate(one)), _unlikely(given, KNOTS, one)[1]
    for i, step in enumerate(1e-5 * np.eye(4)):
        pair = [np.exp(place + sign * step) for sign in (1, -1)]
        values = [_unlikely(given, KNOTS, Wander(at[:2], at[2:]))[0] for at in pair]
        assert slopes[i] == pytest.approx((values[0] - values[1]) / 2e-5, rel=1e-5, abs=1e-5)


def test_the_strength_that_is_found_is_that_of_the_process():
    """Of 200 segments: s within 10 %, τ within 25 %; and of none that wanders next to nothing."""
    true = Wander(np.array([1.0, 0.3]), np.array([1.0, 3.0]))
    for wander in (true, Wander(np.array([1e-9, 1e-9]), np.array([1.0, 1.0]))):
        J, r = linear(wander, 200, seed=4)
        given = normal_equations(J, r, np.zeros((200, KNOTS.size)), slice(2, 2 + KNOTS.size), 2 + KNOTS.size)
        found = likeliest(given, KNOTS, 100.0)
        if wander is true:
            np.testing.assert_allclose(found.deviation, true.deviation, rtol=0.1)
            np.testing.assert_allclose(found.time, true.time, rtol=0.25)
        else:
            assert np.all(found.deviation < 0.03)


@pytest.mark.long
def test_intervals_of_strength_hold_the_truth_and_so_do_those_of_what_wandered():
    """Of 60 times 12 segments: misses are binomial, of 240 numbers s and τ, and 5 % of all x at the truth."""
    true, own = Wander(np.array([1.0, 0.5]), np.array([1.0, 2.0])), slice(2, 2 + KNOTS.size)
    held, x_held = 0, []
    for seed in range(60):
        J, r, x = linear(true, 12, seed=seed, wandered=True)
        given = normal_equations(J, r, np.zeros((12, KNOTS.size)), own, own.stop)
        found = likeliest(given, KNOTS, 100.0)
        off = np.log(np.concatenate(found) / np.concatenate(true))
        held += np.sum(np.abs(off) < 1.96 * np.concatenate(wander_errors(given, KNOTS, 100.0, found)))
        here = posterior(given, KNOTS, true)
        x_held.append(np.abs(here.x - x) < 1.96 * np.sqrt(np.einsum("sxx->sx", here.covariance)))
    assert 240 - held <= stats.binom.ppf(1 - 1 / 2000, 240, 0.05)
    assert held < 240 and np.mean(x_held) == pytest.approx(0.95, abs=0.01)


def test_a_strength_at_the_end_of_what_is_sought_has_no_error():
    """Of what does not wander s stands at its lower bound, and its τ is anything; at the longest τ only s has one."""
    still = Wander(np.array([1e-9, 0.5]), np.array([1.0, 2.0]))
    J, r, _ = linear(still, 40, seed=2, wandered=True)
    given = normal_equations(J, r, np.zeros((40, KNOTS.size)), slice(2, 2 + KNOTS.size), 2 + KNOTS.size)
    found = Wander(np.array([1e-9, 0.5]), np.array([1.0, 2.0]))
    errors = wander_errors(given, KNOTS, 100.0, found)
    assert np.isinf(errors.deviation[0]) and errors.deviation[1] < 0.3 and errors.time[1] < 0.5
    assert np.isinf(errors.time[0])
    longest = wander_errors(given, KNOTS, 2.0, found)
    assert np.isinf(longest.time[1]) and 0.0 < longest.deviation[1] < errors.deviation[1]


def test_prediction_errors_are_white(monkeypatch):
    """W (1 + F cov(x) Fᵀ) Wᵀ = 1, for a fit too, whose samples depend on its starts and then on the knots."""
    wander, random = Wander(np.array([1.0, 0.5]), np.array([1.0, 2.0])), np.random.default_rng(1)
    F = random.normal(size=(1, 10, KNOTS.size, 3))
    L = KNOTS.spread(KNOTS.roots(wander))
    W = np.stack([prediction_errors(row.reshape(1, 10, 3), F, L.T @ L).ravel() for row in np.eye(30)], 1)
    flat = F[0].swapaxes(1, 2).reshape(30, -1)
    np.testing.assert_allclose(W @ (np.eye(30) + flat @ covariance(wander) @ flat.T) @ W.T, np.eye(30), atol=1e-9)
    monkeypatch.setattr("coadjoint.identification.fit.whitened", lambda slopes, near, times: slopes)
    starts, own = np.zeros((1, 10, 2, 3)), 2 + KNOTS.size
    fit: Any = SimpleNamespace(
        innovations=lambda found, shared: found, slopes=lambda *_: np.concatenate([starts, F], axis=2), wander=wander,
        shooting=SimpleNamespace(knots=KNOTS, size=2), own=own, near=None, times=None, sigma=1.0,
    )  # fmt: skip
    place: Any = SimpleNamespace(shared=None, own=np.zeros((1, own)))
    found = Fit.surprise(fit, place, np.eye(30)[3].reshape(1, 10, 3))  # type: ignore[arg-type]
    np.testing.assert_allclose(found.ravel(), W[:, 3], atol=1e-12)


@pytest.fixture(scope="module")
def exact() -> Log:
    t, inputs = zigzags(40.0)
    signals = {name: co.Held(t, values) for name, values in inputs.items()}
    run = co.simulate(SYSTEM, STATE, dt=0.05, duration=39.9, inputs=signals, save_every=2, monitors=False)
    return synthetic_log(run, noise=NOISE, seed=1)


def test_knots_last_whole_steps_whatever_the_segment(exact):
    """33 s of 40 knots at most, on steps of 0.05 s: what is held is what is told."""
    system, moved = wandering(SYSTEM, ["force"])
    asked = setting(
        unknowns(system, ["linear"], []), exact.between(0.0, 33.0), STATE, Channels(VEHICLE), co.Midpoint(), "held",
        0.05, 0.0, wandering=moved,
    )  # fmt: skip
    for h in (0.05, 0.025):
        shooting = asked.shooting(h, 33.0, "new")
        assert shooting.knots is not None
        held = shooting._wandering(np.zeros((shooting.runs, shooting.knots.size)))
        assert held is not None and held.steps * h == pytest.approx(shooting.knots.spacing, rel=1e-12)
        assert shooting.knots.spacing * shooting.knots.count >= 32.9


def test_a_name_of_the_system_s_own_is_its_parameter_and_not_a_force():
    numbers = {"K": 1.0, "force": 2.0}
    own = co.System(co.SO3(), lambda xi, p: 0.5 * xi @ xi + p.K + p.force, parameters=numbers)
    system, moved = wandering(own, ["K", "force"])
    assert system is own and moved is not None and moved.labels == ("K", "force")


@pytest.mark.long
def test_derivatives_by_knots_are_those_of_differences(exact):
    system, moved = wandering(SYSTEM, ["force", "N", "linear[1]", "mass"])
    assert moved is not None and moved.labels == ("X", "Y", "Z", "N", "linear[1]", "mass")
    asked = setting(
        unknowns(system, ["linear"], []), exact.between(0.0, 12.0), STATE, Channels(VEHICLE), co.Midpoint(), "held",
        0.05, 0.0, wandering=moved,
    )  # fmt: skip
    shooting = asked.shooting(0.05, 6.0, "new")
    random = np.random.default_rng(2)
    own = 0.3 * random.normal(size=(shooting.runs, shooting.own))
    own[:, : shooting.size] *= 0.1
    zero = np.zeros(6)
    found = shooting.predict(zero, own)
    assert found is not None
    slopes = shooting.slopes(zero, found)
    for column in (shooting.size, shooting.size + 4, shooting.size + 5, shooting.size + 19, shooting.own - 1, 3):
        pair: list[Any] = []
        for h in (1e-5, -1e-5):
            there = own.copy()
            there[:, column] += h
            pair.append(shooting.predict(zero, there))
        by_hand = (pair[0].values - pair[1].values) / 2e-5
        assert np.abs(by_hand).max() > 1e-4
        np.testing.assert_allclose(slopes[:, :, column], by_hand, atol=2e-6 * max(1.0, np.abs(by_hand).max()))


def test_the_force_is_along_the_axes_of_the_body_and_leaves_with_the_identification():
    """It is along the axes of the body, and taken away again afterwards."""
    system, moved = wandering(SYSTEM, ["X"])
    again = without(system)
    assert again.parameters is not None and SYSTEM.parameters is not None
    assert set(again.parameters) == set(SYSTEM.parameters)
    assert tuple(name for name, _ in again.forces or ()) == tuple(name for name, _ in SYSTEM.forces or ())
    assert moved is not None and system.parameters is not None
    motion = SimpleNamespace()
    pushed = system.replace(process_noise=[1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    force = dict(pushed.forces or ())["process_noise"](motion, pushed.parameters)
    np.testing.assert_array_equal(force.force, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(force.torque, [4.0, 5.0, 6.0])
    labels = [getattr(wandering(SYSTEM, [name])[1], "labels", None) for name in ("force", "torque", "X")]
    assert labels == [("X", "Y", "Z"), ("K", "M", "N"), ("X",)]


def pushed(made, seed):
    """What sensors say of a vehicle that a force pushes that wanders along all axes."""
    random, n = np.random.default_rng(1000 + seed), len(made.time)
    force = np.stack([markov(random, n, S, INTERVAL, TAU) for _ in range(3)], axis=1)
    return made.simulated(pushes=np.concatenate([force, np.zeros((n, 3))], axis=1)), force


@pytest.mark.long
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("seeds", [range(1), pytest.param(range(30), marks=pytest.mark.long)])
def test_intervals_hold_the_truth_where_a_force_wanders(seeds):
    """REMUS 100 by equations outside the library, with sensors that are off: with the force, misses are binomial, 5 %
    of the intervals; without it they are many more."""
    made, inside, near = remus(), np.zeros(2), []
    for seed in seeds:
        exact, force = pushed(made, seed)
        log = made.log(seed, exact)
        for i, noise in enumerate(([], ["force"])):
            found = made.identified(log, segment=10.0, process_noise=noise)
            inside[i] += sum(found[name].covers(value) for name, value in made.all.items())
        near.append([np.corrcoef(found.process_noise[axis].values, force[:, j])[0, 1] for j, axis in enumerate("XYZ")])
        print(f"{seed + 1} logs: {inside} of {(seed + 1) * len(made.all)}, {np.mean(near):.2f}", flush=True)
        deviations = [one.deviation for one in found.process_noise.values()]
        assert min(deviations) > 0.5 * S and max(deviations) < 2 * S
    count = len(seeds) * len(made.all)
    print(f"without: {inside[0] / count:.1%} of {count}, with: {inside[1] / count:.1%}; {np.mean(near):.2f}")
    assert np.mean(near) > 0.8
    assert count - inside[1] <= stats.binom.ppf(1 - 1 / 2000, count, 0.05)
    assert count - inside[0] > stats.binom.ppf(1 - 1 / 2000, count, 0.05)


@pytest.mark.long
def test_nothing_wanders_where_nothing_does(exact):
    """The deviation is far below the forces at work, some 10 N, and estimates are those without it."""
    plain = identify(NEAR, exact, start=STATE, parameters=SOUGHT)
    found = identify(NEAR, exact, start=STATE, parameters=SOUGHT, process_noise=["X", "Y"])
    assert plain.process_noise == {} and set(found.process_noise) == {"X", "Y"}
    assert max(one.deviation for one in found.process_noise.values()) < 0.3
    for name, true in TRUE.items():
        assert abs(found[name].value - plain[name].value) < 1.0 * plain[name].standard_error
        assert abs(found[name].value - true) < 4 * found[name].standard_error
        assert found[name].standard_error < 1.6 * plain[name].standard_error
    assert "wanders " in str(found) and found.settled and "still changed" not in str(found)
    for one in found.process_noise.values():
        low, high = one.deviation_interval
        assert low <= one.deviation <= high and one.unit == "N" and f"{one.deviation:.4g} N " in str(found)
        assert one.errors.shape == one.values.shape and np.all(one.errors <= 1.01 * one.deviation)
    assert {name for name, _ in found.system.forces or ()} == {name for name, _ in SYSTEM.forces or ()}
    assert found.system.parameters is not None and "process_noise" not in found.system.parameters


@pytest.mark.long
def test_noise_that_does_not_settle_is_told(exact, monkeypatch):
    """One round is too few for the noise of the sensors and what wanders."""
    monkeypatch.setattr("coadjoint.identification.fitting.ROUNDS", 1)
    monkeypatch.setattr("coadjoint.identification.diagnostics.ROUNDS", 1)
    found = identify(NEAR, exact.between(0.0, 10.0), start=STATE, parameters=SOUGHT, process_noise=["X"])
    assert not found.settled
    (sentence,) = [one for one in found.warnings if "still changed" in one]
    assert sentence.startswith("After 1 rounds of least squares the ") and "in the last: the intervals" in sentence


def test_what_wanders_has_the_unit_of_what_it_is():
    """Of a force N and N m, of a parameter what the system says, whatever its name."""
    plain = co.System(
        SYSTEM.group, lambda xi, n, nu, a, p: 0.5 * xi @ xi + 0.5 * nu @ nu + 0.0 * p.X,
        additional=SYSTEM.additional, advected=SYSTEM.advected, parameters={"X": 1.0, "gains": np.ones(2)},
        units={"X": "m/s", "gains": "1"},
    )  # fmt: skip
    system, moved = wandering(plain, ["X", "Y", "M", "gains"])
    assert moved is not None and moved.labels == ("X", "Y", "M", "gains[0]", "gains[1]")
    assert _units(system, Knots(*moved, 0.5, 12)) == ["m/s", "N", "N m", "", ""]


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ("force", "must be a list of names, such as"),
        (["forces"], "no `forces` that process noise could move; the nearest is `force`"),
        (["added_mass"], "acts on numbers and lists, but `added_mass` has shape"),
        (["linear[9]"], "`linear\\[9\\]` is not an entry of `linear`"),
    ],
)
def test_what_cannot_wander_is_refused_in_a_sentence(exact, given, sentence):
    with pytest.raises(ArgumentError, match=sentence):
        identify(NEAR, exact, start=STATE, parameters=SOUGHT, process_noise=given)


def test_a_force_on_what_is_no_vehicle_is_refused():
    top: Any = co.System(co.SO3(), lambda xi, p: 0.5 * p.J * xi @ xi, parameters={"J": 2.0}, name="ball")
    with pytest.raises(ArgumentError, match="names a force, but the system is not a vehicle"):
        wandering(top, ["force"])
