"""Parameters from logs: the truth within the intervals, the exact values without noise, warnings where they are due."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from tests.torpedo import NOISE, damping, fins, guessed, start, torpedo, zigzags

import coadjoint as co
from coadjoint.errors import ArgumentError, CoadjointError, LagrangianError
from coadjoint.identification import Log, identify, synthetic_log
from coadjoint.identification.channels import VEHICLE, Channels
from coadjoint.identification.problem import setting
from coadjoint.identification.unknowns import unknowns

SYSTEM: Any = torpedo()
STATE = start(SYSTEM)
BOTH = ["linear", "quadratic", "added_mass"]


def run_of(duration, dt, every, between=co.Held, interval=0.1, system=SYSTEM):
    t, inputs = zigzags(duration, interval)
    signals = {name: between(t, values) for name, values in inputs.items()}
    steps = every * (round(duration / (dt * every)) - 1)
    return co.simulate(system, STATE, dt=dt, steps=steps, inputs=signals, save_every=every, monitors=False)


@pytest.fixture(scope="module")
def fine():
    """60 s on steps a twentieth of the samples' interval."""
    return run_of(60.0, 0.005, 20)


def measured(run, seed=0):
    """A log of which nothing tells that it was simulated."""
    return replace(synthetic_log(run, noise=NOISE, seed=seed), step=None)


@pytest.fixture(scope="module")
def log(fine):
    return measured(fine)


def truth(name):
    key, _, index = name.partition("[")
    return float(getattr(SYSTEM.parameters, key)[tuple(int(i) for i in index.rstrip("]").split(","))])


@pytest.mark.long
def test_an_exact_log_on_the_same_grid_gives_the_exact_parameters():
    run = run_of(40.0, 0.05, 2)
    log = synthetic_log(run, noise=dict.fromkeys(NOISE, 1e-9))
    found = identify(guessed(SYSTEM), log, start=STATE, parameters=BOTH, noise=dict.fromkeys(NOISE, 1e-6))
    assert found.dt == log.step == 0.05
    for name, estimate in found.estimates.items():
        assert estimate.value == pytest.approx(truth(name), rel=1e-5), name
    assert found.system.parameters is not None
    np.testing.assert_allclose(found.system.parameters.added_mass, SYSTEM.parameters.added_mass, rtol=1e-5, atol=1e-9)


@pytest.mark.long
def test_intervals_hold_the_truth_as_often_as_they_say(fine):
    """Five seeds, eighteen parameters: misses are binomial, 5 % of 90."""
    guess, misses, count = guessed(SYSTEM), 0, 0
    for seed in range(5):
        found = identify(guess, measured(fine, seed=seed), start=STATE, parameters=BOTH)
        misses += sum(not estimate.covers(truth(name)) for name, estimate in found.estimates.items())
        count += len(found.estimates)
        assert not found.warnings
    assert count == 90 and misses <= stats.binom.ppf(1 - 1 / 2000, count, 0.05)
    assert misses > 0


@pytest.mark.long
def test_each_interval_covers_the_truth_in_at_least_90_of_100_seeds():
    run = run_of(150.0, 0.005, 20)
    guess = guessed(SYSTEM)
    covered: dict[str, int] = {}
    scores: dict[str, list[float]] = {}
    for seed in range(100):
        found = identify(guess, measured(run, seed=seed), start=STATE, parameters=BOTH)
        for name, estimate in found.estimates.items():
            covered[name] = covered.get(name, 0) + estimate.covers(truth(name))
            scores.setdefault(name, []).append((estimate.value - truth(name)) / estimate.standard_error)
    print(covered)
    assert min(covered.values()) >= 90
    for name, z in scores.items():
        assert abs(np.mean(z)) < 0.35, name
        assert 0.75 < np.std(z) < 1.3, name


