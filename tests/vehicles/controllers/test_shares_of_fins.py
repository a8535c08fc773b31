"""Which fins turn about which axis, and vehicles whose fins cannot."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import jax
import numpy as np
import pytest

import coadjoint as co
from coadjoint.errors import ArgumentError
from coadjoint.extending import evaluate, named
from coadjoint_vehicles import Craft, Vehicle
from coadjoint_vehicles.controllers import Cruise, allocation
from coadjoint_vehicles.controllers.allocation import _shares
from coadjoint_vehicles.parts import Airfoil, Damping, Thrusters
from coadjoint_vehicles.parts.part import Flow


def mixed(monkeypatch: Any, torques: Any, screws: Any) -> Any:
    """The allocation of commands with these torques (3, k), of which `screws` push ahead."""
    torques = np.asarray(torques, dtype=float)
    motion = SimpleNamespace(effects=np.concatenate([np.zeros((3, torques.shape[1])), torques]), names=("a", "b", "c"))
    monkeypatch.setattr(allocation, "propulsion", lambda motion: np.array(screws))
    return allocation.allocation(cast(Any, motion))


def test_fins_share_a_turn_and_screws_push_alone(monkeypatch):
    found = mixed(monkeypatch, [[0.0, 0.0, 0.3], [2.0, 0.0, 0.0], [0.0, -4.0, 0.0]], [False, False, True])
    matrix = np.asarray(found[0])
    assert matrix[:, 1].tolist() == [1.0, 0.0, 0.0] and matrix[:, 2].tolist() == [0.0, -1.0, 0.0]
    assert matrix[:, 3].tolist() == [0.0, 0.0, 1.0] and not matrix[:, 0].any()


def test_fins_that_pitch_and_turn_only_together_are_refused(monkeypatch):
    with pytest.raises(ArgumentError, match="cannot pitch and turn it one without the other"):
        mixed(monkeypatch, [[0.0, 0.0, 0.0], [2.0, 4.0, 0.0], [1.0, 2.0, 0.0]], [False, False, True])


@pytest.mark.parametrize(
    ("torques", "screws"),
    [
        ([[0.0] * 3, [2.0, 0.0, 0.0], [0.0, 4.0, 0.0]], [False, False, False]),
        ([[0.0] * 3, [2.0, 0.0, 0.0], [0.0, 0.0, 0.0]], [False, False, True]),
        ([[0.0] * 3, [0.0, 0.0, 0.0], [0.0, 4.0, 0.0]], [False, False, True]),
    ],
    ids=["no screw", "no rudder", "no stern planes"],
)
def test_a_vehicle_needs_a_screw_and_fins_that_pitch_and_turn(monkeypatch, torques, screws):
    with pytest.raises(ArgumentError, match="found a, b, c"):
        mixed(monkeypatch, torques, screws)


def test_shares_are_of_a_unit_torque_and_alone_where_no_other_comes_with_it():
    shares, alone = _shares(np.array([[1.0, 1.0], [2.0, -2.0], [0.0, 0.0]]))
    assert shares[:, 0] == pytest.approx([0.5, 0.5]) and shares[:, 1] == pytest.approx([0.25, -0.25])
    assert alone.tolist() == [True, True, False]


def test_a_foil_that_meets_the_flow_straight_has_the_slope_of_its_lift():
    place: dict[str, Any] = {"position": (0, 0, 0), "chord": (1, 0, 0), "normal": (0, 0, 1)}
    foil = Airfoil("tail", area=0.02, lift_slope=4.0, stall=0.5, drag_slope=0.1, limit=0.5, **place)
    flow = Flow(np.eye(3)[0], np.zeros(3), np.float64(1000.0), np.eye(3)[2], 0.0, 0.0)  # pyright: ignore
    own = named(foil.parameters())
    slope = evaluate(lambda x: jax.jacfwd(lambda angle: foil.force(flow, angle, own).force)(x), np.float64(0.0))
    assert abs(slope[2]) == pytest.approx(0.5 * 1000 * 0.02 * 4.0, rel=1e-12)


@pytest.mark.long
def test_a_propeller_whose_axis_points_aft_flies_ahead_with_negative_turns():
    """Its commands are those of the same propeller with its axis ahead, with the other sign."""
    runs = []
    for sign in (1.0, -1.0):
        tail: dict[str, Any] = {"area": 0.02, "lift_slope": 4.0, "stall": 0.5, "drag_slope": 0.1, "limit": 0.5}
        fins = [
            Airfoil("elevator", position=(-0.8, 0, 0), chord=(1, 0, 0), normal=(0, 0, 1), **tail),
            Airfoil("rudder", position=(-0.8, 0, 0), chord=(1, 0, 0), normal=(0, 1, 0), **tail),
        ]
        screw = Thrusters(
            "screw", {"quadratic": 0.01}, positions=[[-0.9, 0, 0]], directions=[[sign, 0, 0]], limit=80.0, unit="rad/s"
        )
        damping = Damping("damping", quadratic=(8, 100, 100, 1, 60, 60))
        body: dict[str, Any] = {"mass": 30.0, "inertia": (0.2, 4, 4), "added_mass": (1.0, 30, 30, 0.1, 4, 4)}
        body |= {"center_of_buoyancy": (0, 0, -0.03), "length": 1.6}
        torpedo = Vehicle(name="tail", **body, parts=(screw, damping, *fins))
        craft = Craft(torpedo, controller=Cruise(speed=1.2))
        assert (
            isinstance(craft.controller, Cruise)
            and craft.controller.thrust_limit == 80.0
            and craft.controller.feed_forward > 0
        )
        inputs = {"depth": 4.0, "heading": 0.5, "speed": 1.2}
        start = craft.start(position=(0, 0, 3), speed=1.2)
        runs.append(co.simulate(craft.system, start, dt=0.05, duration=40, inputs=inputs))
    ahead, aft = (run.dataset.internal_screw.values[:, 0] for run in runs)
    np.testing.assert_allclose(aft, -ahead, atol=1e-9)
    assert aft[-1] < -10 and runs[1].final.q[2] == pytest.approx(4.0, abs=0.2)
