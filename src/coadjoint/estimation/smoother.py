"""The smoother of a log: later measurements correct earlier states, backwards from a filter's estimates.

Sources: H. E. Rauch, F. Tung, C. T. Striebel, *Maximum likelihood estimates of linear dynamic systems*, AIAA J. 3
(1965); G. Bourmaud, R. Mégret, A. Giremus, Y. Berthoumieu, *From intrinsic optimization to iterated extended Kalman
filtering on Lie groups*, J. Math. Imaging Vis. 55 (2016).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from coadjoint import checks
from coadjoint.errors import ArgumentError
from coadjoint.estimation.filtered import Filtered


def smoothed(found: Filtered) -> Filtered:
    """The states of a log given all of its measurements, by the smoother of Rauch, Tung and Striebel on the group.

    With x̂_k, P_k of the filter after the measurements at t_k, x̂⁻ = Φ(x̂_k) and P⁻ = ΦP_kΦᵀ + Q before those at the
    next node, and G = P_kΦᵀP⁻⁻¹, the smoothed state is retract(x̂_k, G e) with x̂ˢ_{k+1} = retract(x̂⁻, e), and its
    covariance P_k + G(Pˢ_{k+1} − P⁻)Gᵀ, backwards from the last node. In the linear case these are the means and
    covariances given the complete log.

    found: of `Filter.run` with covariances=True and every node kept. Returns the same at its nodes, with NIS unchanged.
    Raises ArgumentError where covariances or nodes were not kept.
    """
    checks.instance(found, "found", Filtered, "the result of `Filter.run`")
    if found.covariances is None or found.every != 1:
        raise ArgumentError("Smoothing needs every covariance: run the filter with covariances=True, save_every=1.")
    process, one = found._process, found.rows.ndim == 2
    if process.projector is not None and getattr(process, "error", "left") != "left":
        raise ArgumentError("Smoothing on constraints takes errors in body axes: make the process with error='left'.")
    rows, P = (part[:, None].copy() if one else part.copy() for part in (found.rows, found.covariances))
    for k in range(len(found.t) - 2, -1, -1):
        h = float(found.t[k + 1] - found.t[k])
        here = _held(process, rows[k], rows[k + 1])
        after, course = process.stepped(here, h)
        Phi, Q = process.linearised(here, after, h, course)
        before = Phi @ P[k] @ Phi.transpose(0, 2, 1) + Q
        G = _gain(P[k], Phi, before)
        e = process.errors(after, rows[k + 1])
        back = np.linalg.pinv(process.carrying(e, np.concatenate([after, rows[k + 1]], axis=1))[1], rcond=1e-9)
        change = process.admitted(after, back @ P[k + 1] @ back.transpose(0, 2, 1)) - before
        P[k] = P[k] + G @ change @ G.transpose(0, 2, 1)
        e, here = (G @ e[:, :, None])[:, :, 0], rows[k].copy()
        rows[k] = process.moved(here, e)
        P[k] = process.carried(P[k], e, here, rows[k])
        P[k] = 0.5 * (P[k] + P[k].transpose(0, 2, 1))
        P[k] = process.admitted(rows[k], P[k])
    deviations = np.sqrt(np.maximum(np.diagonal(P, axis1=2, axis2=3), 0.0))
    rows, P, deviations = (part[:, 0] if one else part for part in (rows, P, deviations))
    return found.replaced(rows, deviations, P)


def _held(process: Any, rows: np.ndarray, following: np.ndarray) -> np.ndarray:
    """Rows with the inputs that were held over the step that leads to the following ones."""
    held = rows.copy()
    held[:, process.commanded] = following[:, process.commanded]
    return held


def _gain(P: np.ndarray, Phi: np.ndarray, before: np.ndarray) -> np.ndarray:
    """P Φᵀ (P⁻)⁻¹, scaled by deviations; directions that are known exactly do not take part."""
    variances = np.diagonal(before, axis1=1, axis2=2)
    scale = np.where(variances > 0, 1.0 / np.sqrt(np.where(variances > 0, variances, 1.0)), 0.0)
    relative = before * scale[:, :, None] * scale[:, None, :]
    right = scale[:, :, None] * (Phi @ P.transpose(0, 2, 1))
    inverse = np.linalg.pinv(relative, rcond=1e-13, hermitian=True)
    return (scale[:, :, None] * (inverse @ right)).transpose(0, 2, 1)
