"""Point vortices against what is known in closed form, in time and, for rigid rotation, on the grid."""

from __future__ import annotations

import numpy as np
import pytest

import coadjoint as co
from coadjoint.models import point_vortices
from coadjoint.models.point_vortices import plane_positions, sphere_positions

MIDPOINT = co.HamiltonianMidpoint()


def ring(count: int, radius: float = 1.0) -> np.ndarray:
    angle = 2 * np.pi * np.arange(count) / count
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def moved(circulations, positions, dt: float, steps: int, **options) -> tuple[np.ndarray, co.Run]:
    system = point_vortices.plane(circulations=circulations)
    start = point_vortices.plane_start(system, positions=positions)
    run = co.simulate(system, start, dt=dt, steps=steps, method=MIDPOINT, accuracy=False, **options)
    return plane_positions(run.records.mu, circulations), run


def turns(r: np.ndarray) -> np.ndarray:
    """The angle of r (nodes, 2) from step to step."""
    return np.diff(np.unwrap(np.arctan2(r[:, 1], r[:, 0])))


@pytest.mark.long
def test_two_vortices_turn_by_arcsin_of_h_times_their_rate():
    gamma, d, h = [1.0, 2.0], 0.8, 0.1
    r, run = moved(gamma, [[0.3, 0.1], [0.3 + d, 0.1]], h, 40)
    rate = sum(gamma) / (2 * np.pi * d**2)
    np.testing.assert_allclose(turns(r[:, 1] - r[:, 0]), np.arcsin(h * rate), rtol=1e-12)
    centre = np.average(r, axis=1, weights=gamma)
    np.testing.assert_allclose(centre, centre[:1].repeat(41, axis=0), atol=1e-14)
    assert run.relative_change("angular_impulse") < 1e-13


@pytest.mark.long
def test_a_pair_of_opposite_circulations_goes_straight_on():
    d, h = 0.5, 0.1
    r, run = moved([1.5, -1.5], [[0.0, 0.5 * d], [0.0, -0.5 * d]], h, 20)
    speed = 1.5 / (2 * np.pi * d)  # the upper, counterclockwise one is carried by the lower to +x
    np.testing.assert_allclose(r[:, :, 0], speed * h * np.arange(21)[:, None] * np.ones(2), atol=1e-13)
    np.testing.assert_allclose(r[:, :, 1], [[0.5 * d, -0.5 * d]] * 21, atol=1e-14)
    assert run.relative_change("energy") < 1e-12


def test_a_triangle_of_equal_sides_turns_rigidly_whatever_the_circulations():
    gamma, side, h = [1.0, 0.5, -0.4], 1.2, 0.2
    r, run = moved(gamma, ring(3, side / np.sqrt(3)), h, 30)
    about = r - np.average(r, axis=1, weights=gamma)[:, None]
    for k in range(3):
        np.testing.assert_allclose(turns(about[:, k]), np.arcsin(h * sum(gamma) / (2 * np.pi * side**2)), rtol=1e-11)
    assert max(run.relative_change(name) for name in ("energy", "impulse_x", "angular_impulse")) < 1e-12


class TestThomsonsRing:
    """N vortices of Γ on a ring of radius R turn at Γ(N − 1)/(4πR²); a wave of number m grows at the rate

    Γ/(4πR²) √(m(N − m)(m(N − m) − 2(N − 1))): up to N = 6 none does, N = 7 is neutral, from N = 8 on it falls apart.
    """

    @pytest.mark.long
    def test_seven_turn_at_their_rate(self):
        r, _ = moved(np.full(7, 2.0), ring(7, 1.5), 0.1, 20, monitors=False)
        np.testing.assert_allclose(turns(r[:, 0]), np.arcsin(0.1 * 2.0 * 6 / (4 * np.pi * 1.5**2)), rtol=1e-11)

    @pytest.mark.long
    def test_up_to_six_it_is_stable_and_eight_fall_apart_at_the_rate_of_the_alternating_wave(self):
        for count in (6, 8):
            m, alternating = count // 2, (-1.0) ** np.arange(count)
            square = m * (count - m) * (m * (count - m) - 2 * (count - 1))
            start = ring(count) * (1 + 1e-8 * alternating)[:, None]
            r, _ = moved(np.full(count, 4 * np.pi), start, 0.01, 200, monitors=False)
            wave = np.abs(np.hypot(r[..., 0], r[..., 1]) @ alternating) / count
            if square <= 0:
                assert np.max(wave) < 2e-8
            else:
                grown = np.log(wave[200] / wave[120]) / (80 * 0.01)
                assert grown == pytest.approx(np.sqrt(square), rel=(0.01 * (count - 1)) ** 2)  # (hΩ)²


