"""A thruster that is out: its effectiveness is found, or that the log is too short to tell."""

from __future__ import annotations

import numpy as np
import pytest
from tests.identification.outside_logs import bluerov
from tests.torpedo import NOISE

import coadjoint as co
from coadjoint.identification import Log, identify, synthetic_log

SOUGHT = [f"thrusters.effectiveness[{i}]" for i in range(8)]


@pytest.fixture(scope="module")
def made():
    return bluerov(20.0)


@pytest.fixture(scope="module")
def log(made) -> Log:
    """BlueROV2 Heavy, whose third thruster does not push."""
    lost = made.craft.system.replace(thrusters={"effectiveness": np.where(np.arange(8) == 2, 0.0, 1.0)})
    inputs = {name: co.Held(made.time, values) for name, values in made.inputs.items()}
    run = co.simulate(lost, made.start, dt=0.025, duration=19.9, inputs=inputs, save_every=4, monitors=False)
    return synthetic_log(run, noise=NOISE, seed=3)


@pytest.mark.long
@pytest.mark.parametrize("segment", [10.0, 0.5])
def test_its_effectiveness_is_found_to_be_zero(made, log, segment):
    """Whatever the segments: commands change every 1.5 s, and all segments share what is sought."""
    found = identify(made.craft.system, log, start=made.start, parameters=SOUGHT, dt=0.025, segment=segment)
    for i, name in enumerate(SOUGHT):
        assert abs(found[name].value - (i != 2)) < 4 * found[name].standard_error < 0.02
    assert not any("from zero" in warning for warning in found.warnings)


@pytest.mark.long
def test_a_log_in_which_commands_never_change_does_not_tell_eight_thrusters_apart(made, log):
    """In 1 s: forces of eight along six ways. It is too short for misfits as well, and one thruster is told."""
    short = log.between(0.0, 1.0)
    found = identify(made.craft.system, short, start=made.start, parameters=SOUGHT, dt=0.025, segment=None)
    assert all(np.isinf(found[name].standard_error) for name in SOUGHT)
    assert any("cannot separate thrusters" in warning and "change separately" in warning for warning in found.warnings)
    one = identify(made.craft.system, short, start=made.start, parameters=SOUGHT[2:3], dt=0.025, segment=None)
    assert abs(one[SOUGHT[2]].value) < 4 * one[SOUGHT[2]].standard_error < 0.02
    for each in (found, one):
        assert each.misfits == ()
        (told,) = [warning for warning in each.warnings if "too short to show" in warning]
        assert "effects of thrusters" in told and "and 30 are needed" in told
