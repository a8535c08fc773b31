"""What is sought of sensors beside the parameters, parameters that are equal, attitude as a rotation, and gaps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.torpedo import NOISE, start, torpedo, zigzags

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.groups import attitude
from coadjoint.identification import Log, identify, rotations, synthetic_log
from coadjoint.identification.channels import ATTITUDE, VEHICLE, Channels
from coadjoint.identification.fit import Fit
from coadjoint.identification.problem import setting
from coadjoint.identification.sensor_model import sensing
from coadjoint.identification.unknowns import unknowns

SYSTEM: Any = torpedo()
STATE = start(SYSTEM)
STEP = 0.05
SOUGHT, TRUE = ["linear[0]", "quadratic[5]"], {"linear[0]": 3.0, "quadratic[5]": 10.0}
NEAR = SYSTEM.replace(linear=[4.0, *SYSTEM.parameters.linear[1:]], quadratic=[*SYSTEM.parameters.quadratic[:5], 7.0])
"""What is sought is off."""


@pytest.fixture(scope="module")
def run():
    t, inputs = zigzags(40.0)
    signals = {name: co.Held(t, values) for name, values in inputs.items()}
    return co.simulate(SYSTEM, STATE, dt=STEP, duration=39.9, inputs=signals, monitors=False)


@pytest.fixture(scope="module")
def log(run):
    """At every second node."""
    return thinned(synthetic_log(run, noise=NOISE, seed=4), np.arange(0, len(run.records.t), 2))


def thinned(log, rows):
    columns, inputs = ({name: values[rows] for name, values in part.items()} for part in (log.columns, log.inputs))
    return Log(log.time[rows], columns, inputs, log.units, log.notes, log.step)


def late(run, delays, noise, seed):
    """The log of sensors that tell what was some nodes before."""
    exact, random = synthetic_log(run), np.random.default_rng(seed)
    rows = np.arange(0, len(run.records.t), 2)
    columns = {}
    for name, values in exact.columns.items():
        behind = np.clip(rows - delays.get(name, 0), 0, len(values) - 1)
        columns[name] = values[behind] + noise[name] * random.normal(size=len(rows))
    inputs = {name: values[rows] for name, values in exact.inputs.items()}
    return Log(exact.time[rows], columns, inputs, exact.units, step=STEP)


def asked(log, **given):
    names = VEHICLE
    sensed = sensing(log, names, **given)
    sought = unknowns(SYSTEM, SOUGHT, [])
    channels = Channels(names, rotation=sensed.rotation)
    return setting(sought, log, STATE, channels, co.Midpoint(), "held", STEP, 0.0, sensed)


@pytest.mark.long
def test_derivatives_by_biases_and_delays_are_those_of_differences(log):
    """Of rotations as far as interpolated matrices are orthogonal, which is to h⁴."""
    one = asked(log, biases=["u", "attitude"], delays={"compass": ATTITUDE, "log": ["u"]}, attitude="rotation")
    fit = Fit(one.shooting(STEP, 10.0), one, np.ones(12))
    random = np.random.default_rng(3)
    shared = np.array([0.05, -0.05, 0.02, 0.1, -0.2, 0.15, 0.013, -0.021])
    place = fit.at(shared)._replace(own=0.02 * random.normal(size=(4, 12)))

    def off(shared, own=place.own):
        at = place._replace(shared=shared, own=own)
        found = fit.predict(at)
        assert found is not None
        return fit.differences(found, shared), fit.slopes(at, found)

    _, slopes = off(shared)
    for column in range(len(shared)):
        ahead = 1e-6 * np.eye(len(shared))[column]
        difference = (off(shared + ahead)[0] - off(shared - ahead)[0]) / 2e-6
        scale = max(1.0, np.abs(difference).max())
        exact = [i for i in range(12) if VEHICLE[i] not in ATTITUDE]
        close = slopes[:, :, 12 + column]
        np.testing.assert_allclose(close[..., exact], difference[..., exact], atol=1e-7 * scale, err_msg=str(column))
        np.testing.assert_allclose(close, difference, atol=2e-5 * scale, err_msg=str(column))
    for column in range(3):
        ahead = 1e-6 * np.eye(12)[column]
        difference = (off(shared, place.own + ahead)[0] - off(shared, place.own - ahead)[0]) / 2e-6
        np.testing.assert_allclose(slopes[:, :, column], difference, atol=2e-5 * np.abs(difference).max())


@pytest.mark.long
def test_biases_are_found_and_hold_their_intervals(log):
    """Those of velocity and rates; unless they are sought, residuals follow one another."""
    true = {"u": 0.05, "q": 0.01, "r": -0.02}
    columns = {name: values + true.get(name, 0.0) for name, values in log.columns.items()}
    off = replace(log, columns=columns)
    wrong = identify(NEAR, off, start=STATE, parameters=SOUGHT)
    found = identify(NEAR, off, start=STATE, parameters=SOUGHT, biases=["u", "q", "r", "p"])
    for name, value in {"bias.u": 0.05, "bias.q": 0.01, "bias.r": -0.02, "bias.p": 0.0, **TRUE}.items():
        assert abs(found[name].value - value) < 3.5 * found[name].standard_error, name
    assert found["bias.u"].standard_error < 0.005
    assert any("are correlated" in warning for warning in wrong.warnings) and not found.warnings
    assert "bias.u" in str(found)


def test_delays_of_groups_of_columns_are_found(run):
    """Two nodes of 0.05 s late in position, three in attitude, one of them before its time in the rates."""
    true = {**dict.fromkeys(("north", "east", "depth"), 2), **dict.fromkeys(ATTITUDE, 3), "r": -1}
    seen = late(run, true, NOISE, 7)
    found = identify(
        NEAR, seen, start=STATE, parameters=SOUGHT,
        delays={"gps": ["position"], "compass": ["attitude"], "r": ["r"]},
    )  # fmt: skip
    for name, nodes in {"gps": 2, "compass": 3, "r": -1}.items():
        delay = found[f"delay.{name}"]
        assert abs(delay.value - nodes * STEP) < 3.5 * delay.standard_error < 0.2, name
    for name, value in TRUE.items():
        assert abs(found[name].value - value) < 3.5 * found[name].standard_error
    assert not any("are correlated" in warning for warning in found.warnings)
    early = seen.time < 0.5 - 1e-9
    assert np.isnan(found.simulated["north"][early]).all() and np.isfinite(found.simulated["north"][~early]).all()
    assert np.isfinite(found.simulated["u"]).all()


def test_an_exact_log_with_bias_and_delay_gives_them_exactly(run):
    """Without noise: a delay of whole nodes, and biases."""
    quiet = late(run, {"heading": 2, "r": 2}, dict.fromkeys(NOISE, 0.0), 0)
    seen = replace(quiet, columns={**quiet.columns, "u": quiet.columns["u"] + 0.03})
    found = identify(
        NEAR, seen, start=STATE, parameters=SOUGHT, biases=["u"],
        delays={"yaw": ["heading", "r"]}, noise=dict.fromkeys(NOISE, 1e-4),
    )  # fmt: skip
    assert found["bias.u"].value == pytest.approx(0.03, abs=1e-6)
    assert found["delay.yaw"].value == pytest.approx(0.1, abs=1e-6)
    for name, value in TRUE.items():
        assert found[name].value == pytest.approx(value, rel=1e-5)


@pytest.mark.long
def test_equal_parameters_are_one_unknown(log):
    """Sway and heave of a round hull: a narrower interval than each alone, and both entries move."""
    near = SYSTEM.replace(quadratic=SYSTEM.parameters.quadratic * [1, 0.7, 0.7, 1, 1, 1])
    alone = identify(near, log, start=STATE, parameters=["quadratic[1]", "quadratic[2]"])
    tied = identify(near, log, start=STATE, parameters=["quadratic[1] = quadratic[2]"])
    assert list(tied.estimates) == ["quadratic[1] = quadratic[2]"]
    one = tied["quadratic[1]"]
    assert one is tied["quadratic[2]"]
    p: Any = tied.system.parameters
    assert p.quadratic[1] == p.quadratic[2] == one.value
    assert one.standard_error < min(alone[f"quadratic[{i}]"].standard_error for i in (1, 2))
    assert abs(one.value - 100) < 3.5 * one.standard_error


def test_parts_are_tied_by_their_names():
    system = co.vehicles.Craft(co.vehicles.load("remus_100")).system
    sought = unknowns(system, ["rudder.area = stern_planes.area"], [])
    (one,) = sought.each
    assert len(one.places) == 2
    filled: Any = sought.replaced(np.array([0.5])).parameters
    assert filled.rudder.area == filled.stern_planes.area == pytest.approx(1.5 * 0.0133)


def test_log_and_its_jacobian_of_rotations():
    """log exp v = v up to nearly half a turn; dδ of exp(v + dv) = exp(v) exp(J_r dv)."""
    random = np.random.default_rng(1)
    for size in (1e-9, 1e-5, 0.3, 3.0):
        v = random.normal(size=3)
        v *= size / np.linalg.norm(v)
        np.testing.assert_allclose(rotations.log(rotations.exponential(v)), v, rtol=1e-7)
        inverse = rotations.right_jacobian_inverse(v[None])[0]
        np.testing.assert_allclose(inverse @ rotations.right_jacobian(v), np.eye(3), atol=1e-7)


@pytest.mark.long
def test_a_log_through_the_vertical_is_fitted_by_rotations(run):
    """The same motion with the body's axes turned down by 90°: Euler angles are singular along all of it."""
    t, inputs = zigzags(20.0)
    down = SYSTEM.state(
        g=attitude.zyx(0.3, -np.radians(89.0), 0.0), q=[0, 0, 50.0], xi=[0, 0, 0], qdot=[0, 0, -1.0], a0=[0, 0, 0.0],
        inputs={"thrust": 0.0, "rudder": 0.0, "planes": 0.0},
    )  # fmt: skip
    signals = {name: co.Held(t, 0.3 * values) for name, values in inputs.items()}
    dive = co.simulate(SYSTEM, down, dt=STEP, duration=19.9, inputs=signals, save_every=2, monitors=False)
    log = synthetic_log(dive, noise={name: s for name, s in NOISE.items() if name not in ATTITUDE}, seed=2)
    assert np.abs(log.columns["pitch"]).max() > np.radians(85)
    noise = 0.005 * np.random.default_rng(5).normal(size=(len(log), 3))
    R = rotations.measured(log.columns["roll"], log.columns["pitch"], log.columns["heading"])
    seen = np.stack([R[i] @ rotations.exponential(noise[i]) for i in range(len(R))])
    heading, pitch, roll = attitude.zyx_angles(seen)
    log = replace(log, columns={**log.columns, "heading": heading, "pitch": pitch, "roll": roll})
    found = identify(NEAR, log, start=down, parameters=SOUGHT)
    for name in ATTITUDE:
        assert found.noise[name] == pytest.approx(0.005, rel=0.2), name
    assert abs(found["linear[0]"].value - 3.0) < 3.5 * found["linear[0]"].standard_error


