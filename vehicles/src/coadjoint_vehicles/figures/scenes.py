"""The scene of vehicles' runs: hulls with their parts, tracks, way points, surface and bottom, currents."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from coadjoint.extending import thin
from coadjoint.plotting.entries import Entry
from coadjoint.plotting.scene import POINTS, DrawnBody, Member, Moving, Readout, Scene, Shape, quaternions
from coadjoint.plotting.style import COLOURS
from coadjoint_vehicles.figures.shapes import BOTTOM, GEOMETRY, SLENDER
from coadjoint_vehicles.logs.records import VehicleRecords

SLOWED = 0.1
"""Propellers turn at a tenth of their speed, so that eyes can follow."""


def scene(runs: Sequence[Entry], hull: Shape | None = None) -> Scene:
    """The scene of these runs; `hull` takes the place of the hull that the vehicle file describes."""
    members = [_member(run, max(POINTS // len(runs), 50), len(runs) == 1, hull) for run in runs]
    bottoms = [float(run.dataset.attrs[BOTTOM]) for run in runs if BOTTOM in run.dataset.attrs]
    name = str(runs[0].dataset.attrs.get("system", "vehicle"))
    return Scene(
        title=name if len(runs) == 1 else f"{len(runs)} runs of {name}",
        description=" ".join(_words(run, member) for run, member in zip(runs, members, strict=True)),
        members=members,
        down=True,
        surface=True,
        bottom=min(bottoms, default=None),
        way_points=VehicleRecords(runs[0].dataset).way_points,
        enlarge=True,
    )


def _member(run: Entry, capacity: int, alone: bool, hull: Shape | None) -> Member:
    log = VehicleRecords(run.dataset)
    kept = thin(log.position, log.attitude, capacity=capacity)
    return Member(
        label=str(run.dataset.attrs.get("system", "vehicle")) if alone else run.label,
        colour=COLOURS[run.place % len(COLOURS)],
        time=run.time[kept],
        bodies=[_body(run, log, kept, hull)],
        readings=_readings(log, kept),
        current=None if log.current is None else log.current[kept],
    )


def _body(run: Entry, log: VehicleRecords, kept: np.ndarray, hull: Shape | None) -> DrawnBody:
    attrs = run.dataset.attrs
    length = float(attrs.get("vehicle_length", 1.0))
    torpedo = {"kind": "torpedo", "length": length, "diameter": SLENDER * length}
    look = json.loads(attrs[GEOMETRY]) if GEOMETRY in attrs else {"size": length, "shapes": [torpedo], "moving": []}
    return DrawnBody(
        shapes=look["shapes"] if hull is None else [hull, *look["shapes"][1:]],
        place=log.position[kept],
        turn=quaternions(log.directions[kept]),
        size=look["size"],
        moving=[_moving(item, run, kept) for item in look["moving"] if item["variable"] in run.dataset],
    )


def _moving(item: Mapping[str, Any], run: Entry, kept: np.ndarray) -> Moving:
    values = run.values(item["variable"])
    if values.ndim > 1:
        values = values[:, item.get("column", 0)]
    values = item.get("factor", 1.0) * (values + item.get("offset", 0.0))
    if item["motion"] == "spin":
        turns = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(run.time) * (values[1:] + values[:-1]))])
        values = 2 * np.pi * SLOWED * turns
    more = {key: item[key] for key in ("span_axis", "reach") if key in item}
    return Moving(item["shape"], item["at"], item["axis"], item["motion"], values[kept], **more)


def _readings(log: VehicleRecords, kept: np.ndarray) -> list[Readout]:
    roll, pitch, heading = np.degrees(log.attitude[kept]).T
    found = [Readout("depth", "m", log.depth[kept])]
    if "depth" in log.set_points and log.set_points["depth"][0].ndim == 1:
        found.append(Readout("set point", "m", log.set_points["depth"][0][kept], wraps=True))
    found += [
        Readout("speed over ground", "m/s", np.linalg.norm(log.velocity[kept], axis=1)),
        Readout("heading", "°", heading % 360, 1, wraps=True),
        Readout("pitch", "°", pitch, 1),
        Readout("roll", "°", roll, 1, wraps=True),
    ]
    if log.current is not None:
        found.append(Readout("current", "m/s", np.linalg.norm(log.current[kept], axis=1)))
    return found


def _words(run: Entry, member: Member) -> str:
    """The text alternative of a scene: a run in words."""
    log = VehicleRecords(run.dataset)
    north, east, depth = log.position[-1] - log.position[0]
    return (
        f"{member.label}: from t = {run.time[0]:.6g} s to {run.time[-1]:.6g} s it goes {north:.4g} m north, "
        f"{east:.4g} m east and {depth:.4g} m down, "
        f"at depths from {np.min(log.depth):.4g} m to {np.max(log.depth):.4g} m."
    )
