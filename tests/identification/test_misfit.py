"""A model that is wrong is told with the column that it misses and the command that it goes with."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import signal
from tests.identification.test_sensor_model import NEAR, SOUGHT, STATE, SYSTEM
from tests.torpedo import NOISE, damping, zigzags

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.identification import Log, identify, synthetic_log
from coadjoint.identification.misfit import _features, misfits, portmanteau


def stalling(motion, p):
    """Fins whose lift falls behind: δ − 1.2 δ³ of the rudder, and that of the planes as the model has it."""
    inputs, u = motion.inputs, motion.nu[0]
    lift, zero = 10.0 * u * jnp.abs(u), 0.0 * u
    rudder = inputs.rudder - 1.2 * inputs.rudder**3
    return co.Force(
        torque=-0.7 * lift * jnp.stack([zero, inputs.planes, rudder]),
        force=jnp.stack([inputs.thrust, -lift * rudder, lift * inputs.planes]),
    )


def simulated(forces):
    t, inputs = zigzags(60.0)
    signals = {name: co.Held(t, values) for name, values in inputs.items()}
    plant = co.System(
        SYSTEM.group, SYSTEM.lagrangian, additional=SYSTEM.additional, advected=SYSTEM.advected,
        parameters=SYSTEM.parameters, forces=forces, name="plant",
    )  # fmt: skip
    return co.simulate(plant, STATE, dt=0.05, duration=59.9, inputs=signals, save_every=2, monitors=False)


@pytest.mark.long
@pytest.mark.parametrize("seeds", [range(2), pytest.param(range(100), marks=pytest.mark.long)])
def test_a_rudder_that_stalls_is_named(seeds):
    """In at least nine of ten logs, and first of all misfits."""
    run = simulated({"damping": damping, "fins": stalling})
    named = 0
    for seed in seeds:
        found = identify(NEAR, synthetic_log(run, noise=NOISE, seed=seed), start=STATE, parameters=SOUGHT)
        worst = found.misfits[:1]
        named += bool(worst) and worst[0].input == "rudder" and worst[0].column in ("heading", "r", "v")
        if seed == 0:
            assert found.misfits[0].column in str(found)
            assert len(found.plot_innovations(["r", "heading"]).axes) == 4
            with pytest.raises(ArgumentError, match="no column `speed`"):
                found.plot_innovations(["speed"])
        assert not worst or any(f"misses {worst[0].column} where" in warning for warning in found.warnings)
    assert named >= 0.9 * len(seeds)


@pytest.mark.long
def test_white_innovations_are_no_misfit():
    """Of 100 logs whose innovations are white one in a thousand may be said to be missed; so many with innovations that
    follow one another, which tell nothing of a command."""
    t, inputs = zigzags(60.0)
    random, alarms = np.random.default_rng(5), np.zeros(2)
    for _ in range(100):
        white: dict[str, Any] = {name: random.normal(size=len(t)) for name in ("u", "r")}
        slow: dict[str, Any] = {name: signal.lfilter([1.0], [1.0, -0.8], values) for name, values in white.items()}
        alarms += [bool(misfits(Log(t, one, inputs), one)) for one in (white, slow)]
    assert np.all(alarms < 3)


def test_what_follows_a_command_late_is_found_with_its_lag_and_sign():
    t, inputs = zigzags(60.0)
    w = np.random.default_rng(1).normal(size=len(t))
    late = np.concatenate([np.zeros(5), inputs["planes"][:-5]])
    log = Log(t, {"q": w - 1.5 * late, "u": np.where(t > 30, np.nan, w)}, inputs)
    (one,) = misfits(log, dict(log.columns))
    assert (one.column, one.input, one.lag) == ("q", "planes", 0.5)
    assert one.correlation < 0 and one.following < 1e-3


def test_q_is_uniform_for_white_noise_and_vanishes_for_coloured():
    random = np.random.default_rng(2)
    p = [portmanteau(random.normal(size=400)) for _ in range(200)]
    assert 0.4 < np.mean(p) < 0.6 and 0.02 < np.mean(np.array(p) < 0.05) < 0.11
    assert portmanteau(np.convolve(random.normal(size=410), np.ones(4), "valid")) < 1e-6
    assert portmanteau(np.full(40, 0.3)) == portmanteau(np.array([1.0, -2.0, np.nan])) == 1.0


def test_a_log_that_is_shorter_than_a_lag_has_no_misfit_and_no_warning():
    """Of 40 samples in 0.4 s none has a command 1 s or 2 s before."""
    import warnings

    t = 0.01 * np.arange(40)
    random = np.random.default_rng(2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert misfits(Log(t, {"u": t}, {"rudder": np.sin(9 * t)}), {"u": random.normal(size=40)}) == ()


def widths(random, count=600):
    """Pulse widths of eight thrusters, anew every 1.5 s."""
    return 1500 + np.repeat(random.uniform(-200, 200, (count // 15, 8)), 15, axis=0)


def test_what_all_thrusters_do_together_is_found_where_none_alone_is_clear():
    """A force of the squares of all commands about 1500 µs, each of which has a thirtieth of the variance."""
    random, t = np.random.default_rng(3), 0.1 * np.arange(600)
    commands = widths(random)
    square = (commands - 1500) ** 2
    force = ((square - square.mean(axis=0)) / square.std(axis=0)).sum(axis=1) / np.sqrt(8)
    log = Log(t, {"q": random.normal(size=600) + 0.6 * force}, {"thrusters": commands})
    (one,) = misfits(log, dict(log.columns))
    assert (one.column, one.input, one.lag) == ("q", "thrusters", 0.0)
    assert one.shape == "(thrusters − their means)²" and type(one.correlation) is float
    assert 0.3 < one.correlation < 0.7 and one.score > 5


def test_what_a_shape_counts_from_is_told_of_each_command():
    """Means of two widths are 1480 and 1530 µs: no mean of both counts for either. A third changes its sign."""
    t = 0.1 * np.arange(600)
    wave = np.sin(t)
    for commands, together in (
        (np.stack([1480 + 60 * wave, 1530 + 20 * wave], axis=1), "(pulses − their means)²"),
        (np.stack([1480 + 60 * wave, 20 * wave], axis=1), "(pulses − the means of those that keep their sign)²"),
    ):
        shapes = {(one.input, one.shape) for one in _features(Log(t, {"u": t}, {"pulses": commands}))}
        first = commands[:, 0].mean()
        assert ("pulses", together) in shapes and ("pulses[1]", f"(pulses[1] − {first:.4g})²") in shapes


@pytest.mark.long
def test_white_innovations_are_no_misfit_of_many_commands_either():
    random, t, alarms = np.random.default_rng(8), 0.1 * np.arange(600), 0
    for _ in range(60):
        white = {name: random.normal(size=600) for name in ("u", "r", "w")}
        alarms += bool(misfits(Log(t, white, {"thrusters": widths(random)}), white))
    assert alarms <= 1