@pytest.mark.long
def test_the_step_is_refined_until_it_shifts_nothing(fine):
    """On dt = 0.05 roll, at five radians a second, is shifted by more than its interval; without `dt` it is not."""
    log = measured(fine, seed=3)
    coarse = identify(guessed(SYSTEM), log, start=STATE, parameters=BOTH, dt=0.05)
    assert any("dt = 0.05 s shifts" in warning for warning in coarse.warnings)
    free = identify(guessed(SYSTEM), log, start=STATE, parameters=BOTH)
    assert free.dt < 0.02 and not free.warnings
    assert abs(free["added_mass[3,3]"].value - 0.03) < abs(coarse["added_mass[3,3]"].value - 0.03)


@pytest.mark.long
def test_gaps_irregular_samples_and_missing_columns_are_no_harm():
    """A fifth of the samples at random times, no sway, heave and yaw rate, no roll; half of surge is missing."""
    random = np.random.default_rng(5)
    run = run_of(60.0, 0.005, 1)
    rows = np.flatnonzero(random.random(len(run.records.t)) < 0.01)
    whole = synthetic_log(run, noise=NOISE, seed=5)
    columns = {name: values[rows] for name, values in whole.columns.items() if name not in ("v", "w", "r", "roll")}
    columns["u"][::2] = np.nan
    # The vehicle was driven from sample to sample.
    t, inputs = run.records.t[rows], {name: values[rows] for name, values in whole.inputs.items()}
    signals = {name: co.Linear(t, values) for name, values in inputs.items()}
    begun = jax.tree.map(lambda leaf: leaf[rows[0]], run.records).replace(inputs=STATE.inputs)
    steps = round((t[-1] - t[0]) / 0.005)
    driven = co.simulate(SYSTEM, begun, dt=0.005, steps=steps, inputs=signals, monitors=False)
    exact = synthetic_log(driven)
    sensed = {
        name: np.where(
            np.isnan(values), np.nan, exact.columns[name][rows - rows[0]] + NOISE[name] * random.normal(size=len(t))
        )
        for name, values in columns.items()
    }
    found = identify(guessed(SYSTEM), Log(t, sensed, inputs), start=STATE, parameters=BOTH, between="linear", dt=0.02)
    misses = [name for name, estimate in found.estimates.items() if not estimate.covers(truth(name))]
    assert len(misses) <= 4, misses


@pytest.mark.long
def test_a_run_from_one_start_needs_no_segments(fine):
    log = measured(fine, seed=1).between(0.0, 30.0)
    near = SYSTEM.replace(linear=1.2 * SYSTEM.parameters.linear)
    whole, cut = (
        identify(near, log, start=STATE, parameters=["linear"], dt=0.02, segment=length) for length in (None, 10.0)
    )
    assert whole.segments == 1 and cut.segments == 3
    for name, estimate in whole.estimates.items():
        assert abs(estimate.value - truth(name)) < 4 * estimate.standard_error
        assert estimate.standard_error < cut[name].standard_error


@pytest.mark.long
def test_slopes_of_what_sensors_say_are_those_of_differences(fine):
    """By the starts of segments and by the parameters, which move the start momenta too."""
    sought = unknowns(SYSTEM, ["linear", "added_mass"], ["linear"])
    log = measured(fine).between(0.0, 12.0)
    asked = setting(sought, log, STATE, Channels(VEHICLE), co.Midpoint(), "held", None, 0.0)
    shooting = asked.shooting(0.05, 4.0)
    random = np.random.default_rng(1815)
    shared, own = 0.1 * random.normal(size=12), 0.01 * random.normal(size=(3, shooting.size))

    def said(x):
        found = shooting.predict(x[shooting.size :], own + x[: shooting.size])
        assert found is not None
        return found

    at = np.concatenate([np.zeros(shooting.size), shared])
    slopes = shooting.slopes(shared, said(at))
    for column, direction in enumerate(np.eye(len(at))):
        difference = (said(at + 1e-6 * direction).values - said(at - 1e-6 * direction).values) / 2e-6
        scale = max(1.0, np.abs(difference).max())
        np.testing.assert_allclose(slopes[:, :, column], difference, atol=1e-7 * scale)