def test_two_vortices_on_a_sphere_turn_about_their_moment():
    R, gamma = 2.0, np.array([1.0, 2.5])
    x = R * np.array([[0, 0.6, 0.8], [0.8, 0, -0.6]])
    system = point_vortices.sphere(circulations=gamma, radius=R)
    start = point_vortices.sphere_start(system, positions=x)
    moment = gamma @ x
    rate = np.linalg.norm(moment) / (4 * np.pi * R * (R**2 - x[0] @ x[1]))
    errors = []
    for steps in (50, 100):
        run = co.simulate(system, start, dt=2.0 / rate / steps, steps=steps, method=MIDPOINT, accuracy=False)
        turned = co.attitude.from_rotation_vector(2.0 * moment / np.linalg.norm(moment))
        end = sphere_positions(run.final.mu, gamma, R)
        errors.append(np.max(np.abs(end - x @ turned.T)))
        assert max(run.relative_change(f"moment_{k}") for k in "xyz") < 1e-13
        assert np.max(np.abs(np.linalg.norm(sphere_positions(run.records.mu, gamma, R), axis=-1) - R)) < 1e-13
    assert errors[1] < 2e-3 and errors[0] / errors[1] == pytest.approx(4, rel=0.02)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: point_vortices.plane(circulations=[1.0]), "two or more numbers, but has shape"),
        (lambda: point_vortices.plane(circulations=[1.0, 0.0]), "that of vortex 2 is 0"),
        (lambda: moved([1, 1], [[0, 0], [0, 0]], 0.1, 1), "1 and 2 are at one place"),
        (lambda: moved([1, 1], [0, 1], 0.1, 1), r"must have shape \(2, 2\)"),
        (lambda: point_vortices.plane(circulations=[1.0, 2.0]).replace(circulations=[1, 2, 3]), "must hold 2 numbers"),
        (lambda: point_vortices.sphere(circulations=[1.0, 2.0], radius=0.0), "`radius` must be positive"),
        (
            lambda: point_vortices.sphere_start(
                point_vortices.sphere(circulations=[1.0, 2.0], radius=2.0), positions=[[2, 0, 0], [0, 1, 0]]
            ),
            r"sphere of radius 2 m, but \|x_2\| is 1 m",
        ),
        (
            lambda: point_vortices.sphere_start(point_vortices.plane(circulations=[1, 2]), positions=np.eye(3)[:2]),
            "must be a system of co.models.point_vortices.sphere",
        ),
        (
            lambda: point_vortices.plane_start(co.System(co.SO3(), lambda xi: xi @ xi), positions=np.eye(2)),
            "must be a system of co.models.point_vortices.plane",
        ),
        (lambda: sphere_positions(np.zeros(7), [1.0, 2.0], 1.0), r"must have shape \(…, 6\), but have \(7,\)"),
        (lambda: plane_positions([0.0] * 6, [1.0, 2.0]), r"must have shape \(…, 5\), but have \(6,\)"),
    ],
)
def test_wrong_vortices_are_refused_in_a_sentence(call, says):
    with pytest.raises(co.errors.ArgumentError, match=says):
        call()
