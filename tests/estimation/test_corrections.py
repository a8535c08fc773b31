"""A correction of many filters together is that of the information form, each by itself."""

from __future__ import annotations

import numpy as np

from coadjoint.estimation.engines import CORRECT, FilterEngine, corrected, symmetric


def test_a_correction_adds_the_information_of_a_measurement():
    """P⁺ = (P⁻¹ + HᵀR⁻¹H)⁻¹, e = P⁺HᵀR⁻¹ν, NIS = νᵀ(HPHᵀ + R)⁻¹ν."""
    random = np.random.default_rng(9)
    root, H, nu = random.normal(size=(3, 4, 4)), random.normal(size=(3, 2, 4)), random.normal(size=(3, 2))
    P, R = root @ root.transpose(0, 2, 1) + np.eye(4), np.array([[2.0, 0.5], [0.5, 1.0]])
    found = corrected(P, H, R, nu)
    for k in range(3):
        information = H[k].T @ np.linalg.inv(R)
        after = np.linalg.inv(np.linalg.inv(P[k]) + information @ H[k])
        np.testing.assert_allclose(found.P[k], after, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(found.e[k], after @ information @ nu[k], rtol=1e-10)
        np.testing.assert_allclose(found.nis[k], nu[k] @ np.linalg.solve(H[k] @ P[k] @ H[k].T + R, nu[k]), rtol=1e-12)
    np.testing.assert_array_equal(found.P, found.P.transpose(0, 2, 1))
    np.testing.assert_array_equal(symmetric(root), symmetric(root).transpose(0, 2, 1))


def test_of_members_the_first_that_stops_is_named_with_what_it_rejected(monkeypatch):
    engine, failed = FilterEngine.__new__(FilterEngine), []
    monkeypatch.setattr(engine, "_measurements", [None], raising=False)
    monkeypatch.setattr(engine, "_correct", lambda *_: np.array([False, True, True]), raising=False)
    monkeypatch.setattr(engine, "_fail", lambda *given: failed.append([np.ravel(one).tolist() for one in given]))
    rows, rejected = np.arange(3.0)[:, None], np.array([[4], [5], [6]])
    orders = np.array([[CORRECT, 0, 0, 0]])
    engine._by_arrays(rows, np.zeros((3, 1, 1)), rejected, orders, np.zeros((1, 1)), np.zeros((3, 2)))
    assert failed == [[[1.0], [CORRECT, 0, 0, 0], [5]]]