@pytest.mark.long
def test_noise_is_estimated_from_residuals_or_taken_as_given(fine):
    log = measured(fine, seed=2)
    found = identify(guessed(SYSTEM), log, start=STATE, parameters=BOTH, noise={"rates": 0.003, "p": 0.006})
    for name, sigma in NOISE.items():
        given = {"p": 0.006, "q": 0.003, "r": 0.003}
        if name in given:
            assert found.noise[name] == given[name]
        else:
            assert found.noise[name] == pytest.approx(sigma, rel=0.12)
    assert found.assumed == ("p", "q", "r")
    assert any("noise of p was given as 0.006" in warning for warning in found.warnings)


@pytest.mark.long
def test_parameters_that_cannot_be_separated_are_told(fine):
    log = measured(fine, seed=2)
    found = identify(SYSTEM, log, start=STATE, parameters=["inertia[0,0]", "added_mass[3,3]", "linear[3]"])
    assert any("cannot separate inertia[0,0] and added_mass[3,3]" in warning for warning in found.warnings)
    assert found["inertia[0,0]"].high == np.inf and found["added_mass[3,3]"].low == 0.0
    assert found["linear[3]"].covers(0.3)


@pytest.mark.long
def test_parameters_on_which_nothing_depends_are_told(fine):
    log = measured(fine, seed=2)
    system = co.System(
        SYSTEM.group, SYSTEM.lagrangian, additional=SYSTEM.additional, advected=SYSTEM.advected,
        parameters=co.Parameters(**SYSTEM.parameters.asdict(), spare=1.0), forces={"damping": damping, "fins": fins},
    )  # fmt: skip
    found = identify(system, log, start=STATE, parameters=["spare", "linear[0]"])
    assert found.warnings == ("The log contains no information on spare: its motion does not depend on it.",)
    assert found["spare"].high == np.inf
    assert abs(found["linear[0]"].value - 3.0) < 4 * found["linear[0]"].standard_error


@pytest.mark.long
def test_a_log_at_rest_tells_nothing_of_quadratic_damping(fine):
    log = measured(fine, seed=2)
    still = {name: np.zeros_like(values) for name, values in log.inputs.items()}
    random = np.random.default_rng(0)
    calm = Log(log.time, {name: NOISE[name] * random.normal(size=len(log)) for name in NOISE}, still)
    with pytest.raises(CoadjointError, match=r"ran away with quadratic\[1\]"):
        identify(SYSTEM, calm, start=STATE, parameters=["quadratic[1]"])


@pytest.mark.long
def test_coloured_residuals_are_told(fine):
    log = measured(fine, seed=2)
    slow = np.convolve(np.random.default_rng(9).normal(size=len(log) + 19), np.ones(20) / 20, "valid")
    drifting = {**log.columns, "u": log.columns["u"] + 0.05 * slow}
    found = identify(SYSTEM, Log(log.time, drifting, log.inputs), start=STATE, parameters=["linear"])
    assert any("Residuals of" in warning and "u (" in warning for warning in found.warnings)


def test_a_pendulum_is_identified_by_a_function_of_its_state():
    """ℓ = ½ I ω² + m g l a₂ on SO(2): any system, with functions of the state for the columns of the log."""

    def lagrangian(xi, a, p):
        return 0.5 * p.inertia * xi @ xi - p.weight * a[1]

    def drag(motion, p):
        return co.Force(torque=-p.drag * motion.xi)

    p = co.Parameters(inertia=0.5, weight=4.0, drag=0.1)
    pendulum = co.System(co.SO2(), lagrangian, advected=co.Defining(), parameters=p, forces=drag, name="pendulum")
    begun = pendulum.state(xi=[1.5], a0=[0.3, -1.0])
    run = co.simulate(pendulum, begun, dt=0.01, duration=20.0, save_every=5, monitors=False)
    angle = np.unwrap(np.arctan2(run.records.g[:, 1, 0], run.records.g[:, 0, 0]))
    log = Log(run.records.t, {"angle": angle + 0.01 * np.random.default_rng(4).normal(size=len(angle))})
    known = {"angle": lambda state: jnp.arctan2(state.g[1, 0], state.g[0, 0])}
    found = identify(
        pendulum.replace(weight=5.0, drag=0.2), log, start=begun, parameters=["weight", "drag"], measured=known,
        segment=None, positive=["drag"],
    )  # fmt: skip
    assert found["weight"].covers(4.0) and found["drag"].covers(0.1)


