"""The smoother of a log is the solution of the whole least-squares problem where all is linear."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from test_late import H, boat, filter

import coadjoint as co
from coadjoint.estimation import Filter, Measurement, ModelProcess, smoothed


def test_a_linear_log_is_smoothed_as_the_whole_problem_is_solved():
    process, _ = boat()
    random, times = np.random.default_rng(4), H * np.arange(1, 41)
    seen = {
        "usbl": (times[4::5], random.normal(size=(8, 2))),
        "speed": (times[::2], 0.5 + 0.05 * random.normal(size=(20, 2))),
    }
    push = 0.3 * random.normal(size=(40, 2))
    one = filter()
    first, P = one.rows[0].copy(), one.P[0].copy()
    found = one.run(seen, dt=H, inputs={"push": (times - H, push)}, covariances=True)
    ours = smoothed(found)
    free = [process.names.index(name) for name in ("q[0]", "q[1]", "pi[0]", "pi[1]")]
    # All nodes together are normal, with the covariance L D Lᵀ of the start and of every noise; then all is measured.
    N, row = len(times) + 1, first
    L, D, rows = np.zeros((4 * N, 4 * N)), np.zeros((4 * N, 4 * N)), [first]
    L[:4, :4], D[:4, :4] = np.eye(4), P[np.ix_(free, free)]
    for k in range(1, N):
        here = process.with_inputs(row[None], {"push": push[k - 1]})
        row = process.advanced(here, H)[0]
        Phi, Q = (part[0][np.ix_(free, free)] for part in process.linearised(here, row[None], H))
        new = slice(4 * k, 4 * k + 4)
        L[new], D[new, new] = Phi @ L[4 * k - 4 : 4 * k], Q
        L[new, new] = np.eye(4)
        rows.append(row)
    C, R, nu = [], [], []
    for name, first_one, variance in (("usbl", 0, 1.0), ("speed", 2, 0.05**2)):
        for t, y in zip(*seen[name], strict=True):
            k = round(t / H)
            state = process.state(rows[k])
            nu.append(y - (state.n if name == "usbl" else state.pi))
            C.append(np.eye(4 * N)[4 * k + first_one : 4 * k + first_one + 2])
            R += [variance] * 2
    C, joint = np.concatenate(C), L @ D @ L.T
    gain = np.linalg.solve(C @ joint @ C.T + np.diag(R), C @ joint).T
    spread = joint - gain @ C @ joint
    for k, e in enumerate((gain @ np.concatenate(nu)).reshape(N, 4)):
        state, mine, here = process.state(rows[k]), process.state(ours.rows[k]), slice(4 * k, 4 * k + 4)
        assert np.allclose(mine.n, state.n + e[:2], atol=1e-10) and np.allclose(mine.pi, state.pi + e[2:], atol=1e-10)
        assert np.allclose(ours.covariances[k][np.ix_(free, free)], spread[here, here], rtol=1e-8, atol=1e-12)
    assert np.all(ours.deviations <= found.deviations + 1e-9)
    assert np.array_equal(ours.rows[-1], found.rows[-1])
    assert np.array_equal(ours.covariances, ours.covariances.transpose(0, 2, 1))


def test_covariances_are_carried_from_the_smoothed_state_to_the_predicted_one(monkeypatch):
    """P_k + G(BPˢBᵀ − P⁻)Gᵀ and x_k + Ge with G = P_kΦᵀP⁻⁻¹, of a process whose errors turn by B⁻¹."""
    monkeypatch.setattr("coadjoint.estimation.smoother.checks.instance", lambda *_: None)
    Phi, Q, carrying = np.array([[1.0, 0.1], [0.2, 0.9]]), np.diag([0.3, 0.2]), np.array([[2.0, 0.5], [-0.3, 1.0]])
    rows, P = np.array([[1.0, 2.0], [1.5, 2.5]]), np.array([np.diag([1.0, 2.0]), [[0.5, 0.1], [0.1, 0.4]]])
    process: Any = SimpleNamespace(
        projector=None, commanded=slice(0), stepped=lambda x, h: (x @ Phi.T, None), errors=lambda x, y: y - x,
        linearised=lambda *_: (Phi[None], Q[None]), carrying=lambda *_: (None, carrying[None]),
        admitted=lambda x, P: P, moved=lambda x, e: x + e, carried=lambda P, *_: P,
    )  # fmt: skip
    found: Any = SimpleNamespace(
        covariances=P, every=1, rows=rows, t=np.array([0.0, 0.1]), _process=process, replaced=lambda *parts: parts
    )
    ours, deviations, covariances = smoothed(found)
    before, B = Phi @ P[0] @ Phi.T + Q, np.linalg.inv(carrying)
    G = P[0] @ Phi.T @ np.linalg.inv(before)
    np.testing.assert_allclose(ours[0], rows[0] + G @ (rows[1] - Phi @ rows[0]), rtol=1e-13)
    np.testing.assert_allclose(covariances[0], P[0] + G @ (B @ P[1] @ B.T - before) @ G.T, rtol=1e-12)
    np.testing.assert_allclose(deviations**2, np.diagonal(covariances, axis1=1, axis2=2), rtol=1e-13)


def test_a_run_that_was_not_kept_whole_cannot_be_smoothed():
    found = filter().run({"speed": ([0.1], [[0.5, 0.0]])}, dt=H)
    with pytest.raises(co.errors.ArgumentError, match="covariances=True, save_every=1"):
        smoothed(found)


@pytest.mark.long
def test_turns_that_are_not_small_are_smoothed_exactly_where_nothing_disturbs_them():
    """A top that turns steadily, whose attitude is told at the end, one radian from where the filter thought."""
    import jax.numpy as jnp

    system = co.System(co.SO3(), lambda xi, p: 0.5 * p.inertia * xi @ xi, parameters={"inertia": 2.0})
    start = system.state(g=np.eye(3), xi=[0.3, -0.2, 0.5])
    process = ModelProcess(system, start)
    whole = Measurement(lambda motion: jnp.ravel(motion.g), 1e-8)
    one = Filter(process, start, measurements={"attitude": whole}, deviations={"g": 10.0})
    for _ in range(20):
        one.predict(H)
    R = np.asarray(one.state.g) @ co.attitude.from_rotation_vector([0.6, 0.5, -0.6])
    one = Filter(process, start, measurements={"attitude": whole}, deviations={"g": 10.0})
    times = H * np.arange(20, 23)
    found = one.run(
        {"attitude": (times, np.stack([R.ravel()] * 3) * [[1], [np.nan], [np.nan]])}, dt=H, covariances=True
    )
    ours = smoothed(found)
    turned = np.linalg.norm(process.errors(found.rows[0], ours.rows[0])[:3])
    assert turned > 0.8
    assert np.allclose(process.advanced(ours.rows[:-1], H), ours.rows[1:], atol=1e-9)
