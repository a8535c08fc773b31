"""A vehicle that pitches up to 87°, where Euler angles jump and a search gets stuck: it begins again and finds it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.identification import identify, synthetic_log
from coadjoint_vehicles import Craft

NOISE = {"north": 0.1, "east": 0.1, "depth": 0.02, "roll": 0.005, "pitch": 0.005, "heading": 0.01}
NOISE |= {"u": 0.01, "v": 0.01, "w": 0.01, "p": 0.003, "q": 0.003, "r": 0.003}


def steps(t, size, seed):
    random, found = np.random.default_rng(seed), np.zeros_like(t)
    for _ in range(5):
        period, phase = random.uniform(3, 15), random.uniform(0, 6.28)
        found += size / 3 * np.sign(np.sin(2 * np.pi * t / period + phase))
    return found


@pytest.mark.long
def test_a_search_that_is_stuck_begins_again_and_comes_to_the_truth():
    vehicle = vehicles.load("bluerov2_heavy_von_benzon")
    craft = Craft(vehicle)
    thrusters: Any = next(part for part in vehicle.parts if part.name == "thrusters")
    t = np.arange(0.0, 40.0, 0.1)
    wanted = np.stack([steps(t, size, i) for i, size in enumerate([40, 40, 40, 1.5, 1.5, 8])], axis=1)
    commands = co.Held(t, np.array([np.asarray(thrusters.allocate(w)) for w in wanted]))
    start = craft.start(position=(0, 0, 20))
    truth: Any = craft.system.parameters
    inputs = {"thrusters": commands}
    run = co.simulate(craft.system, start, dt=0.02, duration=39.9, inputs=inputs, save_every=5, monitors=False)
    guess = craft.system.replace(
        damping={"quadratic": 1.3 * truth.damping.quadratic}, added_mass=0.75 * truth.added_mass
    )
    names = ["damping.quadratic", *(f"damping.linear[{i}]" for i in range(3)), "added_mass"]
    log = synthetic_log(run, noise=NOISE, seed=3)
    found = identify(guess, log, start=start, parameters=names, attitude="angles")
    assert found.iterations > 100, "it is no longer stuck: take a harder log"
    quadratic = np.asarray(truth.damping.quadratic)
    for i in range(6):
        estimate = found[f"damping.quadratic[{i}]"]
        assert abs(estimate.value - quadratic[i]) < 4 * estimate.standard_error
    assert found.noise["roll"] < 0.006
    turned = identify(guess, log, start=start, parameters=names)
    assert turned.iterations < 30, "compared as rotations attitude does not jump"
    for i in range(6):
        estimate = turned[f"damping.quadratic[{i}]"]
        assert abs(estimate.value - quadratic[i]) < 4 * estimate.standard_error