@pytest.mark.long
def test_the_card_and_the_figure(fine):
    found = identify(SYSTEM, measured(fine), start=STATE, parameters=["linear[0]", "added_mass[0,0]"])
    card = str(found)
    assert "95% interval" in card and "added_mass[0,0]" in card and "0.84" in card and "lag-one" in card
    assert len(found.plot(["u", "roll"]).axes) == 2
    with pytest.raises(ArgumentError, match="no column `speed`"):
        found.plot(["speed"])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"parameters": ["dampin"]}, "no parameter `dampin`"),
        ({"parameters": []}, "must be a list of names"),
        ({"parameters": "linear"}, "must be a list of names"),
        ({"parameters": ["linear[6]"]}, "has shape \\(6,\\)"),
        ({"parameters": ["center_of_buoyancy"]}, "are zero"),
        ({"parameters": ["linear"], "noise": {"speed": 1.0}}, "names `speed`"),
        ({"parameters": ["linear"], "noise": {"u": 0.0}}, "noise of `u` must be positive"),
        ({"parameters": ["linear"], "segment": 0.2}, "fewer than four samples"),
        ({"parameters": ["linear"], "noise": {"angle": 1.0}}, "names `angle`"),
        ({"parameters": ["linear"], "segment": 0.0}, "`segment` must be positive, but is 0.0"),
        ({"parameters": ["linear"], "segment": -10.0}, "`segment` must be positive, but is -10.0"),
        ({"parameters": ["linear"], "between": "lineer"}, "`between` must be"),
        ({"parameters": ["linear"], "positive": ["quadratic"]}, "no parameter `quadratic`"),
        ({"parameters": ["linear"], "settle": -1.0}, "`settle` must be 0 or more"),
        ({"parameters": ["linear"], "dt": -1.0}, "`dt` must be positive"),
        ({"parameters": ["linear"], "level": 95}, "between 0 and 1"),
        ({"parameters": ["linear"], "measured": {"speed": lambda state: state.t}}, "no column `speed`"),
        ({"parameters": ["linear"], "level": None}, "`level` must be a number between 0 and 1, but is None"),
        ({"parameters": ["linear"], "segment": "10"}, "`segment` must be a positive number, but is '10'"),
        ({"parameters": ["linear"], "segment": True}, "`segment` must be positive, but is True"),
        ({"parameters": ["linear"], "dt": "0.05"}, "`dt` must be a positive number"),
        ({"parameters": ["linear"], "settle": "2"}, "`settle` must be a finite number"),
        ({"parameters": ["linear"], "delays": ["position"], "longest_delay": "1"}, "`longest_delay` must be a finite"),
        ({"parameters": ["linear"], "noise": 0.1}, "`noise` must be name → value"),
        ({"parameters": ["linear"], "noise": {"u": True}}, "noise of `u` must be positive, but is True"),
        ({"parameters": ["linear"], "measured": [1]}, "`measured` must be name → value"),
        ({"parameters": ["linear"], "measured": {"u": None}}, "`u` of `measured` must be a function of the state"),
        ({"parameters": ["linear"], "measured": {"u": lambda state: state.nu}}, "of `u` in `measured` must return one"),
        ({"parameters": ["linear"], "start": None}, r"`start` must be a state, system\.state"),
        ({"parameters": ["linear"], "method": "midpoint"}, "`method` must be a method such as co.Midpoint"),
        ({"parameters": ["center_of_buoyancy[0]"], "positive": ["center_of_buoyancy"]}, "starts from 0"),
    ],
)  # fmt: skip
def test_a_wrong_argument_is_told_in_a_sentence(log, change, told):
    with pytest.raises((ArgumentError, LagrangianError), match=told):
        identify(SYSTEM, log, **{"start": STATE, **change})


