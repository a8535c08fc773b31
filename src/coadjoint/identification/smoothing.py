"""Starts of segments of a log: states by polynomials fitted to the samples around."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from coadjoint.errors import ArgumentError
from coadjoint.groups import attitude
from coadjoint.identification.channels import ATTITUDE, POSITION, RATES, VELOCITY
from coadjoint.identification.log import Log

WIDTH, SAMPLES, DEGREE = 0.5, 8, 2
"""A fit takes the samples up to WIDTH s away, SAMPLES at least, by a polynomial of this degree."""


class Pose(NamedTuple):
    """Attitude R (k, 3, 3), position q (k, 3), body rates (k, 3) and body velocity (k, 3) at k times."""

    R: np.ndarray
    q: np.ndarray
    omega: np.ndarray
    v: np.ndarray


def fitted(log: Log, name: str, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Value and slope of a column at times, by local polynomials; angles are unwrapped first."""
    values = log.columns[name]
    good = np.isfinite(values)
    t, y = log.time[good], values[good]
    if log.units.get(name) == "rad":
        y = np.unwrap(y)
    found = np.empty((len(times), 2))
    for k, at in enumerate(times):
        distance = np.abs(t - at)
        count = min(len(t), max(SAMPLES, int(np.sum(distance <= WIDTH))))
        near = np.argsort(distance, kind="stable")[:count]
        degree = min(DEGREE, count - 1)
        powers = (t[near] - at)[:, None] ** np.arange(degree + 1)
        fit = np.linalg.lstsq(powers, y[near], rcond=None)[0]
        found[k] = fit[0], fit[1] if degree else 0.0
    return found[:, 0], found[:, 1]


def poses(log: Log, times: np.ndarray) -> Pose:
    """States of a vehicle at times; roll, pitch and position that the log lacks count as zero.

    Raises ArgumentError if the log does not determine the velocity.
    """
    zero = np.zeros((2, len(times)))
    roll, pitch, heading = (fitted(log, name, times) if name in log.columns else zero for name in ATTITUDE)
    R = attitude.zyx(heading[0], pitch[0], roll[0])
    turned = np.stack([heading[1], pitch[1], roll[1]], axis=-1)
    omega = _measured(log, RATES, times, attitude.zyx_angular_velocity(heading[0], pitch[0], roll[0], turned))
    known = all(name in log.columns for name in POSITION)
    if not known and not all(name in log.columns for name in VELOCITY):
        raise ArgumentError(
            "The log must hold north, east and depth, or u, v and w: it does not determine the velocity."
        )
    places = [fitted(log, name, times) if name in log.columns else zero for name in POSITION]
    q, qdot = (np.stack([place[i] for place in places], axis=-1) for i in (0, 1))
    return Pose(R, q, omega, _measured(log, VELOCITY, times, np.einsum("kji,kj->ki", R, qdot)))


def at_origin(pose: Pose, log: Log) -> Pose:
    """q − Rr and ν − ω × r of O, where sensors of place and velocity sit at r."""
    q, v = pose.q.copy(), pose.v.copy()
    for name, r in log.positions.items():
        if name in POSITION:
            i = POSITION.index(name)
            q[:, i] -= pose.R[:, i] @ np.asarray(r)
        else:
            i = VELOCITY.index(name)
            v[:, i] -= np.cross(pose.omega, r)[:, i]
    # A velocity that was not measured is Rᵀq̇ of places that sensors measured, each at its own r.
    turning = np.zeros_like(q)
    for name, r in log.positions.items():
        if name in POSITION:
            i = POSITION.index(name)
            turning[:, i] = np.einsum("kj,kj->k", pose.R[:, i], np.cross(pose.omega, r))
    apart = np.einsum("kji,kj->ki", pose.R, turning)
    v -= apart * [name not in log.columns for name in VELOCITY]
    return pose._replace(q=q, v=v)


def _measured(log: Log, names: Sequence[str], times: np.ndarray, instead: np.ndarray) -> np.ndarray:
    """The columns at times; `instead` for those that were not logged."""
    columns = [fitted(log, n, times)[0] if n in log.columns else instead[:, i] for i, n in enumerate(names)]
    return np.stack(columns, axis=-1)


def noise(log: Log, name: str) -> float:
    """A first guess of a column's noise: third differences, which remove the smooth part, over √20."""
    values = log.columns[name][np.isfinite(log.columns[name])]
    values = np.unwrap(values) if log.units.get(name) == "rad" else values
    if len(values) < 8:
        raise ArgumentError(f"Column `{name}` has {len(values)} numbers, too few to estimate its noise: give `noise`.")
    guess = float(np.median(np.abs(np.diff(values, 3)))) / 0.6745 / np.sqrt(20)
    return guess or 1e-6 * (float(np.ptp(values)) or 1.0)
