"""Faults and what is dropped: closed forms, and runs that begin where the fault comes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint_vehicles import Craft, Vehicle, load
from coadjoint_vehicles.model import Fault
from coadjoint_vehicles.parts import Payload

PLACE = np.array([0.4, 0.1, 0.3])
BODY = Vehicle(
    name="carrier",
    mass=30.0,
    inertia=np.diag([0.5, 4.0, 4.5]),
    added_mass=np.diag([2.0, 25.0, 30.0, 0.2, 3.0, 3.5]),
    center_of_mass=(0.0, 0.0, 0.02),
    volume=32.0 / 1026,
)
CARRIER = replace(BODY, parts=(Payload("payload", mass=4.0, position=PLACE, volume=0.002),))
START = {"position": (1.0, 2.0, 20.0), "velocity": (1.0, 0.2, -0.1), "angular_velocity": (0.1, -0.2, 0.3)}


def dropped(dt: float, duration: float = 4.0) -> co.Run:
    craft = Craft(CARRIER, faults=[Fault("payload", value=1.0, time=2.0)])
    return co.simulate(craft.system, craft.start(**START), dt=dt, duration=duration)


@pytest.mark.long
def test_what_is_dropped_takes_its_momentum_along_and_no_velocity_changes() -> None:
    """ν and ω of the node are continuous; P = R m v_r, and the energy loses ½m|v_r|² − m g z + ρ V g z."""
    run = dropped(0.01)
    data, k = run.dataset, 200
    assert data.internal_payload_dropped.values[k - 1] == 0.0 and data.internal_payload_dropped.values[k] == 1.0
    nu, xi, R = (data[name].values[k] for name in ("nu", "xi", "R"))
    v = R @ (nu + np.cross(xi, PLACE))
    np.testing.assert_allclose(data.internal_payload_momentum.values[k], 4.0 * v, rtol=1e-12)
    np.testing.assert_allclose(data.internal_payload_momentum.values[-1], 4.0 * v, rtol=1e-12)
    # Accelerations are below 3 m/s² and 3 rad/s²; with continuous momenta v alone would jump by 0.1 m/s.
    for name in ("nu", "xi"):
        assert np.max(np.abs(np.diff(data[name].values[k - 2 : k + 3], axis=0))) < 0.03
    depth = data.q.values[k, 2] + (R @ PLACE)[2]
    lost = 0.5 * 4.0 * v @ v + (1026 * 0.002 - 4.0) * 9.81 * depth
    energy = data.energy.values
    assert energy[k - 1] - energy[k + 1] == pytest.approx(lost, rel=1e-4)
    assert np.ptp(energy[:k]) < 1e-3 and np.ptp(energy[k + 1 :]) < 1e-3


@pytest.mark.long
def test_after_a_drop_a_craft_moves_as_one_that_never_had_it() -> None:
    """To O(h²), from the place and the velocities of the drop."""
    gaps = []
    for dt in (0.02, 0.01):
        run = dropped(dt)
        node = run.dataset.isel(time=round(2.0 / dt))
        craft = Craft(BODY)
        begun = craft.start(
            position=node.q.values,
            velocity=node.nu.values,
            euler_zyx=np.array(co.attitude.zyx_angles(node.R.values)),
            angular_velocity=node.xi.values,
        )
        after = co.simulate(craft.system, begun, dt=dt, duration=2.0)
        gaps.append(np.linalg.norm(after.final.q - run.final.q))
    assert gaps[1] < 1e-4 and gaps[0] / gaps[1] == pytest.approx(4.0, rel=0.3)


@pytest.mark.long
def test_a_fin_that_is_stuck_and_one_that_stays_steer_on() -> None:
    """A rudder stuck at 0.1 rad from 1 s on is one that is commanded so from there; without a value it stays."""
    remus = load("remus_100")
    commands = {"rudder": 0.02, "stern_planes": 0.0, "propeller": 20.0}
    told = {**commands, "rudder": co.Held([0.0, 1.0], [0.02, 0.1])}
    at_once = replace(remus, parts=tuple(_at_once(part) for part in remus.parts))
    craft = Craft(at_once, faults=[Fault("rudder", value=0.1, time=1.0)])
    other = Craft(at_once)
    start = {"speed": 1.5, "position": (0, 0, 5.0)}
    one = co.simulate(craft.system, craft.start(**start), dt=0.05, duration=5.0, inputs=commands)
    two = co.simulate(other.system, other.start(**start), dt=0.05, duration=5.0, inputs=told)
    np.testing.assert_allclose(one.final.q, two.final.q, rtol=1e-12)
    assert one.dataset.internal_faults_rudder.values[[19, 20]].tolist() == [0.0, 1.0]
    craft = Craft(at_once, faults=[Fault("rudder", time=1.0)])
    moved = {**commands, "rudder": co.Held([0.0, 0.5, 2.0], [0.02, 0.05, -0.1])}
    run = co.simulate(craft.system, craft.start(**start), dt=0.05, duration=5.0, inputs=moved)
    assert run.dataset.internal_rudder.values[-1] == 0.05


def _at_once(part):
    return replace(part, lag=None) if getattr(part, "lag", None) else part


@pytest.mark.long
def test_one_thruster_is_out_from_an_event_on() -> None:
    """Below 5.2 m the third thruster of a BlueROV2 stands at neutral, whatever its command, and stays there."""
    vehicle = load("bluerov2_heavy_blue")
    name = vehicle.commanded[0].name
    event = Fault(name, value=1500.0, which=(2,), when=lambda motion, p: motion.q[2] - 5.2, name="third")
    craft = Craft(vehicle, faults=[event])
    push = 1500.0 + 50.0 * np.array([1, 1, 1, 1, -2, 2, 2, -2])
    run = co.simulate(
        craft.system, craft.start(position=(0, 0, 5.0), velocity=(0, 0, 0.3)), dt=0.05, duration=3.0,
        inputs={name: push},
    )  # fmt: skip
    there = run.dataset.internal_faults_third.values
    first = int(np.argmax(there))
    depth = run.dataset.q.values[:, 2]
    assert first > 0 and depth[first - 1] < 5.2 <= depth[first] and np.all(there[first:] == 1)
    thrusters = run.dataset[f"internal_{name}"].values
    assert np.all(thrusters[first:, 2] == 1500) and np.all(thrusters[-1, [0, 1, 3]] > 1540)


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ({"part": "fin", "time": 1.0}, "no actuator"),
        ({"part": "rudder"}, "either a time or `when`"),
        ({"part": "rudder", "time": 1.0, "value": 3.0}, "the range of the fin"),
        ({"part": "rudder", "time": 1.0, "which": (0,)}, "`which`"),
        ({"part": "rudder", "time": np.nan}, "time"),
    ],
)
def test_a_fault_that_cannot_be_has_a_sentence(fault: dict, expected: str) -> None:
    with pytest.raises(ArgumentError, match=expected):
        Craft(load("remus_100"), faults=[Fault(**fault)])
