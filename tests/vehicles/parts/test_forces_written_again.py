"""Forces of parts beside their equations written again, where the other tests do not look."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from test_parts import RHO, pushed

from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint_vehicles.parts import Hull, Propeller
from coadjoint_vehicles.parts.fin import lift_and_drag


def test_hull_strips_that_sway_and_heave_while_turning_are_the_integral_along_the_hull():
    hull = Hull("hull", axial_drag=0.0, axial_area=0.0, crossflow_drag=(0.5, 0.6), width=0.4, height=0.3, length=2.0)
    areas = np.array([0.5 * 0.3, 0.6 * 0.4])
    worst = 0.0
    for v, omega in [((0.2, -0.1), (0.3, 0.5)), ((0.05, 0.3), (-0.4, 0.6)), ((0.3, 0.02), (0.2, -0.9))]:
        found = pushed(hull, [0, *v], [0, *omega])
        # 200 nodes on each side of the middle of each of 40 pieces.
        nodes, weights = np.polynomial.legendre.leggauss(200)
        edges = np.linspace(-1, 1, 41)
        x = np.concatenate([0.5 * (a + b) + 0.5 * (b - a) * nodes for a, b in pairwise(edges)])
        dx = np.concatenate([0.5 * (b - a) * weights for a, b in pairwise(edges)])
        w = np.array(v) + np.outer(x, [omega[1], -omega[0]])
        push = -0.5 * RHO * (dx * (w**2 @ areas) / np.linalg.norm(w, axis=1))[:, None] * w
        expected = [0, *push.sum(axis=0), 0, -x @ push[:, 1], x @ push[:, 0]]
        worst = max(worst, np.max(np.abs(found - expected)) / np.max(np.abs(expected)))
    # Four nodes on either side of the pivot are off by 8.4e-5, three by 1.8e-4, two by 1.0e-3.
    assert worst < 1.2e-4


@pytest.mark.parametrize("slope", [2.0, 3.4, 5.5])
@pytest.mark.parametrize("least", [0.0, 0.02])
@pytest.mark.parametrize("away", [-0.06, -0.02, 0.0, 0.02, 0.06])
def test_lift_and_drag_of_a_fin_through_its_stall(slope, least, away):
    stall = 0.35
    angle, speed = stall + away, 1.7
    found = evaluate(lift_and_drag, speed * np.cos(angle), speed * np.sin(angle), slope, stall, least)
    attached = slope * np.sin(angle) * np.cos(angle)
    aspect_ratio = 2 * slope / (2 * np.pi - slope)
    share = 1 / (1 + np.exp(-100 * (np.sin(angle) ** 2 - np.sin(stall) ** 2)))
    lift = (1 - share) * attached + share * np.sin(2 * angle)
    drag = (1 - share) * (least + attached**2 / (np.pi * aspect_ratio)) + share * (
        least * np.cos(angle) ** 2 + 2 * np.sin(angle) ** 2
    )
    np.testing.assert_allclose(found, speed**2 * np.array([lift, drag]), rtol=1e-12)
    if away == 0.0:
        assert share == 0.5, "the middle of the stall"


PROPELLER = Propeller(
    "propeller", diameter=0.2, thrust=(0.45, -0.35), torque=(0.06, -0.04), thrust_deduction=0.1, wake_fraction=0.2,
    torque_fraction=0.7, limit=30.0,
)  # fmt: skip


@pytest.mark.parametrize("revolutions", [-20.0, -5.0, 0.0, 5.0, 20.0])
@pytest.mark.parametrize("ahead", [-1.5, 0.0, 1.5])
def test_a_propeller_ahead_and_astern_in_flow_from_both_sides(revolutions, ahead):
    advance = 0.8 * ahead if ahead > 0 and revolutions > 0 else 0.0
    n = revolutions
    thrust = RHO * 0.2**4 * (0.45 * n * abs(n) - 0.35 * abs(n) * advance / 0.2)
    torque = RHO * 0.2**5 * (0.06 * n * abs(n) - 0.04 * abs(n) * advance / 0.2)
    expected = [0.9 * thrust, 0, 0, 0.7 * torque, 0, 0]
    np.testing.assert_allclose(pushed(PROPELLER, [ahead, 0, 0], actual=n), expected, rtol=1e-13, atol=1e-13)
    if n < 0:
        assert expected[0] < 0, "astern it pushes astern, by the same curve at bollard"
        assert expected[0] == pytest.approx(-0.9 * RHO * 0.2**4 * 0.45 * n**2, rel=1e-14)
