"""Vehicles whose parts put energy in: found by a search, shown, and told by the run that enters such states."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
import coadjoint_vehicles as vehicles
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint_vehicles import Craft, Vehicle
from coadjoint_vehicles.commands.vehicles import _passivity
from coadjoint_vehicles.parts import Damping
from coadjoint_vehicles.trim.passivity import SLIP, _within, driven, pushed
from coadjoint_vehicles.trim.under_way import Level

DRIVEN = {"nps_auv_ii": False, "slocum_graver": True}
"""Shipped vehicles whose parts drive them in some motions, and whether going ahead too."""


def test_motions_of_the_search_stay_within_a_speed_a_slip_and_a_rate_of_turn():
    V = 10 * np.random.default_rng(8).normal(size=(400, 6))
    anywhere, ahead = (_within(V, 2.0, 0.5, only) for only in (False, True))
    for found in (anywhere, ahead):
        speeds, rates = (np.linalg.norm(part, axis=1) for part in (found[:, :3], found[:, 3:]))
        assert speeds.max() == pytest.approx(2.0) and rates.max() == pytest.approx(0.5)
    assert np.min(anywhere[:, 0]) < -1.0
    speeds, rates = (np.linalg.norm(part, axis=1) for part in (ahead[:, :3], ahead[:, 3:]))
    across = np.linalg.norm(ahead[:, 1:3], axis=1)
    assert np.all(ahead[:, 0] > 0) and np.all(across <= np.tan(SLIP) * ahead[:, 0] * (1 + 1e-12))
    assert np.all(rates <= 0.5 * speeds / 2.0 * (1 + 1e-12))
    inside = np.array([[1.0, 0.1, 0.0, 0.0, 0.1, 0.0]])
    np.testing.assert_array_equal(_within(inside, 2.0, 0.5, True), inside)


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", vehicles.names())
def test_shipped_vehicles_are_driven_by_their_parts_only_where_the_docs_say_so(name):
    vehicle = vehicles.load(name)
    found = driven(vehicle)
    assert (found is not None) == (name in DRIVEN)
    assert (driven(vehicle, ahead=True) is not None) == DRIVEN.get(name, False)
    if found is not None:
        nu = np.concatenate([found.velocity, found.angular_velocity])
        level = Level(vehicle)
        power = evaluate(lambda nu: level.push(nu, level.rest) @ nu, nu)
        assert power == pytest.approx(found.power, rel=1e-9) and power > 0
        assert found.rate == pytest.approx(power / (0.5 * nu @ level.mass @ nu), rel=1e-9)


def test_the_search_finds_the_one_eigenvector_along_which_damping_drives():
    """D with a negative eigenvalue −1 N s/m along v = (1, 2, 2)/3: P = |v|² there, and P/E = 2/m."""
    n = np.array([1.0, 2.0, 2.0]) / 3
    D = np.zeros((6, 6))
    D[:3, :3], D[3:, 3:] = 5 * np.eye(3) - 6 * np.outer(n, n), 5 * np.eye(3)
    body = {
        "name": "box",
        "mass": 10.0,
        "inertia": np.eye(3),
        "added_mass": np.zeros((6, 6)),
        "center_of_mass": (0, 0, 0),
    }
    vehicle = Vehicle(**body, parts=(Damping("damping", linear=D),))
    found = driven(vehicle)
    assert found is not None and found.rate == pytest.approx(0.2, rel=1e-3)
    assert abs(found.velocity @ n) == pytest.approx(np.linalg.norm(found.velocity), rel=1e-3)


def test_a_vehicle_whose_propeller_always_turns_is_not_judged():
    tanker = vehicles.load("kvlcc2")
    assert pushed(Level(tanker)) and driven(tanker) is None
    assert _passivity(tanker) == "not judged: its propulsion pushes it at rest, with actuators off"


@pytest.mark.long
def test_a_run_that_enters_such_motions_is_warned_of_and_no_other():
    """NPS AUV II in still water, actuators off, slowly astern and turning: 5.0 kJ grow."""
    craft = Craft(vehicles.load("nps_auv_ii"))
    start = craft.start(velocity=(-0.03, -0.08, 0.04), angular_velocity=(-0.02, 0.42, -0.22))
    run = co.simulate(craft.system, start, dt=0.05, duration=40)
    energy = run.monitors["energy"]
    assert np.max(energy) > 3 * energy[0]
    told = [sentence for sentence in run.warnings if "which should only brake, put in" in sentence]
    assert len(told) == 1 and told[0].startswith("`hull`, `manoeuvring`,")
    with pytest.raises(co.errors.StepError, match=r"did not converge .* which should only brake, put in") as caught:
        co.simulate(craft.system, craft.start(angular_velocity=(0.0, 0.5, 0.0)), dt=0.05, duration=10)
    assert "which should only brake" in caught.value.run.warnings[-1]
    ahead = co.simulate(craft.system, craft.start(speed=1.0), dt=0.05, duration=20)
    assert not any("should only brake" in sentence for sentence in ahead.warnings)


@pytest.mark.long
def test_members_that_enter_such_motions_are_named():
    craft = Craft(vehicles.load("nps_auv_ii"))
    turning, ahead = (-0.02, 0.42, -0.22), (0.0, 0.0, 0.0)
    start = craft.start(
        velocity=co.each([[1.0, 0.0, 0.0], [-0.03, -0.08, 0.04], [-0.03, -0.08, 0.03]]),
        angular_velocity=co.each([ahead, turning, turning]),
    )
    fleet = co.simulate(craft.system, start, dt=0.05, duration=20, accuracy=False)
    told = [sentence for sentence in fleet.warnings if "which should only brake, put in" in sentence]
    assert len(told) == 1
    assert told[0].startswith("In member ") and "; so in 1 more of 3 members: " in told[0]
    assert "member 0" not in told[0]
