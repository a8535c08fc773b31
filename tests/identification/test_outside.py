"""Logs of REMUS 100 that were simulated without the library, by sensors with bias, delay, coloured noise, drop-outs."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from tests.identification.outside import Remus, columns
from tests.identification.test_coloured import markov
from tests.torpedo import NOISE

import coadjoint as co
from coadjoint.identification import Log, identify
from coadjoint.vehicles import Craft, load

DELAY, BIASES = 0.08, {"u": 0.03, "r": 0.005}
TRUE = {"hull.axial_drag": 0.42, "hull.crossflow_drag": 1.1, "added_mass[1,1]": 29.4376, "added_mass[5,5]": 3.4262}
ALL = {**TRUE, "bias.u": 0.03, "bias.r": 0.005, "delay.position": DELAY}


@pytest.fixture(scope="module")
def craft():
    return Craft(load("remus_100"))


@pytest.fixture(scope="module")
def outside():
    """(times, commands, states, those DELAY before) of 60 s."""
    t = np.arange(600) * 0.1

    def zigzag(period, size):
        return size * np.sign(np.sin(2 * np.pi * t / period) + 1e-12)

    commands = np.stack(
        [zigzag(16, 0.14) + zigzag(7, 0.07), zigzag(11, 0.10) + zigzag(5, 0.08), 18 + zigzag(23, 5) + zigzag(9, 2)], 1
    )
    begun = np.concatenate([[0, 0, 20.0], np.eye(3).ravel(), [1.5, 0, 0, 0, 0, 0], [0.0, 0, 18]])
    return t, commands, *Remus().run(begun, t, commands, DELAY)


def log_of(outside, seed):
    t, commands, states, before = outside
    random, exact = np.random.default_rng(seed), columns(states)
    exact |= {name: values for name, values in columns(before).items() if name in ("north", "east", "depth")}
    seen = {}
    for name, values in exact.items():
        slow = name in BIASES or name in ("v", "w", "p", "q")
        noise = markov(random, 600, NOISE[name], 0.1, 0.6) if slow else NOISE[name] * random.normal(size=600)
        seen[name] = values + noise + BIASES.get(name, 0.0)
        seen[name][random.random(600) < 0.1] = np.nan
    return Log(t, seen, dict(zip(("rudder", "stern_planes", "propeller"), commands.T, strict=True)))


def found_in(craft, outside, seed):
    p = craft.system.parameters
    scale = np.ones((6, 6))
    scale[1, 1] = scale[5, 5] = 1.3
    guess = craft.system.replace(hull={"axial_drag": 0.55, "crossflow_drag": 0.8}, added_mass=scale * p.added_mass)
    start = craft.start(position=(0, 0, 20), speed=1.5, actuators={"propeller": 18.0})
    return identify(
        guess, log_of(outside, seed), start=start, parameters=list(TRUE), coloured=["velocity", "rates"],
        biases=list(BIASES), delays=["position"], longest_delay=0.2, dt=0.0125,
    )  # fmt: skip


def test_the_other_simulator_is_the_same_vehicle(craft, outside):
    """After 10 s, on steps of 0.0125 s, up to the order of the rule."""
    t, commands, states, _ = outside
    rows = slice(0, 101)
    signals = zip(("rudder", "stern_planes", "propeller"), commands[rows].T, strict=True)
    start = craft.start(position=(0, 0, 20), speed=1.5, actuators={"propeller": 18.0})
    inputs = {name: co.Held(t[rows], values) for name, values in signals}
    run = co.simulate(craft.system, start, dt=0.0125, duration=10.0, inputs=inputs, save_every=8, monitors=False)
    last = states[100]
    np.testing.assert_allclose(run.records.xi[-1], last[15:18], atol=2e-3)
    np.testing.assert_allclose(run.records.nu[-1], last[12:15], atol=2e-3)


@pytest.mark.budget(30)
@pytest.mark.parametrize("seeds", [range(1), pytest.param(range(40), marks=pytest.mark.further)])
def test_intervals_hold_the_truth_of_another_simulator(craft, outside, seeds):
    """Misses are binomial, 5 % of the intervals: at most so many as happen once in 2000 times."""
    scores = []
    for seed in seeds:
        found = found_in(craft, outside, seed)
        scores.append([(found[name].value - value) / found[name].standard_error for name, value in ALL.items()])
    scores = np.array(scores)
    print(np.round(scores, 1))
    assert np.sum(np.abs(scores) > 1.96) <= stats.binom.ppf(1 - 1 / 2000, scores.size, 0.05)
