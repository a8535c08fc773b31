"""A vehicle that pitches up to 87°, where Euler angles jump and a search gets stuck: it begins again and finds it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.errors import CoadjointError
from coadjoint.identification import Log, fitting, identify, synthetic_log
from coadjoint_vehicles import Craft

NOISE = {"north": 0.1, "east": 0.1, "depth": 0.02, "roll": 0.005, "pitch": 0.005, "heading": 0.01}
NOISE |= {"u": 0.01, "v": 0.01, "w": 0.01, "p": 0.003, "q": 0.003, "r": 0.003}


def steps(t, size, seed):
    random, found = np.random.default_rng(seed), np.zeros_like(t)
    for _ in range(5):
        period, phase = random.uniform(3, 15), random.uniform(0, 6.28)
        found += size / 3 * np.sign(np.sin(2 * np.pi * t / period + phase))
    return found


@pytest.mark.parametrize("stuck", [1, fitting.ATTEMPTS])
def test_a_search_begins_again_from_the_parameters_at_which_it_got_stuck_a_few_times(monkeypatch, stuck):
    slider = co.System(
        co.Translation(1),
        lambda xi, p: 0.5 * xi @ xi,
        parameters={"drag": 0.5},
        forces=lambda motion, p: co.Force(torque=-p.drag * motion.xi),
    )
    begun, t = slider.state(xi=[1.0]), np.arange(0.0, 3.05, 0.1)
    log = Log(t, {"speed": np.exp(-0.5 * t) + 1e-3 * np.random.default_rng(3).normal(size=t.size)})
    rounds, asked = fitting._rounds, []

    def counted(fit, place, open_, trips, final):
        asked.append((float(place.shared[0]), final))
        found = rounds(fit, place, open_, trips, final)
        return found._replace(solution=found.solution._replace(converged=len(asked) > stuck))

    monkeypatch.setattr(fitting, "_rounds", counted)
    given: Any = {"start": begun, "parameters": ["drag"], "measured": {"speed": lambda s: s.xi[0]}, "dt": 0.1}
    if stuck == fitting.ATTEMPTS:
        with pytest.raises(CoadjointError, match="Least squares did not converge"):
            identify(slider.replace(drag=0.8), log, **given)
    else:
        assert identify(slider.replace(drag=0.8), log, **given)["drag"].covers(0.5)
    assert [final for _, final in asked] == [n + 1 == fitting.ATTEMPTS for n in range(len(asked))]
    assert len(asked) == min(stuck + 1, fitting.ATTEMPTS) and abs(asked[1][0]) > 0.1, "not from where it began"


def test_an_unstable_motion_is_fitted_on_segments_that_are_short_enough_to_keep_their_start():
    """v̇ = 3v + u under feedback: over segments of 10 s an error of the start grows by e³⁰, over 2.5 s by e⁷·⁵."""
    grows, h, t = 3.0, 0.1, 0.1 * np.arange(400)
    slider = co.System(
        co.Translation(1),
        lambda xi, p: 0.5 * xi @ xi,
        parameters={"drag": -grows},
        forces=lambda motion, p: co.Force(torque=motion.inputs.u - p.drag * motion.xi),
    )
    random = np.random.default_rng(6)
    goal, v, speeds, inputs = np.repeat(random.normal(size=40), 10), 0.0, [], []
    for k in range(len(t)):
        speeds.append(v)
        inputs.append(-5.0 * v + goal[k])
        v = ((1 + grows * h / 2) * v + h * inputs[-1]) / (1 - grows * h / 2)
    log = Log(t, {"speed": np.array(speeds) + 1e-4 * random.normal(size=len(t))}, {"u": np.array(inputs)[:, None]})
    given: Any = {"parameters": ["drag"], "measured": {"speed": lambda s: s.xi[0]}, "dt": h, "between": "held"}
    found = identify(slider.replace(drag=-2.0), log, start=slider.state(xi=[0.0], inputs={"u": [0.0]}), **given)
    assert found.segments > 10 and found["drag"].covers(-grows)


@pytest.mark.long
def test_a_search_that_is_stuck_begins_again_and_comes_to_the_truth():
    vehicle = vehicles.load("bluerov2_heavy_von_benzon")
    craft = Craft(vehicle)
    thrusters: Any = next(part for part in vehicle.parts if part.name == "thrusters")
    t = np.arange(0.0, 40.0, 0.1)
    wanted = np.stack([steps(t, size, i) for i, size in enumerate([40, 40, 40, 1.5, 1.5, 8])], axis=1)
    thrusts = np.clip(wanted @ np.linalg.pinv(thrusters.nominal_matrix).T, *thrusters.extremes)
    with co.float64():
        commands = co.Held(t, np.array([thrusters.commands_for(f, thrusters.nominal) for f in thrusts]))
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
