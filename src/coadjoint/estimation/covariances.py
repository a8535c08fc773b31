"""Covariances of many filters at once: how a step and a measurement change them, symmetric and positive."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


def predicted(P: np.ndarray, Phi: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """Φ P Φᵀ + Q, each (members, n, n)."""
    return symmetric(Phi @ P @ Phi.transpose(0, 2, 1) + Q)


def symmetric(P: np.ndarray) -> np.ndarray:
    """½ (P + Pᵀ)."""
    return 0.5 * (P + P.transpose(0, 2, 1))


class Correction(NamedTuple):
    """e (members, n) = K ν, P after it, and νᵀS⁻¹ν (members,)."""

    e: np.ndarray
    P: np.ndarray
    nis: np.ndarray


def corrected(P: np.ndarray, H: np.ndarray, R: np.ndarray, nu: np.ndarray) -> Correction:
    """By Joseph's form, P⁺ = (1 − KH) P (1 − KH)ᵀ + K R Kᵀ with K = P Hᵀ S⁻¹, S = H P Hᵀ + R.

    P: (members, n, n). H: (members, m, n). R: (m, m). nu: ν = y − ŷ, (members, m).
    """
    Ht = H.transpose(0, 2, 1)
    PHt = P @ Ht
    S = H @ PHt + R
    K = np.linalg.solve(S, PHt.transpose(0, 2, 1)).transpose(0, 2, 1)
    nis = np.einsum("bi,bi->b", nu, np.linalg.solve(S, nu[:, :, None])[:, :, 0])
    rest = np.eye(P.shape[1]) - K @ H
    after = rest @ P @ rest.transpose(0, 2, 1) + K @ R @ K.transpose(0, 2, 1)
    return Correction((K @ nu[:, :, None])[:, :, 0], symmetric(after), nis)
