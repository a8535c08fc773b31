"""Coordinates and speeds of the joints of a run, with turns counted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np

from coadjoint.mechanics.state import State
from coadjoint.models.multibody.bonds import Bond
from coadjoint.models.multibody.joints import KINDS

if TYPE_CHECKING:
    import xarray

    from coadjoint.arrays import Array
    from coadjoint.mechanics.system import System

UNITS = {"angle": ("rad", "rad/s"), "distance": ("m", "m/s")}


def joint_data(bonds: Mapping[str, Bond], records: State, system: System) -> xarray.Dataset:
    """NAME and NAME_speed of every joint with coordinates, over the times of records."""
    import xarray

    t, found = np.asarray(records.t), {}
    p = (records.origin.system or system).parameters
    for key, bond in bonds.items():
        names = KINDS[bond.kind].coordinates
        if not names:
            continue
        x, speed = records.each(lambda s, bond=bond: _at_node(bond, s, p))
        for k, name in enumerate(names):
            whole = key if len(names) == 1 else f"{key}_{name}"
            units = UNITS[name]
            value = counted(t, x[:, k], speed[:, k]) if name == "angle" else x[:, k]
            found[whole] = ("time", value, {"units": units[0]})
            found[f"{whole}_speed"] = ("time", speed[:, k], {"units": units[1]})
    return xarray.Dataset(found, coords={"time": ("time", t, {"units": "s"})})


def counted(t: np.ndarray, angle: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """An angle (k,), known but for turns, made continuous: it changes by ½(ω₁ + ω₂)Δt, to within half a turn."""
    expected = 0.5 * (speed[1:] + speed[:-1]) * np.diff(t)
    off = np.diff(angle) - expected
    turns = np.concatenate([[0.0], np.cumsum(np.round(off / (2 * np.pi)))])
    return angle - 2 * np.pi * turns


def _at_node(bond: Bond, s: State, p: Any) -> tuple[Array, Array]:
    """The coordinates of a joint and their speeds at a node, (k,) each."""
    group, Q, V = s.places
    n, a = Q.view(group, s.n), V.view(group, s.a)
    xi = jnp.linalg.solve(p.inertia, jnp.reshape(s.mu, n.shape)[..., None])[..., 0]
    nu = jnp.reshape(s.pi, n.shape) / p.mass[:, None]
    return bond.coordinates(n, a, p), bond.speeds(xi, nu, n, a, p)
