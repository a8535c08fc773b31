"""Kinematics between two nodes are those of a motion whose place is a cubic, with all other numbers between."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from coadjoint.groups import attitude
from coadjoint.kernels.trace.evaluate import evaluate
from coadjoint_vehicles.readings.craft_kinematics import _hat, _orthogonal, between
from coadjoint_vehicles.sensors.kinematics import Kinematics

C = np.array([[1.0, 2.0, 3.0], [0.4, -0.2, 0.1], [0.3, 0.1, -0.2], [0.2, -0.1, 0.05]])
"""q = C₀ + C₁t + C₂t² + C₃t³."""
RATE = 0.3


def at(t: float, bottom: float | None = 40.0) -> Kinematics:
    """A craft that turns about down at a constant rate."""
    R = attitude.zyx(RATE * t, 0.0, 0.0)
    velocity, acceleration = C[1] + 2 * t * C[2] + 3 * t**2 * C[3], 2 * C[2] + 6 * t * C[3]
    return Kinematics(
        position=C[0] + t * C[1] + t**2 * C[2] + t**3 * C[3],
        rotation=R,
        velocity=R.T @ velocity,
        omega=np.array([0.0, 0.0, RATE]),
        acceleration=R.T @ acceleration,
        angular_acceleration=np.zeros(3),
        current=np.array([t, 0.0, 0.0]),
        bottom=None if bottom is None else np.array(bottom + t),
        head=np.array(1000.0 * t),
        density=np.array(1000.0 + t),
        t=np.array(t),
    )


def inside(t: float, first: float = 1.0, last: float = 1.5, **more) -> Kinematics:
    return evaluate(lambda a, b, t: between(a, b, t), at(first, **more), at(last, **more), np.array(t))


@pytest.mark.parametrize("t", [1.0, 1.2, 1.5])
def test_a_place_that_is_a_cubic_is_met_and_a_turn_nearly(t):
    found, expected = inside(t), at(t)
    assert found.position == pytest.approx(expected.position, rel=1e-13)
    assert found.rotation == pytest.approx(expected.rotation, abs=1e-6)
    assert found.rotation @ found.velocity == pytest.approx(expected.rotation @ expected.velocity, rel=1e-13)
    assert found.omega == pytest.approx(expected.omega) and found.t == t
    assert (found.current[0], found.bottom, found.density) == pytest.approx((t, 40.0 + t, 1000.0 + t))
    assert found.rotation @ found.rotation.T == pytest.approx(np.eye(3), abs=1e-14)


def test_times_beyond_the_nodes_are_those_of_the_nodes_and_no_bottom_stays_none():
    assert inside(0.5).position == pytest.approx(at(1.0).position) and inside(9.0).position == pytest.approx(
        at(1.5).position
    )
    assert inside(1.2, bottom=None).bottom is None
    assert inside(1.0, 1.0, 1.0).position == pytest.approx(at(1.0).position)


def test_the_hat_is_the_cross_product_and_rows_are_made_orthogonal():
    omega, v = np.array([0.3, -0.2, 0.5]), np.array([1.0, 2.0, -1.0])
    assert evaluate(lambda omega, v: _hat(omega) @ v, omega, v) == pytest.approx(np.cross(omega, v))
    R = attitude.zyx(0.3, 0.2, 0.1)
    skewed = R + 1e-3 * np.arange(9.0).reshape(3, 3)
    found = evaluate(lambda R: _orthogonal(jnp.asarray(R)), skewed)
    assert found @ found.T == pytest.approx(np.eye(3)) and np.linalg.det(found) == pytest.approx(1.0)
    assert found[2] == pytest.approx(skewed[2] / np.linalg.norm(skewed[2])) and found == pytest.approx(R, abs=1e-2)