def test_gaps_end_segments_and_are_told(log):
    """A tenth of the rows at random, one stretch of 6 s, and half of the values of u are missing."""
    random = np.random.default_rng(8)
    changed = np.any([np.diff(values, prepend=values[0]) != 0 for values in log.inputs.values()], axis=0)
    keep = (changed | (random.random(len(log)) > 0.1)) & ~((log.time > 20) & (log.time < 26))
    holed = thinned(log, np.flatnonzero(keep))
    holed.columns["u"][::2] = np.nan
    found = identify(NEAR, holed, start=STATE, parameters=SOUGHT)
    told = " ".join(found.warnings)
    assert "values of u are missing" in told and "rows are missing, up to" in told
    assert "The log has a gap from 20 to 26" in told or "The log has a gap from 19.9 to 26" in told
    for name, true in TRUE.items():
        assert abs(found[name].value - true) < 3.5 * found[name].standard_error


@pytest.mark.long
def test_actuators_after_a_gap_are_where_the_log_has_them():
    """The rudder moves while nobody logs: what it does after the gap is taken, and else its command."""
    craft = co.vehicles.Craft(co.vehicles.load("remus_100"))
    t = np.concatenate([np.arange(0, 10, 0.1), np.arange(30, 40, 0.1)])
    columns = {**dict.fromkeys(VEHICLE, 0 * t), "u": 0 * t + 1.5}
    commands = {"rudder": np.where(t < 20, 0.1, -0.2), "stern_planes": 0 * t, "propeller": 15 + 0 * t}
    begun = craft.start(position=(0, 0, 20), speed=1.5, actuators={"propeller": 15.0})
    for actual, expected in (({"rudder": np.where(t < 20, 0.1, -0.15)}, -0.15), ({}, -0.2)):
        log = Log(t, columns, commands, actual=actual)
        sought, channels = unknowns(craft.system, ["hull.axial_drag"], ()), Channels(VEHICLE, ())
        asked = setting(sought, log, begun, channels, co.Midpoint(), "held", None, 0.0)
        shooting = asked.shooting(0.05, 5.0)
        fit = Fit(shooting, asked, np.ones(len(VEHICLE)))
        found = fit.predict(fit.at(np.zeros(1)))
        assert found is not None and shooting.samples.after_gap.tolist() == [False, False, True, False]
        for internal in (shooting.held, shooting.internal(found)):
            assert np.ravel(internal.rudder)[2] == expected and np.ravel(internal.propeller)[2] == 15
        assert np.ravel(shooting.internal(found).rudder)[1] == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"biases": "u"}, r"`biases` must be a list of names, such as \['u'\]"),
        ({"biases": ["speed"]}, "`biases` names `speed`, which the log does not hold"),
        ({"delays": "position"}, "`delays` must be a list"),
        ({"delays": {"gps": ["north"], "dvl": ["north", "u"]}}, "north in `gps` and in `dvl`"),
        ({"delays": ["u"], "longest_delay": -1.0}, "`longest_delay` must be positive"),
        ({"delays": ["u"], "longest_delay": 30.0}, "below a quarter of the log's"),
        ({"attitude": "euler"}, '`attitude` must be "angles" or "rotation"'),
        ({"attitude": "rotation", "delays": ["heading"]}, "has one delay"),
        ({"parameters": ["linear[0] = linear[1]"]}, "must begin equal, but `linear\\[0\\]` is 3"),
        ({"parameters": ["linear = added_mass[0,0]"]}, "must have as many numbers"),
        ({"parameters": ["quadratic[1] = quadratic[2]", "quadratic[1]"]}, "share a number"),
    ],
)  # fmt: skip
def test_a_wrong_use_is_told_in_a_sentence(log, change, told):
    with pytest.raises(ArgumentError, match=told):
        identify(SYSTEM, log, **{"start": STATE, "parameters": ["linear"], **change})


def test_a_rotation_needs_all_three_angles(log):
    flat = replace(log, columns={name: values for name, values in log.columns.items() if name != "roll"})
    with pytest.raises(ArgumentError, match="the log holds no roll"):
        identify(SYSTEM, flat, start=STATE, parameters=["linear"], attitude="rotation")


@pytest.mark.parametrize("angle", [1e-3, 2.9, np.pi - 1e-3, np.pi - 1e-6, np.pi - 1e-9, np.pi])
def test_rotations_up_to_half_a_turn_have_a_logarithm(angle):
    """exp(log R) = R, with |log R| the angle, also where the antisymmetric part of R vanishes."""
    from scipy.spatial.transform import Rotation

    axes = np.random.default_rng(3).normal(size=(50, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    axes[:3] = np.eye(3)
    R = Rotation.from_rotvec(angle * axes).as_matrix()
    found = rotations.log(R)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), angle, atol=1e-9)
    np.testing.assert_allclose(Rotation.from_rotvec(found).as_matrix(), R, atol=1e-9)