def test_an_entry_named_as_positive_is_sought_by_its_logarithm():
    sought = unknowns(SYSTEM, ["linear"], ["linear[1]"]).each
    assert [unknown.positive for unknown in sought] == [unknown.label == "linear[1]" for unknown in sought]


def test_noise_of_columns_that_the_log_lacks_is_told(fine):
    log = measured(fine)
    without = replace(log, columns={name: values for name, values in log.columns.items() if name not in "uvw"})
    with pytest.raises(ArgumentError, match="holds none of u, v, w"):
        identify(SYSTEM, without, start=STATE, parameters=["linear"], noise={"velocity": 0.01})


@pytest.mark.long
def test_a_wrong_log_is_told_in_a_sentence(fine):
    log = measured(fine)
    with pytest.raises(ArgumentError, match="an input that the log does not hold"):
        identify(SYSTEM, replace(log, inputs={"rudder": log.inputs["rudder"]}), start=STATE, parameters=["linear"])
    craft: Any = SimpleNamespace(system=SYSTEM)
    with pytest.raises(ArgumentError, match=r"must be a co\.System, but is SimpleNamespace: give its `system`"):
        identify(craft, log, start=STATE, parameters=["linear"])
    given: Any
    for given in ("zigzag.csv", fine, log.columns):
        with pytest.raises(ArgumentError, match=r"`log` must be a Log, as co.vehicles.logs.read_log\(path\) and"):
            identify(SYSTEM, given, start=STATE, parameters=["linear"])
    with pytest.raises(ArgumentError, match="column `heading` is in deg, but a Log has it in rad"):
        degrees = replace(log, units={**log.units, "heading": "deg"})
        identify(SYSTEM, degrees, start=STATE, parameters=["linear"])
    with pytest.raises(ArgumentError, match=r"samples are 100 s apart: are times in seconds\?"):
        identify(SYSTEM, replace(log, time=1000 * log.time), start=STATE, parameters=["linear"])
    with pytest.raises(ArgumentError, match=r"lasts 0.0599 s, shorter than 3 steps of 0.05 s.*are times in seconds\?"):
        identify(SYSTEM, replace(log, time=1e-3 * log.time), start=STATE, parameters=["linear"], dt=0.05)
    with pytest.raises(ArgumentError, match="too few"):
        identify(SYSTEM, log.between(0.0, 0.3), start=STATE, parameters=["linear"])
    with pytest.raises(ArgumentError, match="not a quantity of a vehicle, the nearest is"):
        identify(
            SYSTEM,
            replace(log, columns={**log.columns, "headin": log.columns["u"]}),
            start=STATE,
            parameters=["linear"],
        )
    with pytest.raises(CoadjointError, match=r"fails already|did not converge|ran away"):
        identify(SYSTEM.replace(linear=-1e5 * np.ones(6)), log, start=STATE, parameters=["linear"])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"noise": {"u": -0.1}}, "noise of `u`, a standard deviation, must be a finite number from 0, but is -0.1"),
        ({"noise": {"u": np.inf}}, "noise of `u`, a standard deviation, must be a finite"),
        ({"noise": {"u": "0.1"}}, "noise of `u`, a standard deviation, must be a finite"),
        ({"seed": -1}, "`seed` must be a whole number from 0, but is -1"),
        ({"seed": 1.5}, "`seed` must be a whole number"),
    ],
)
def test_a_log_is_not_made_with_noise_that_is_none(fine, change, told):
    with pytest.raises(ArgumentError, match=told):
        synthetic_log(fine, **change)
