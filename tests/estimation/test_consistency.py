"""What filters say of their own errors, with vehicles, their sensors and a hundred seeds."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.stats import chi2
from simulated import around, drawn, measured

import coadjoint as co
from coadjoint.estimation import Filter, GaussMarkov, Measurement, ModelProcess
from coadjoint_vehicles import sensors

H = 0.1
SPREAD = {"g": 0.01, "q": [1.0, 1.0, 0.1], "xi": 0.005, "nu": 0.02, "water.velocity": [0.03, 0.03, 0.0]}
EVERY = {"dvl": 2, "depth": 5, "compass": 5, "gyro": 1, "usbl": 20}

CURRENT = {"water.velocity": GaussMarkov([0.03, 0.03, 0.0], 900.0)}
COMMANDS = {"stern_planes": 0.0, "rudder": 0.05, "propeller": 25.0}


@cache
def remus():
    """REMUS 100 in a current, turning."""
    craft = co.vehicles.Craft(co.vehicles.load("remus_100"), water=co.vehicles.water.UniformWater((0.02, 0.03, 0.0)))
    start = craft.start(position=(0, 0, 10), speed=1.5)
    noise = {"torque": 0.05, "force": 0.5}
    return ModelProcess(craft.system, start, inputs=COMMANDS, noise=noise, drifting=CURRENT), start


def instruments():
    e = sensors.Errors
    found = [
        sensors.Dvl(name="dvl", rate=5.0, velocity=e(noise=0.01), position=(0.3, 0, 0.05)),
        sensors.Depth(name="depth", rate=2.0, depth=e(noise=0.03)),
        sensors.Compass(name="compass", rate=2.0, heading=e(noise=0.02)),
        sensors.Usbl(name="usbl", rate=0.5, beacon=(30.0, 40.0, 2.0), range=e(noise=0.3), direction=e(noise=0.02)),
    ]
    one = {sensor.name: sensors.measurement(sensor) for sensor in found}
    return {**one, "gyro": Measurement(lambda motion: motion.xi, 0.002**2)}


@pytest.mark.long
def test_the_errors_of_a_matched_model_are_those_that_the_filter_states():
    """The mean NEES of 100 seeds lies in its 95 % band at 90 % of the times, and so does the mean NIS."""
    members, steps, random = 100, 300, np.random.default_rng(2026)
    process, start = remus()
    filter = Filter(process, start, measurements=instruments(), deviations=SPREAD, members=members)
    first = around(process, process.row(start), filter.P[0], members, random)
    truth = drawn(process, first, steps, H, random)
    times = H * np.arange(steps + 1)
    found = filter.run(measured(filter, truth, times, EVERY, random), dt=H, save_every=10, covariances=True)
    nees, free = found.nees(truth[::10])
    assert free == 14
    low, high = chi2.ppf([0.025, 0.975], members * free) / members
    mean = nees.mean(axis=1)[1:]
    assert np.mean((low < mean) & (mean < high)) >= 0.9
    for one in found.nis.values():
        size = one.nis.mean()
        low, high = chi2.ppf([0.001, 0.999], one.nis.size * round(size)) / one.nis.size
        assert low < size < high and one.used.all()
    assert np.array_equal(found.covariances, found.covariances.swapaxes(-1, -2))
