"""Actuators at the starts of segments: known from their commands, with the derivatives by what is sought of them."""

from __future__ import annotations

import re
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

import coadjoint as co
from coadjoint.errors import CoadjointError
from coadjoint.identification import Log, identify, synthetic_log
from coadjoint.identification.channels import Channels
from coadjoint.identification.fit import Fit
from coadjoint.identification.fitting import lost
from coadjoint.identification.least_squares import Solution
from coadjoint.identification.problem import setting
from coadjoint.identification.unknowns import unknowns

TRUTH = {"lag": 0.25, "rate": 3.0, "drag": 0.4}
MEASURED = {"spin": lambda state: state.mu[2] / 2}


def rotor(internal, **parameters) -> Any:
    """A body that a motor turns about its third axis against a drag."""
    return co.System(
        co.SO3(),
        lambda xi, p: 0.5 * xi @ (np.array([1.0, 1.0, 2.0]) * xi),
        forces=lambda m, p: co.Force(torque=jnp.array([0, 0, 1.0]) * (m.internal.motor - p.drag * m.xi[2])),
        internal=internal,
        parameters=co.Parameters(**(TRUTH | parameters)),
    )  # fmt: skip


def lagging(motion, h, p):
    """τ ẋ = u − x."""
    x, u, late = motion.internal.motor, motion.ahead.motor, jnp.exp(-h / p.lag)
    return {"motor": co.mechanics.Course(u + (x - u) * late, u + (x - u) * (1 - late) * p.lag / h)}


def limited(motion, h, p):
    """ẋ = ±r towards u."""
    gap = motion.ahead.motor - motion.internal.motor
    moved = jnp.clip(gap, -p.rate * h, p.rate * h)
    time = jnp.abs(moved) / p.rate
    return {
        "motor": co.mechanics.Course(
            motion.internal.motor + moved, motion.internal.motor + moved * (1 - 0.5 * time / h)
        )
    }


def braked(motion, h, p):
    """A lag that depends on the motion."""
    x, u, late = motion.internal.motor, motion.ahead.motor, jnp.exp(-h * (1 + motion.xi[2] ** 2) / p.lag)
    return {"motor": u + (x - u) * late}


def commands(t):
    return np.sign(np.sin(2 * np.pi * t / 2.9) + 1e-12) + 0.7 * np.sign(np.sin(2 * np.pi * t / 1.7 + 1) + 1e-12)


def logged(system, seeds=1, duration=20.0, noise=0.005) -> tuple[Any, list[Log]]:
    t = np.arange(0.0, duration, 0.1)
    start = system.state(xi=[0, 0, 0.3], internal={"motor": 0.2})
    inputs = {"motor": co.Held(t, commands(t))}
    run = co.simulate(
        system, start, dt=0.05, steps=2 * len(t) - 2, inputs=inputs, save_every=2, monitors=False, progress=False
    )
    exact = np.asarray(run.dataset.mu)[:, 2] / 2
    noises = (np.random.default_rng(seed).normal(0.0, noise, len(exact)) for seed in range(seeds))
    times = np.asarray(run.dataset.time)
    logs = [Log(times, {"spin": exact + off}, {"motor": commands(times)}, step=0.05) for off in noises]
    return start, logs


@pytest.mark.parametrize(("rule", "name"), [(lagging, "lag"), pytest.param(limited, "rate", marks=pytest.mark.long)])
def test_derivatives_across_the_starts_of_segments_are_those_of_the_simulation(rule, name):
    """Segments of 0.5 s, of which each begins in the middle of a change."""
    system = rotor(rule)
    start, (log,) = logged(system, duration=6.0)
    channels = Channels((), tuple(MEASURED.items()))
    asked = setting(unknowns(system, [name, "drag"], []), log, start, channels, co.Midpoint(), "held", 0.05, 0.0)
    shooting = asked.shooting(0.05, 0.5)
    own, x, step = np.zeros((shooting.runs, shooting.own)), np.array([0.1, 0.1]), 1e-6
    assert shooting.runs == 12 and shooting.actuators is not None and not shooting.handed
    found = shooting.predict(x, own)
    assert found is not None
    slopes = shooting.slopes(x, found)[:, :, shooting.size :]
    for k in range(2):
        there, back = (shooting.predict(x + sign * step * np.eye(2)[k], own) for sign in (1, -1))
        assert there is not None and back is not None
        np.testing.assert_allclose(slopes[:, :, k], (there.values - back.values) / (2 * step), atol=1e-7)
    assert np.abs(slopes[1:, 2:, 0]).max() > 1e-3


