"""Levenberg–Marquardt ends where the gradient vanishes, and says so only there."""

from __future__ import annotations

import numpy as np

from coadjoint.identification.least_squares import Estimates, least_squares, stationary, step


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
