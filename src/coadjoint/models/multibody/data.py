"""Coordinates and speeds of the joints of a run, with turns counted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from coadjoint.arrays import PyTree
from coadjoint.mechanics.state import State
from coadjoint.models.multibody.bonds import Bond
from coadjoint.models.multibody.joints import KINDS
from coadjoint.spaces.named import Named

if TYPE_CHECKING:
    import xarray

    from coadjoint.mechanics.system import System

UNITS = {"angle": ("rad", "rad/s"), "distance": ("m", "m/s")}


class BodyMotions(NamedTuple):
    """The motion of all bodies in space, with the ground as the last, which stands still.

    R: (rows, N, 3, 3). x, omega, v: (rows, N, 3), the mass centre, m, and the velocities, rad/s and m/s.
    """

    R: np.ndarray
    x: np.ndarray
    omega: np.ndarray
    v: np.ndarray


def joint_data(bonds: Mapping[str, Bond], records: State, system: System) -> xarray.Dataset:
    """NAME and NAME_speed of every joint with coordinates, over the times of records."""
    import xarray

    t, found = np.asarray(records.t), {}
    p = (records.origin.system or system).parameters
    moving = _moving(records, p)
    for key, bond in bonds.items():
        names = KINDS[bond.kind].coordinates
        both = _coordinates(bond, getattr(p, key), moving) if names else {}
        for name in names:
            own, units, (x, speed) = key if len(names) == 1 else f"{key}_{name}", UNITS[name], both[name]
            found[own] = ("time", counted(t, x, speed) if name == "angle" else x, {"units": units[0]})
            found[f"{own}_speed"] = ("time", speed, {"units": units[1]})
    return xarray.Dataset(found, coords={"time": ("time", t, {"units": "s"})})


def counted(t: np.ndarray, angle: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """An angle (k,), known but for turns, made continuous: it changes by ½(ω₁ + ω₂)Δt, to within half a turn."""
    expected = 0.5 * (speed[1:] + speed[:-1]) * np.diff(t)
    turns = np.round((np.diff(angle) - expected) / (2 * np.pi))
    return angle - 2 * np.pi * np.concatenate([[0.0], np.cumsum(turns)])


def _moving(records: State, p: PyTree) -> BodyMotions:
    """Bodies and ground at records; ω = J⁻¹μ and ν = π/m are those of the nodes."""
    R = np.asarray(records.g)
    n, mu, pi = (np.reshape(one, R.shape[:3]) for one in (records.n, records.mu, records.pi))
    omega = np.linalg.solve(p.inertia, mu[..., None])[..., 0]
    still = np.zeros((len(R), 1, 3))
    x, omega, v = (
        np.concatenate([np.einsum("tnij,tnj->tni", R, one), still], axis=1)
        for one in (n, omega, pi / np.asarray(p.mass)[:, None])
    )
    return BodyMotions(np.concatenate([R, np.broadcast_to(np.eye(3), (len(R), 1, 3, 3))], axis=1), x, omega, v)


def _coordinates(bond: Bond, own: Named, bodies: BodyMotions) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """The angle and the distance along the axis, with their rates, (time,) each."""
    i, j = bond.first, bond.second
    R, x, omega, v = bodies
    A, B = (R[:, link] @ np.array(axes) for link, axes in zip((i, j), bond.axes, strict=True))
    axis, s = A[:, :, 2], R[:, j] @ own.second
    there = x[:, j] + s - x[:, i]
    C = np.einsum("tki,tkj->tij", A, B)
    drift = v[:, j] + np.cross(omega[:, j], s) - v[:, i] - np.cross(omega[:, i], there)
    return {
        "angle": (np.arctan2(C[:, 1, 0], C[:, 0, 0]), np.sum(axis * (omega[:, j] - omega[:, i]), axis=1)),
        "distance": (np.sum(axis * (there - R[:, i] @ own.first), axis=1), np.sum(axis * drift, axis=1)),
    }
