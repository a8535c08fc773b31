"""White noise over a step, next to the exact covariance of a linear system (Van Loan's matrix exponential)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from test_filter import body, oscillator

import coadjoint as co
from coadjoint.estimation import Filter, ModelProcess
from coadjoint.kernels.trace.evaluate import evaluate


def exact(A: np.ndarray, S: np.ndarray, P: np.ndarray, t: float) -> np.ndarray:
    """e^{At}P e^{Aᵀt} + ∫ e^{As}SSᵀe^{Aᵀs} ds; C. F. Van Loan, IEEE Trans. Automat. Control 23 (1978)."""
    n, zero = len(A), np.zeros_like(A)
    found = expm(t * np.block([[-A, S @ S.T], [zero, A.T]]))
    Phi = found[n:, n:].T
    return Phi @ P @ Phi.T + Phi @ found[:n, n:]


@pytest.mark.long
def test_a_free_mass_has_the_covariance_of_continuous_white_noise_after_one_step():
    system = co.System(co.SO3(), lambda xi, n, nu: 0.5 * (xi @ xi + nu @ nu), additional=co.Trivial(1))
    start = system.state(q=[0.0], qdot=[0.3])
    deviations = {"q": 0.05, "nu": 0.3}
    filter = Filter(ModelProcess(system, start, noise={"force": 1.0}), start, measurements={}, deviations=deviations)
    arrays = Filter(filter.process, start, measurements={}, deviations=deviations)
    arrays._engine._filters = None
    for one in (filter, arrays):
        one.predict(1.0)
        place, speed = (one.process.names.index(name) for name in ("q", "pi"))
        P = one.covariance[np.ix_([place, speed], [place, speed])]
        np.testing.assert_allclose(P, [[0.0025 + 0.09 + 1 / 3, 0.09 + 0.5], [0.09 + 0.5, 1.09]], rtol=1e-12)


def test_white_noise_is_of_second_order_in_the_step():
    process, start = oscillator(0.05)
    A, S = np.array([[0.0, 1.0, 0.0], [-4.0, -0.3, 1.0], [0.0, 0.0, 0.0]]), np.diag([0.0, 0.4, 0.05])
    chosen = [process.names.index(name) for name in ("q", "pi", "bias")]
    theirs, off = exact(A, S, np.zeros((3, 3)), 1.0), []
    for steps in (20, 40):
        filter = Filter(process, start, measurements={}, covariance=np.zeros((process.width,) * 2), accuracy=False)
        for _ in range(steps):
            filter.predict(1.0 / steps)
        off.append(np.max(np.abs(filter.covariance[np.ix_(chosen, chosen)] - theirs)))
    np.testing.assert_allclose(np.log2(np.divide(off[:-1], off[1:])), 2.0, atol=0.05)
    assert off[-1] < 1e-3 * np.max(theirs)


@pytest.mark.long
def test_noise_of_a_step_is_the_same_for_errors_on_both_sides():
    (left, start), (right, _) = body("left"), body("right")
    row = left.row(start)[None]
    after = left.advanced(row, 0.1)
    e = 1e-6 * np.eye(left.width)
    J = np.array([evaluate(right.differ, after[0], left.moved(after, one[None])[0]) for one in e]).T / 1e-6
    (_, mine), (_, theirs) = (one.linearised(row, after, 0.1) for one in (left, right))
    np.testing.assert_allclose(J @ mine[0] @ J.T, theirs[0], rtol=1e-5, atol=1e-5 * np.max(theirs[0]))
    drawn = left.errors(np.repeat(after, 20000, 0), left.drawn(np.repeat(row, 20000, 0), 0.1, np.random.default_rng(2)))
    np.testing.assert_allclose(np.cov(drawn.T), mine[0], atol=0.03 * np.max(mine[0]))
