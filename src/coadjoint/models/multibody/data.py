"""Coordinates and speeds of the joints of a run, with turns counted."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from coadjoint import checks
from coadjoint.arrays import PyTree
from coadjoint.errors import ArgumentError, FileError
from coadjoint.mechanics.members import count_members, member_of
from coadjoint.mechanics.state import State
from coadjoint.models.multibody.bonds import Bond
from coadjoint.models.multibody.joints import labels
from coadjoint.spaces.named import Named

if TYPE_CHECKING:
    import xarray

    from coadjoint.mechanics.system import System

UNITS = {"angle": ("rad", "rad/s"), "distance": ("m", "m/s"), "length": ("m", "m/s")}


class BodyMotions(NamedTuple):
    """The motion of all bodies in space, with the ground as the last, which stands still.

    R: (rows, N, 3, 3). x, omega, v: (rows, N, 3), the mass centre, m, and the velocities, rad/s and m/s.
    """

    R: np.ndarray
    x: np.ndarray
    omega: np.ndarray
    v: np.ndarray


class Recorded(Protocol):
    """A run: its records and its system."""

    @property
    def records(self) -> State: ...

    @property
    def system(self) -> System: ...

    @property
    def dataset(self) -> xarray.Dataset: ...

    @property
    def final(self) -> State: ...


def joint_data(bonds: Mapping[str, Bond], run: State | Recorded, system: System) -> xarray.Dataset:
    """NAME and NAME_speed of every joint with coordinates, over the times of records, and over members."""
    import xarray

    if not isinstance(run, State):
        reads = _holds_records(run) or hasattr(type(run), "dataset")
        checks.expect(reads, run, "run", "a run or a state of this mechanism")
    if not isinstance(run, State) and not _holds_records(run):
        return _of_dataset(bonds, run, system)
    states, of = (run, run.origin.system or system) if isinstance(run, State) else (run.records, run.system)
    if states.places != system.places or set(of.parameters or ()) != set(system.parameters or ()):
        raise ArgumentError("Argument `run` must be a run of this mechanism, but is one of another system.")
    nodes = {name: np.asarray(getattr(states, name)) for name in ("t", "g", "n", "mu", "pi")}
    t = nodes["t"]
    together = t.ndim == 1 and len(t) > 1 and np.ptp(t) == 0
    if t.ndim < 2 and not together and count_members(of.parameters) is None:
        return _dataset(bonds, nodes, of.parameters)
    rows = ({name: leaf[k] for name, leaf in nodes.items()} for k in range(len(t)))
    return xarray.concat([_dataset(bonds, row, member_of(of.parameters, k)) for k, row in enumerate(rows)], "member")


def _holds_records(run: Recorded) -> bool:
    """Whether the records are in memory, not in a file or folder alone."""
    try:
        return hasattr(run, "records")
    except ArgumentError:
        return False


def _of_dataset(bonds: Mapping[str, Bond], run: Recorded, system: System) -> xarray.Dataset:
    """`joint_data` of a run that streams to a folder, or was read from a file or folder."""
    import xarray

    found = run.dataset
    reactions = {f"reaction_{kind}{one.name}" for one in system.constraints for kind in ("", "step_")}
    own = {str(name) for name in found.data_vars if str(name).startswith("reaction_")}
    if own != reactions or "R" not in found or np.shape(found["R"])[-3:] != (system.group.dim // 3, 3, 3):
        raise ArgumentError("Argument `run` must be a run of this mechanism, but is one of another system.")
    p = _parameters(run, system)

    def of(one: xarray.Dataset, p: PyTree) -> xarray.Dataset:
        nodes = {name: one[key].values for name, key in {"g": "R", "n": "n", "mu": "mu", "pi": "pi"}.items()}
        return _dataset(bonds, {"t": one["time"].values, **nodes}, p)

    if "member" not in found.dims:
        return of(found, p)
    members = (of(found.isel(member=k), member_of(p, k)) for k in range(found.sizes["member"]))
    return xarray.concat(list(members), "member")


def _parameters(run: Recorded, system: System) -> PyTree:
    """The parameters of a run, by its last record; of a streamed run that was loaded those of the system given then."""
    try:
        own = getattr(run, "system", None) or run.final.origin.system
    except FileError:
        own = getattr(run, "_system", None)
    return (own or system).parameters


def _dataset(bonds: Mapping[str, Bond], nodes: Mapping[str, np.ndarray], p: PyTree) -> xarray.Dataset:
    """`joint_data` of t, g, n, μ and π at one node, or at those of one member with a leading axis."""
    import xarray

    if not nodes["t"].ndim:
        return _dataset(bonds, {name: leaf[None] for name, leaf in nodes.items()}, p).isel(time=0)
    t, found = nodes["t"], {}
    moving = _moving(nodes, p)
    for key, bond in bonds.items():
        names = labels(key, bond.kind)
        both = _coordinates(bond, getattr(p, key), moving) if names else {}
        for name, own in names.items():
            units, (x, speed) = UNITS[name], both[name]
            x = counted(t, x, speed) if name == "angle" else x
            bond.warn_of_turns(x, getattr(p, key))
            found[own] = ("time", x, {"units": units[0]})
            found[f"{own}_speed"] = ("time", speed, {"units": units[1]})
    return xarray.Dataset(found, coords={"time": ("time", t, {"units": "s"})})


def counted(t: np.ndarray, angle: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """An angle (k,), known but for turns, made continuous: it changes by ½(ω₁ + ω₂)Δt, to within half a turn."""
    expected = 0.5 * (speed[1:] + speed[:-1]) * np.diff(t)
    turns = np.round((np.diff(angle) - expected) / (2 * np.pi))
    return angle - 2 * np.pi * np.concatenate([[0.0], np.cumsum(turns)])


def _moving(nodes: Mapping[str, np.ndarray], p: PyTree) -> BodyMotions:
    """Bodies and ground; ω = J⁻¹μ and ν = π/m are those of the nodes."""
    R = nodes["g"]
    n, mu, pi = (np.reshape(nodes[name], R.shape[:3]) for name in ("n", "mu", "pi"))
    omega = np.linalg.solve(p.inertia, mu[..., None])[..., 0]
    still = np.zeros((len(R), 1, 3))
    x, omega, v = (
        np.concatenate([np.einsum("tnij,tnj->tni", R, one), still], axis=1)
        for one in (n, omega, pi / np.asarray(p.mass)[:, None])
    )
    return BodyMotions(np.concatenate([R, np.broadcast_to(np.eye(3), (len(R), 1, 3, 3))], axis=1), x, omega, v)


def _coordinates(bond: Bond, own: Named, bodies: BodyMotions) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """The angle, the distance along the axis and the length between the points, with their rates, (time,) each."""
    i, j = bond.first, bond.second
    R, x, omega, v = bodies
    A, B = (R[:, link] @ np.array(axes) for link, axes in zip((i, j), bond.axes, strict=True))
    axis, s = A[:, :, 2], R[:, j] @ own.second
    there = x[:, j] + s - x[:, i]
    C = np.einsum("tki,tkj->tij", A, B)
    drift = v[:, j] + np.cross(omega[:, j], s) - v[:, i] - np.cross(omega[:, i], there)
    d = there - R[:, i] @ own.first
    if bond.kind == "strut":
        length = np.linalg.norm(d, axis=1)
        return {"length": (length, np.sum(d * drift, axis=1) / length)}
    return {
        "angle": (np.arctan2(C[:, 1, 0], C[:, 0, 0]), np.sum(axis * (omega[:, j] - omega[:, i]), axis=1)),
        "distance": (np.sum(axis * d, axis=1), np.sum(axis * drift, axis=1)),
    }