def test_segments_begin_with_actuators_as_one_run_has_them_there():
    """Also in the middle of steps, where samples are irregular, with dt that fits no interval."""
    system = rotor(lagging)
    start, (log,) = logged(system, duration=6.0, noise=0.0)
    rows = np.delete(np.arange(len(log)), [7, 8, 21, 33])
    irregular = Log(
        log.time[rows], {"spin": log.columns["spin"][rows]}, {"motor": log.inputs["motor"][rows]}, step=0.05
    )
    channels = Channels((), tuple(MEASURED.items()))
    for given, h in ((irregular, 0.05), (log, 0.03)):
        asked = setting(unknowns(system, ["drag"], []), given, start, channels, co.Midpoint(), "held", h, 0.0)
        shooting = asked.shooting(h, 1.0)
        assert shooting.actuators is not None
        found = shooting.actuators.at_starts(shooting.unknowns.numbers).values[:, 0]
        x, exact = 0.2, []
        edges = np.unique(np.concatenate([given.time, shooting.samples.starts]))
        for time, following in zip(edges, [*edges[1:], edges[-1]], strict=True):
            if np.any(shooting.samples.starts == time):
                exact.append(x)
            u = given.inputs["motor"][np.searchsorted(given.time, time, side="right") - 1]
            x = u + (x - u) * np.exp(-(following - time) / TRUTH["lag"])
        assert len(exact) == shooting.runs > 4
        np.testing.assert_allclose(found, exact, atol=1e-12 if h == 0.05 else 0.03)


def found_in(rule, name, off, seeds) -> list[Any]:
    """What is found with default segments in logs of 30 s, from a guess that is off by a factor."""
    start, logs = logged(rotor(rule), seeds=seeds, duration=30.0)
    guess = rotor(rule, **{name: off * TRUTH[name], "drag": off * TRUTH["drag"]})
    sought: dict[str, Any] = {"start": start, "parameters": [name, "drag"], "measured": MEASURED, "progress": False}
    found = [identify(guess, log, **sought) for log in logs]
    assert all(one.segments == 3 for one in found)
    return found


@pytest.mark.long
def test_the_lag_of_an_actuator_is_found_with_default_segments():
    (found,) = found_in(lagging, "lag", 1.3, 1)
    for name in ("lag", "drag"):
        assert abs(found[name].value - TRUTH[name]) < 4 * found[name].standard_error < 0.02


@pytest.mark.long
@pytest.mark.parametrize(("rule", "name"), [(lagging, "lag"), (limited, "rate")])
@pytest.mark.parametrize("off", [0.7, 1.3])
def test_lag_and_rate_of_an_actuator_are_found_in_20_of_20_logs(rule, name, off):
    """Misses of the intervals are binomial."""
    misses = sum(not one[key].covers(TRUTH[key]) for one in found_in(rule, name, off, 20) for key in (name, "drag"))
    assert misses <= stats.binom.ppf(0.999, 40, 0.05)


@pytest.mark.long
def test_an_internal_state_whose_derivative_does_not_cross_segments_is_named_and_by_default_there_are_none():
    system = rotor(braked, lag=2.0)
    start, (log,) = logged(system, duration=30.0, noise=1e-6)
    with pytest.raises(CoadjointError, match=r"`motor` depends on the motion.*segment=None"):
        identify(rotor(braked, lag=1.4), log, start=start, parameters=["lag", "drag"], measured=MEASURED, segment=2.0)
    sought: dict[str, Any] = {"start": start, "parameters": ["lag", "drag"], "measured": MEASURED, "progress": False}
    whole = identify(rotor(braked, lag=1.4), log, **sought)
    assert whole.segments == 1 and whole["lag"].covers(2.0) and whole["lag"].standard_error < 1e-2
    cut = identify(rotor(braked, lag=1.4), log, segment=10.0, **sought)
    assert any("`motor` depends on the motion" in said and "the 3 segments" in said for said in cut.warnings)


@pytest.mark.long
def test_the_lag_of_thrusters_is_found_in_logs_of_a_vehicle():
    from tests.identification.outside_logs import bluerov
    from tests.torpedo import NOISE

    made = bluerov(20.0)
    system: Any = made.craft.system
    inputs = {name: co.Held(made.time, values) for name, values in made.inputs.items()}
    run = co.simulate(
        system, made.start, dt=0.05, duration=19.9, inputs=inputs, save_every=2, monitors=False, progress=False
    )
    lag = float(system.parameters.thrusters.lag)
    for seed, off in enumerate([0.7, 1.3, 0.7, 1.3]):
        guess = system.replace(thrusters={"lag": off * lag})
        log = synthetic_log(run, noise=NOISE, seed=seed)
        found = identify(guess, log, start=made.start, parameters=["thrusters.lag", "damping.linear[2]"])
        assert abs(found["thrusters.lag"].value - lag) < 4 * found["thrusters.lag"].standard_error < 2e-3


@pytest.mark.parametrize(
    ("factor", "says"),
    [(3.0, r"still misses spin \(0\.\d+\) by far more than"), (1.0, "does not separate the parameters")],
)
def test_a_search_that_fails_names_the_columns_that_the_simulation_misses_if_there_are_any(factor, says):
    system = rotor(lagging)
    start, (log,) = logged(system, duration=8.0)
    log = Log(log.time, {"spin": factor * log.columns["spin"]}, log.inputs, step=0.05)
    channels = Channels((), tuple(MEASURED.items()))
    asked = setting(unknowns(system, ["lag", "drag"], []), log, start, channels, co.Midpoint(), "held", 0.05, 0.0)
    fit = Fit(asked.shooting(0.05, None), asked, np.array([0.005]))
    place = fit.at(np.zeros(2))
    found = fit.residual(place)
    assert found is not None
    solution = Solution(place, found[0], fit.jacobian(place, found[1]), float(np.vdot(found[0], found[0])), 7, False)
    assert re.search(says, said := lost(fit, solution, 7)) and said.startswith("Least squares did not converge in 7")
