"""Axes at the border: half turns of space and of the body, against directions that everybody knows."""

from __future__ import annotations

import numpy as np
import pytest

from coadjoint.errors import ArgumentError
from coadjoint.groups import attitude
from coadjoint_vehicles import axes
from coadjoint_vehicles.hydrodynamics.added_mass import added_mass_in_axes

BOTH = ("NED/FRD", "ENU/FLU")
ENU = "ENU/FLU"


@pytest.mark.parametrize("name", BOTH)
def test_both_changes_of_axes_are_rotations_and_their_own_inverse(name) -> None:
    for turn in (axes.space_axes(name), axes.body_axes(name)):
        assert np.linalg.det(turn) == pytest.approx(1.0, abs=1e-15)
        assert np.array_equal(turn @ turn, np.eye(3)) and np.array_equal(turn, turn.T)


def test_directions_keep_their_names() -> None:
    east, north, up = np.eye(3)
    assert np.array_equal(axes.space_vector([east, north, -up], ENU), [[0, 1, 0], [1, 0, 0], [0, 0, 1]])
    forward, port, up = np.eye(3)
    assert np.array_equal(axes.body_vector([forward, -port, -up], ENU), np.eye(3))


@pytest.mark.parametrize(("heading", "yaw"), [("north", 90), ("east", 0), ("south", -90), ("west", 180)])
def test_headings_of_the_compass_in_both_conventions(heading, yaw) -> None:
    """Yaw in ENU counts from east, counter-clockwise; in NED from north, clockwise."""
    compass = {"north": 0, "east": 90, "south": 180, "west": -90}[heading]
    found = np.degrees(axes.euler_zyx(np.radians([yaw, 0, 0]), ENU))
    assert found == pytest.approx([compass, 0, 0], abs=1e-12)


def test_a_nose_up_looks_up_and_a_starboard_side_down_leans_to_starboard_in_both() -> None:
    nose_up = attitude.zyx(*axes.euler_zyx(np.radians([90, -20, 0]), ENU))
    assert nose_up[:, 0] @ [0, 0, 1] == pytest.approx(-np.sin(np.radians(20)))  # forward has an upward part: −down
    leaning = attitude.zyx(*axes.euler_zyx(np.radians([90, 0, 20]), ENU))
    assert leaning[:, 1] @ [0, 0, 1] == pytest.approx(np.sin(np.radians(20)))  # starboard points downward


@pytest.mark.parametrize("name", BOTH)
def test_euler_angles_and_matrices_agree_and_return(name) -> None:
    rng = np.random.default_rng(7)
    angles = rng.uniform([-np.pi, -1.5, -np.pi], [np.pi, 1.5, np.pi], (50, 3))
    turned = axes.euler_zyx(angles, name)
    assert attitude.zyx(*turned.T) == pytest.approx(axes.rotation(attitude.zyx(*angles.T), name), abs=1e-14)
    assert axes.euler_zyx(turned, name) == pytest.approx(angles, abs=1e-14)
    assert np.all(np.abs(turned[:, 0]) <= np.pi)


@pytest.mark.parametrize("name", BOTH)
def test_mechanics_is_the_same_in_both_axes(name) -> None:
    """Energies, powers, moments and transport between frames do not know of axes."""
    rng = np.random.default_rng(8)
    M, both, wrench = rng.normal(size=(6, 6)), rng.normal(size=6), rng.normal(size=6)
    J, v, w, r = rng.normal(size=(3, 3)), *rng.normal(size=(3, 3))
    R = attitude.zyx(0.4, -0.7, 1.9)

    def T(x):
        return axes.twist(x, name)

    def b(x):
        return axes.body_vector(x, name)

    assert T(both) @ axes.twist_matrix(M, name) @ T(both) == pytest.approx(both @ M @ both, rel=1e-13)
    assert T(both) @ T(wrench) == pytest.approx(both @ wrench, rel=1e-13)
    assert b(w) @ axes.body_tensor(J, name) @ b(w) == pytest.approx(w @ J @ w, rel=1e-13)
    assert np.cross(b(r), b(v)) == pytest.approx(b(np.cross(r, v)), abs=1e-14)
    assert axes.rotation(R, name) @ b(v) == pytest.approx(axes.space_vector(R @ v, name), abs=1e-14)
    assert np.array_equal(axes.twist_matrix(axes.twist_matrix(M, name), name), M)


def test_added_mass_turns_as_from_a_panel_program_with_z_up() -> None:
    M = np.random.default_rng(9).normal(size=(6, 6))
    assert np.array_equal(axes.twist_matrix(M, ENU), added_mass_in_axes(M, axes.body_axes(ENU)))


def test_euler_angles_turn_inside_traced_code() -> None:
    from coadjoint.kernels.trace.evaluate import evaluate

    angles = np.array([2.9, 0.2, -0.3])
    assert evaluate(lambda x: axes.euler_zyx(x, ENU), angles) == pytest.approx(axes.euler_zyx(angles, ENU), abs=1e-15)


def test_axes_that_nobody_defined_are_refused() -> None:
    with pytest.raises(ArgumentError, match=r"NED/FRD.*ENU/FLU.*but is 'NWU'"):
        axes.body_vector([1.0, 0, 0], "NWU")  # pyright: ignore[reportArgumentType]
    with pytest.raises(ArgumentError, match=r"shape \(…, 3\), but has shape \(2,\)"):
        axes.space_vector([1.0, 0], ENU)
