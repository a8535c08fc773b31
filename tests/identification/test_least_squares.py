"""Levenberg–Marquardt ends where the gradient vanishes, and says so only there."""

from __future__ import annotations

import numpy as np
import pytest

from coadjoint.identification.least_squares import Estimates, least_squares, reduced, stationary, step


class Shadowed:
    """r = noise + A(δ + φ) + b(φ − φ₀), of whose column by φ the start δ can undo all but one part in 10⁶."""

    def __init__(self):
        random = np.random.default_rng(4)
        self.noise, A = random.normal(size=40), random.normal(size=40)
        b = random.normal(size=40)
        b -= A * (A @ b) / (A @ A)
        self.A, self.b, self.truth = 6e8 * A, 1e3 * b, 0.002

    def residual(self, place: Estimates):
        delta, phi = place.own[0, 0], place.shared[0]
        return (self.noise + self.A * (delta + phi) + self.b * (phi - self.truth))[None], None

    def jacobian(self, place: Estimates, way: None):
        return np.stack([self.A, self.A + self.b], axis=1)[None]


def test_what_starts_can_nearly_undo_is_sought_until_its_next_step_is_inside_its_error():
    problem = Shadowed()
    found = least_squares(problem, Estimates(np.zeros(1), np.zeros((1, 1))))
    assert found is not None and found.converged
    assert stationary(found.jacobian, found.residual, 1)
    _, _, errors = step(found.jacobian, found.residual, 1, 0.0)
    assert abs(found.place.shared[0] - problem.truth) < 4 * errors[0]


def test_a_place_off_the_valley_is_not_stationary():
    problem = Shadowed()
    place = Estimates(np.zeros(1), np.zeros((1, 1)))
    found = problem.residual(place)
    assert not stationary(problem.jacobian(place, None), found[0], 1)


def test_starts_that_the_log_does_not_see_stay_though_round_off_moves_residuals_by_them():
    """As velocities where only an attitude is logged: columns of 1e-17 led to steps of 1e15."""
    random = np.random.default_rng(8)
    J, r = random.normal(size=(4, 30, 5)), random.normal(size=(4, 30))
    J[..., 1] = 1e-17 * random.normal(size=(4, 30))
    shared, own, errors = step(J, r, 3, 0.0)
    seen = np.delete(J, 1, axis=2)
    expected, others, spread = step(seen, r, 2, 0.0)
    assert np.allclose(shared, expected, rtol=1e-9) and np.allclose(errors, spread, rtol=1e-9)
    assert np.allclose(np.delete(own, 1, axis=1), others, rtol=1e-6) and np.max(np.abs(own[:, 1])) < 1e-2
    left, taken = reduced(J, 3)
    expected, others = reduced(seen, 2)
    assert np.allclose(left, expected, atol=1e-9) and np.allclose(taken, others, atol=1e-9)


class Ledged(Shadowed):
    """A plain problem whose residuals are larger by one part in 10⁶ everywhere but at one place near the optimum."""

    def __init__(self, place: float):
        super().__init__()
        self.A, self.b, self.ledge = self.A / 6e8, self.b / 1e3, place

    def residual(self, place: Estimates):
        (found,), way = super().residual(place)
        return (found if place.shared[0] == self.ledge else found * (1 + 1e-6))[None], way


def test_a_search_that_a_kink_holds_near_the_optimum_has_converged():
    smooth = Ledged(np.nan)
    best = least_squares(smooth, Estimates(np.zeros(1), np.zeros((1, 1))))
    assert best is not None and best.converged
    _, _, (error,) = step(best.jacobian, best.residual, 1, 0.0)
    for off in (1e-3, 1e-5):
        at = best.place.shared + off * error
        found = least_squares(Ledged(at[0]), Estimates(at, best.place.own))
        assert found is not None and found.converged


def test_a_start_without_samples_moves_by_what_other_segments_know_of_it():
    """As velocities of a segment whose first seconds do not count: by its own column it would move by 10⁶."""
    J, r = np.zeros((2, 4, 2)), np.ones((2, 4))
    J[:, :, 1], J[0, :2, 0], J[1, 3, 0] = [1.0, 2.0, -1.0, 1.0], 1.0, 1e-6
    for damping in (0.0, 1e-3):
        _, own, _ = step(J, r, 1, damping, np.array([False, True]))
        _, far, _ = step(J, r, 1, damping)
        np.testing.assert_allclose(own[0], far[0], rtol=0.5)
        assert np.abs(far[1, 0]) > 1e5 and np.abs(own[1, 0]) < min(200, 1e-2 / max(damping, 1e-9))


class Bent:
    """r = (10, δ, φ₁, 100 (φ₂ + φ₂²/50)): φ₁ is at its optimum from the start, φ₂ after three steps."""

    def residual(self, place: Estimates):
        bent = 100 * (place.shared[1] + 0.02 * place.shared[1] ** 2)
        return np.array([[10.0, place.own[0, 0], place.shared[0], bent]]), None

    def jacobian(self, place: Estimates, way: None):
        return np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 100 * (1 + 0.04 * place.shared[1])]]])


def test_a_search_goes_on_until_every_number_has_settled():
    found = least_squares(Bent(), Estimates(np.array([0.0, 0.1]), np.zeros((1, 1))))
    assert found is not None and found.converged
    assert abs(100 * found.place.shared[1]) < 1e-5 and found.squares == pytest.approx(100.0, abs=1e-9)
