"""Energies of linked bodies are those of their attitudes and places in space, differentiated in time."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
from coadjoint.groups import attitude
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint.mechanics.parameters import Parameters
from coadjoint.models import falling_cat
from coadjoint.models.rods.shapes import _clamps


def test_the_energy_of_a_falling_cat_is_that_of_its_halves():
    """½ Σ ω·Jω + ½ m_r |ḋ|² − ½k|x|² of halves that turn in space about their common centre of mass."""
    p = Parameters(
        mass=np.array([1.0, 3.0]), axial=np.array([0.2, 0.3]), transverse=np.array([1.1, 1.4]),
        reach=np.array([0.5, 0.7]), stiffness=2.0,
    )  # fmt: skip
    xi, x, v = np.array([0.3, -0.2, 0.5]), np.array([0.4, -0.6]), np.array([0.7, 0.9])

    def placed(t):
        """The attitudes of both halves in space, and the way from the rear to the front mass centre."""
        middle, bend = attitude.from_rotation_vector(t * xi), 0.5 * np.r_[0.0, x + t * v]
        front, rear = (middle @ attitude.from_rotation_vector(side * bend) for side in (1, -1))
        return front, rear, p.reach[0] * front[:, 0] + p.reach[1] * rear[:, 0]

    h = 1e-5
    before, here, after = placed(-h), placed(0.0), placed(h)
    expected = -0.5 * p.stiffness * x @ x
    for R, slope, axial, across in zip(here, [(b - a) / (2 * h) for a, b in zip(before, after, strict=True)], p.axial,
                                       p.transverse, strict=False):  # fmt: skip
        hat = R.T @ slope
        omega = np.array([hat[2, 1], hat[0, 2], hat[1, 0]])
        expected += 0.5 * np.sum(np.array([axial, across, across]) * omega**2)
    opening = (after[2] - before[2]) / (2 * h)
    expected += 0.5 * (1.0 * 3.0 / 4.0) * opening @ opening
    assert evaluate(falling_cat.lagrangian, xi, x, v, p) == pytest.approx(expected, rel=1e-8)


def test_a_clamped_end_holds_its_pose_and_the_first_one_its_inverse():
    R = np.stack([attitude.zyx(0.3, 0.2, 0.1), np.eye(3), attitude.zyx(-0.4, 0.1, 0.6)])
    x = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0], [4.0, 5.0, 6.0]])
    turned, moved = _clamps(co.System(co.SO3(), lambda xi: 0.5 * xi @ xi), [(-1, 0), (0, 1), (1, -1)], (R, x))
    assert turned[0] @ R[0] == pytest.approx(np.eye(3)) and turned[0] @ x[0] + moved[0] == pytest.approx(np.zeros(3))
    assert np.array_equal(turned[1:], [np.eye(3), R[2]]) and np.array_equal(moved[1:], [np.zeros(3), x[2]])
    turned, moved = _clamps(co.System(co.SO3(), lambda xi: 0.5 * xi @ xi), [(0, 1), (1, 2)], (R, x))
    assert np.array_equal(turned, [np.eye(3)] * 2) and not moved.any()
